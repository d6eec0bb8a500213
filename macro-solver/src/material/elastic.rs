//! A closed-form elastic material that verifies elements and solver without any grains.
//!
//! It keeps the contract of a granular point: a trial starts from the committed state, `H` is relative to it, and
//! the tangent is `d sigma_ij / d F_kl` relative to the end of the trial. The state is the total deformation gradient.

use crate::checkpoint::{Archive, CheckpointError};
use crate::element::shapes_at_points;
use crate::formulation::tensor::{Operator, column, matrix, tensor, unit, wire_operator};
use crate::material::PointTrial;
use crate::material::trial_states::{ClosedForm, TrialStates};
use crate::mesh::Mesh;
use crate::problem::InitialStress;
use nalgebra::Matrix3;
use protocol::{Cost, Observed, RveError, Scalars, TangentKind, TrialFlags, TrialOptions, TrialResult};

/// Law between total deformation gradient `F` and Cauchy stress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElasticLaw {
    /// `sigma = lambda tr(e) I + 2 G e` with `e = sym(F - I)`. Not objective: for comparison with linear theory.
    SmallStrain,
    /// Saint Venant-Kirchhoff, `S = S0 + lambda tr(E) I + 2 G E`, `sigma = F S F^T / det F`. Objective.
    SaintVenant,
}

/// Isotropic elasticity at every point. In the plane strain has no component along z, so the law is plane strain;
/// the stress along z is answered too.
#[derive(Clone, Debug)]
pub struct ElasticMaterial {
    law: ElasticLaw,
    lambda: f64,
    shear: f64,
    /// Of every point, Pa.
    initial_stress: Vec<Matrix3<f64>>,
    largest_target: Option<f64>,
    states: TrialStates<Matrix3<f64>>,
}

impl ElasticMaterial {
    /// `points` undeformed points of a plane body with the two-dimensional bulk modulus `bulk` (mean stress of `xx`
    /// and `yy` over areal strain) and shear modulus `shear`, Pa.
    pub fn new(law: ElasticLaw, bulk: f64, shear: f64, points: usize) -> Self {
        Self::with_lame(law, bulk - shear, shear, points)
    }

    /// `points` undeformed points of a spatial body with bulk modulus `bulk` (mean stress over volumetric strain) and
    /// shear modulus `shear`, Pa.
    pub fn spatial(law: ElasticLaw, bulk: f64, shear: f64, points: usize) -> Self {
        Self::with_lame(law, bulk - 2.0 / 3.0 * shear, shear, points)
    }

    fn with_lame(law: ElasticLaw, lambda: f64, shear: f64, points: usize) -> Self {
        Self {
            law,
            lambda,
            shear,
            initial_stress: vec![Matrix3::zeros(); points],
            largest_target: None,
            states: TrialStates::new(vec![Matrix3::identity(); points]),
        }
    }

    /// Starts with a stress, Pa, tension positive.
    #[must_use]
    pub fn with_initial_stress(mut self, stress: [[f64; 3]; 3]) -> Self {
        self.initial_stress.fill(Matrix3::from_fn(|i, j| stress[i][j]));
        self
    }

    /// Starts with the stress of a field at the Gauss points of a mesh.
    #[must_use]
    pub fn with_initial_field(mut self, mesh: &Mesh, field: &InitialStress) -> Self {
        let places = (0..mesh.elements.len()).flat_map(|element| {
            let nodes = mesh.element_positions(element);
            let shapes = shapes_at_points(mesh.kinds[element]);
            shapes.iter().map(move |shape| {
                let share =
                    |axis: usize| nodes.iter().zip(&shape.values).map(|(node, value)| value * node[axis]).sum();
                std::array::from_fn(share)
            })
        });
        self.initial_stress
            .iter_mut()
            .zip(places)
            .enumerate()
            .for_each(|(point, (stress, place))| *stress = field.at(point, place));
        self
    }

    /// Refuses targets whose largest `|H_ij|` exceeds `limit`, as an engine does that has lost the grains.
    #[must_use]
    pub fn with_largest_target(mut self, limit: f64) -> Self {
        self.largest_target = Some(limit);
        self
    }

    /// Cauchy stress of the first point at total deformation gradient `total`, Pa.
    pub fn stress(&self, total: &Matrix3<f64>) -> Matrix3<f64> {
        self.stress_of(0, total)
    }

    fn stress_of(&self, point: usize, total: &Matrix3<f64>) -> Matrix3<f64> {
        let initial = self.initial_stress[point];
        match self.law {
            ElasticLaw::SmallStrain => {
                let gradient = total - Matrix3::identity();
                initial + self.linear(&(0.5 * (gradient + gradient.transpose())))
            }
            ElasticLaw::SaintVenant => {
                let strain = 0.5 * (total.transpose() * total - Matrix3::identity());
                let second_piola = initial + self.linear(&strain);
                total * second_piola * total.transpose() / total.determinant()
            }
        }
    }

    fn linear(&self, strain: &Matrix3<f64>) -> Matrix3<f64> {
        Matrix3::identity() * (self.lambda * strain.trace()) + strain * (2.0 * self.shear)
    }

