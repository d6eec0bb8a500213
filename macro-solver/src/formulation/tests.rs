//! Every tangent against differences, every conversion against its inverse, rigid rotations.

use super::conversion::inverse::{cauchy_moduli, cauchy_stress, spatial_from_piola};
use super::tensor::{column, operator, unit};
use super::*;
use crate::material::elastic::{ElasticLaw, ElasticMaterial};
use crate::material::{PointMaterial, PointTrial};
use nalgebra::{Rotation3, Vector3};
use protocol::{TangentKind, TrialOptions};

/// A point with a history: an anisotropically prestressed elastic material after one committed step.
struct Sample {
    material: ElasticMaterial,
    committed: Matrix3<f64>,
}

impl Sample {
    fn new() -> Self {
        let stress = [[-0.5, 0.1, 0.05], [0.1, -0.7, -0.2], [0.05, -0.2, -0.4]];
        let mut material = ElasticMaterial::new(ElasticLaw::SaintVenant, 2.0, 1.0, 1).with_initial_stress(stress);
        let first = Matrix3::new(0.05, 0.12, -0.03, -0.08, -0.06, 0.04, 0.02, 0.01, 0.03);
        let target = tensor::tensor(&first);
        material.evaluate(&[PointTrial { point: 0, target, options: TrialOptions::default() }]).unwrap();
        material.commit().unwrap();
        Self { material, committed: Rotation3::from_euler_angles(0.3, -0.4, 0.8) * (Matrix3::identity() + first) }
    }

    /// Response to a step gradient.
    fn respond(&mut self, formulation: Formulation, gradient: &Matrix3<f64>) -> Response {
        let target = tensor::tensor(&formulation.target(&self.committed, gradient).unwrap());
        let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
        let answer = self.material.evaluate(&[PointTrial { point: 0, target, options }]).unwrap().remove(0);
        let tangent = operator(&answer.tangent.unwrap());
        formulation.response(&self.committed, gradient, &tensor::matrix(&answer.stress), &tangent).unwrap()
    }

    /// Stress conjugate to the gradient on the initial configuration: `det F sigma F^-T`, the Cauchy stress itself
    /// for small strain.
    fn nominal(&mut self, formulation: Formulation, gradient: &Matrix3<f64>) -> Matrix3<f64> {
        let response = self.respond(formulation, gradient);
        let deformation = formulation.deformation(&self.committed, gradient);
        match formulation {
            Formulation::SmallStrain => response.stress,
            _ => first_piola(deformation.determinant(), &deformation.try_inverse().unwrap(), &response.stress),
        }
    }
}

fn step() -> Matrix3<f64> {
    Matrix3::new(0.04, -0.3, 0.05, 0.25, -0.03, 0.1, -0.06, 0.02, 0.07)
}

/// The tangents that elements integrate are the derivatives of the forces: 1e-8 against central differences.
#[test]
fn moduli_of_every_formulation_are_the_derivative_of_its_stress() {
    for formulation in Formulation::ALL {
        let mut sample = Sample::new();
        let response = sample.respond(formulation, &step());
        let deformation = formulation.deformation(&sample.committed, &step());
        // d P / d F on the initial configuration; d sigma / d G for small strain.
        let exact = match formulation {
            Formulation::SmallStrain => response.moduli,
            _ => piola_moduli(deformation.determinant(), &deformation.try_inverse().unwrap(), &response.moduli),
        };
        for pair in 0..9 {
            // A change of F by h e_k e_L is one of G by h e_k e_L F_n^-1.
            let direction = match formulation {
                Formulation::SmallStrain => unit(pair),
                _ => unit(pair) * sample.committed.try_inverse().unwrap(),
            };
            let size = 1e-5;
            let ahead = sample.nominal(formulation, &(step() + size * direction));
            let behind = sample.nominal(formulation, &(step() - size * direction));
            let error = (column(&((ahead - behind) / (2.0 * size))) - exact.column(pair)).amax();
            assert!(error < 1e-8, "{formulation:?} pair {pair}: {error:e}");
        }
    }
}

#[test]
fn conversions_between_tangents_are_inverse_to_each_other() {
    let mut sample = Sample::new();
    let response = sample.respond(Formulation::UpdatedLagrangian, &step());
    let deformation = Formulation::UpdatedLagrangian.deformation(&sample.committed, &step());
    let (determinant, inverse) = (deformation.determinant(), deformation.try_inverse().unwrap());
    let piola = piola_moduli(determinant, &inverse, &response.moduli);
    assert!((spatial_from_piola(&deformation, &piola) - response.moduli).amax() < 1e-13);
    let cauchy = cauchy_moduli(&response.moduli, &response.stress);
    assert!((spatial_moduli(&cauchy, &response.stress) - response.moduli).amax() < 1e-14);
    let nominal = first_piola(determinant, &inverse, &response.stress);
    assert!((cauchy_stress(&deformation, &nominal) - response.stress).amax() < 1e-14);
}