    /// Change of the stress for the change `rate` of the displacement gradient in the current configuration.
    fn stress_change(&self, point: usize, total: &Matrix3<f64>, rate: &Matrix3<f64>) -> Matrix3<f64> {
        let stretching = 0.5 * (rate + rate.transpose());
        match self.law {
            ElasticLaw::SmallStrain => {
                let change = rate * total;
                self.linear(&(0.5 * (change + change.transpose())))
            }
            ElasticLaw::SaintVenant => {
                // Push-forward of the second Piola stress: its own change, then the change of F and of det F.
                let stress = self.stress_of(point, total);
                let strain_change = total.transpose() * stretching * total;
                let own = total * self.linear(&strain_change) * total.transpose() / total.determinant();
                own + rate * stress + stress * rate.transpose() - stress * rate.trace()
            }
        }
    }

    fn tangent(&self, point: usize, total: &Matrix3<f64>) -> Operator {
        let mut tangent = Operator::zeros();
        for pair in 0..9 {
            tangent.set_column(pair, &column(&self.stress_change(point, total, &unit(pair))));
        }
        tangent
    }

    fn answer(&self, point: usize, total: &Matrix3<f64>, options: &TrialOptions) -> TrialResult {
        let stress = self.stress_of(point, total);
        let tangent =
            (options.tangent != TangentKind::None).then(|| Box::new(wire_operator(&self.tangent(point, total))));
        TrialResult {
            stress: tensor(&stress),
            tangent,
            scalars: Scalars { volume_ratio: total.determinant(), ..Scalars::default() },
            observed: Observed::default(),
            cost: Cost { force_evaluations: 1, ramp_steps: u64::from(options.ramp_steps), ..Cost::default() },
            flags: TrialFlags::default(),
        }
    }
}

impl ClosedForm for ElasticMaterial {
    type State = Matrix3<f64>;

    fn states(&mut self) -> &mut TrialStates<Self::State> {
        &mut self.states
    }

    fn trial(&self, trial: &PointTrial) -> Result<(Matrix3<f64>, TrialResult), RveError> {
        let gradient = matrix(&trial.target);
        let norm = gradient.amax();
        if let Some(limit) = self.largest_target.filter(|limit| norm > *limit) {
            return Err(RveError::TargetTooLarge { norm, limit });
        }
        let step = Matrix3::identity() + gradient;
        if step.determinant() <= 0.0 {
            return Err(RveError::TargetInverted { determinant: step.determinant() });
        }
        let total = step * self.states.committed[trial.point];
        Ok((total, self.answer(trial.point, &total, &trial.options)))
    }

    fn save_states(&self, archive: &mut Archive) {
        let committed: Vec<&[f64]> = self.states.committed.iter().map(Matrix3::as_slice).collect();
        archive.put("elastic", 2, &committed);
    }

    fn restore_states(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let committed: Vec<Vec<f64>> = archive.get("elastic", 2)?;
        if committed.len() != self.states.committed.len() || committed.iter().any(|total| total.len() != 9) {
            return Err(CheckpointError::unfit("elastic", "the number of points or of their components differs"));
        }
        self.states.committed = committed.iter().map(|total| Matrix3::from_column_slice(total)).collect();
        self.states.rollback();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::PointMaterial;

    #[test]
    fn tangent_is_the_derivative_of_the_stress() {
        let start = Matrix3::new(1.1, 0.2, 0.1, -0.1, 0.9, 0.05, 0.03, -0.2, 1.05);
        let initial = [[-0.5, 0.1, 0.2], [0.1, -0.7, 0.0], [0.2, 0.0, -0.3]];
        for law in [ElasticLaw::SmallStrain, ElasticLaw::SaintVenant] {
            let material = ElasticMaterial::spatial(law, 3.0, 1.0, 1).with_initial_stress(initial);
            let tangent = material.tangent(0, &start);
            for pair in 0..9 {
                let stress = |size: f64| material.stress(&((Matrix3::identity() + size * unit(pair)) * start));
                let difference = column(&((stress(1e-6) - stress(-1e-6)) / 2e-6));
                let error = (difference - tangent.column(pair)).amax();
                assert!(error < 1e-8, "{law:?} {pair}: {error:e}");
            }
        }
    }

    #[test]
    fn bulk_moduli_mean_what_they_say() {
        let strain = 1e-3;
        let plane = ElasticMaterial::new(ElasticLaw::SmallStrain, 3.0, 1.0, 1);
        let stress = plane.stress(&Matrix3::from_diagonal(&[1.0 + strain, 1.0 + strain, 1.0].into()));
        assert!((0.5 * (stress[(0, 0)] + stress[(1, 1)]) - 3.0 * 2.0 * strain).abs() < 1e-15);
        let spatial = ElasticMaterial::spatial(ElasticLaw::SmallStrain, 3.0, 1.0, 1);
        let stress = spatial.stress(&(Matrix3::identity() * (1.0 + strain)));
        assert!((stress.trace() / 3.0 - 3.0 * 3.0 * strain).abs() < 1e-15);
    }

    #[test]
    fn trials_leave_the_committed_state_alone() {
        let mut material = ElasticMaterial::new(ElasticLaw::SaintVenant, 3.0, 1.0, 1);
        let target = tensor(&Matrix3::from_diagonal(&[0.01, -0.02, 0.0].into()));
        let trial = PointTrial { point: 0, target, options: TrialOptions::default() };
        let first = material.evaluate(&[trial]).unwrap();
        assert_eq!(material.evaluate(&[trial]).unwrap(), first);
        material.commit().unwrap();
        assert_ne!(material.evaluate(&[trial]).unwrap(), first);
    }
}