/// The conversion to `d P / d F` gives the closed form of the law, differentiated on the initial configuration.
#[test]
fn total_lagrangian_integrand_is_the_first_piola_stress_of_the_law() {
    let material = ElasticMaterial::new(ElasticLaw::SaintVenant, 2.0, 1.0, 1);
    let deformation = Matrix3::identity() + step();
    let cauchy = material.stress(&deformation);
    let strain: Matrix3<f64> = 0.5 * (deformation.transpose() * deformation - Matrix3::identity());
    // Lame constants of a two-dimensional bulk modulus 2 and a shear modulus 1.
    let second = Matrix3::identity() * strain.trace() + 2.0 * strain;
    let nominal = Formulation::TotalLagrangian.nominal_stress(&deformation, &cauchy).unwrap();
    assert!((nominal - deformation * second).amax() < 1e-14);
}

#[test]
fn a_rigid_rotation_sends_no_strain_and_turns_the_stress() {
    let mut sample = Sample::new();
    let still = sample.respond(Formulation::Corotational, &Matrix3::zeros());
    for angle in [0.01_f64, 0.7, 1.5] {
        let turn = Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(Vector3::new(1.0, -2.0, 0.5)), angle);
        let gradient = turn.matrix() - Matrix3::identity();
        let target = Formulation::Corotational.target(&sample.committed, &gradient).unwrap();
        assert!(target.amax() < 1e-15, "{angle}: {target}");
        let turned = sample.respond(Formulation::Corotational, &gradient);
        assert!((turned.stress - turn.matrix() * still.stress * turn.matrix().transpose()).amax() < 1e-14);
    }
}

#[test]
fn polar_decomposition_is_exact_for_large_stretches_and_refuses_reflections() {
    use super::corotation::Polar;
    let turn = Rotation3::from_euler_angles(2.0, -1.0, 0.5);
    let stretch = Matrix3::new(3.0, 0.2, 0.1, 0.2, 0.05, -0.02, 0.1, -0.02, 1.0);
    let polar = Polar::of(&(turn.matrix() * stretch)).unwrap();
    let errors = [(polar.rotation - turn.matrix()).amax(), (polar.stretch - stretch).amax()];
    assert!(errors[0] < 1e-13 && errors[1] < 1e-13, "{errors:?}");
    assert_eq!(Polar::of(&-Matrix3::identity()), None);
    assert_eq!(Polar::of(&(Matrix3::identity() * f64::NAN)), None);
}

/// A body that is turned has turned grains in every formulation that knows of rotations, whatever frame its material is driven in.
#[test]
fn what_grains_show_is_in_the_fixed_axes() {
    let axis = Vector3::new(0.2, -0.4, 0.7);
    let rotation = *Rotation3::new(axis).matrix();
    let stretch = Matrix3::new(1.1, 0.05, 0.0, 0.05, 0.9, 0.02, 0.0, 0.02, 1.05);
    let fabric = Matrix3::new(0.4, 0.02, 0.0, 0.02, 0.35, 0.01, 0.0, 0.01, 0.25);
    let own = Observed { fabric: super::tensor::tensor(&fabric), mean_rotation: [0.0; 3], ..Observed::default() };
    let seen = Formulation::Corotational.observed_in_space(&own, &(rotation * stretch));
    assert!((Vector3::from(seen.mean_rotation) - axis).norm() < 1e-12);
    assert!((super::tensor::matrix(&seen.fabric) - rotation * fabric * rotation.transpose()).norm() < 1e-12);
    let half_turn = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
    let seen = Formulation::Corotational.observed_in_space(&own, &half_turn);
    assert!((seen.mean_rotation[2].abs() - std::f64::consts::PI).abs() < 1e-12, "{seen:?}");
    for formulation in [Formulation::UpdatedLagrangian, Formulation::TotalLagrangian] {
        assert_eq!(formulation.observed_in_space(&own, &(rotation * stretch)), own);
    }
    // Simple shear: the body turns by half the shear, clockwise.
    let mut sheared = Matrix3::identity();
    sheared[(0, 1)] = 0.02;
    let seen = Formulation::SmallStrain.observed_in_space(&own, &sheared);
    assert_eq!(seen.mean_rotation, [0.0, 0.0, -0.01]);
}
