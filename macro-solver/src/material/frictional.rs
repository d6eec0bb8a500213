//! Elastic points whose stress ratio is limited by friction, for the stress that a body has before its grains exist.

use crate::formulation::tensor::{Operator, column, isotropic_moduli, matrix, tensor, unit, wire_operator};
use crate::material::PointTrial;
use crate::material::trial_states::{ClosedForm, TrialStates};
use nalgebra::{DMatrix, Matrix3};
use protocol::{Cost, Observed, RveError, Scalars, TangentKind, TrialFlags, TrialResult};

/// Modulus over the loads per area: so stiff that they move no node by more than some 1e-6 of the body. The stress of a body between
/// supports that do not move does not depend on it.
const MODULUS_OVER_LOAD: f64 = 1e7;

/// Change of the elastic stress by which the return to the cone is differentiated, over that stress.
const PERTURBATION: f64 = 1e-6;

/// Share of the elastic operator in that of points that yield: points at the tip of the cone have no other stiffness.
const ELASTIC_SHARE: f64 = 1e-4;

/// Isotropic linear elasticity of small strains, whose deviator is scaled back where the principal stresses leave the cone
/// `s_max - s_min = - sin(phi) (s_max + s_min)` of Mohr and Coulomb without cohesion; the mean stress stays as it is, and is cut to zero where
/// it would be a tension.
#[derive(Clone, Debug)]
pub struct FrictionalMaterial {
    dimension: usize,
    sine: f64,
    lambda: f64,
    shear: f64,
    elastic: Operator,
    /// Cauchy stress of every point, Pa, tension positive.
    states: TrialStates<Matrix3<f64>>,
}

impl FrictionalMaterial {
    /// `points` points without stress. `rest_coefficient` is K0, horizontal over vertical stress of level ground, at least 0 and below 1;
    /// `friction_angle` in radians; `load` is the size of the loads per area of the body, Pa; `dimension` 2 (plane strain) or 3.
    pub fn new(dimension: usize, rest_coefficient: f64, friction_angle: f64, load: f64, points: usize) -> Self {
        // Without loads there is no stress, whatever the modulus.
        let load = if load > 0.0 { load } else { 1.0 };
        // A power of two: loads that differ by one have stresses of the same digits.
        let shear = 0.5 * (MODULUS_OVER_LOAD * load).log2().round().exp2();
        // K0 = lambda / (lambda + 2 G) in strain along one axis.
        let lambda = 2.0 * shear * rest_coefficient / (1.0 - rest_coefficient);
        Self {
            dimension,
            sine: friction_angle.sin(),
            lambda,
            shear,
            elastic: isotropic_moduli(lambda, shear),
            states: TrialStates::new(vec![Matrix3::zeros(); points]),
        }
    }

    /// Cauchy stress of every point, Pa, by rows, tension positive.
    pub fn stresses(&self) -> Vec<[[f64; 3]; 3]> {
        let rows = |stress: &Matrix3<f64>| std::array::from_fn(|i| std::array::from_fn(|j| stress[(i, j)]));
        self.states.committed.iter().map(rows).collect()
    }

    /// The stress within the cone that has the same mean.
    fn returned(&self, stress: &Matrix3<f64>) -> Matrix3<f64> {
        let axes = self.dimension;
        let block = DMatrix::from_fn(axes, axes, |i, j| stress[(i, j)]);
        let mean = block.trace() / axes as f64;
        if mean >= 0.0 {
            return Matrix3::zeros();
        }
        let values = block.symmetric_eigenvalues();
        let (above, below) = (values.max() - mean, values.min() - mean);
        let resistance = above - below + self.sine * (above + below);
        let share = if resistance > 0.0 { (-2.0 * mean * self.sine / resistance).min(1.0) } else { 1.0 };
        let mut returned = *stress;
        for i in 0..axes {
            for j in 0..axes {
                let mean = if i == j { mean } else { 0.0 };
                returned[(i, j)] = mean + share * (stress[(i, j)] - mean);
            }
        }
        returned
    }

    /// Change of the returned stress with the strain, the consistent operator: the change of the return by central differences. The return
    /// has a kink at the cone only.
    fn operator(&self, elastic_stress: &Matrix3<f64>) -> Operator {
        let step = PERTURBATION * elastic_stress.amax();
        if step == 0.0 || self.returned(elastic_stress) == *elastic_stress {
            return self.elastic;
        }
        let mut change = Operator::zeros();
        for pair in 0..9 {
            let direction = 0.5 * (unit(pair) + unit(pair).transpose());
            let ahead = self.returned(&(elastic_stress + direction * step));
            let behind = self.returned(&(elastic_stress - direction * step));
            change.set_column(pair, &column(&((ahead - behind) / (2.0 * step))));
        }
        change * self.elastic * (1.0 - ELASTIC_SHARE) + self.elastic * ELASTIC_SHARE
    }
}

impl ClosedForm for FrictionalMaterial {
    type State = Matrix3<f64>;

    fn states(&mut self) -> &mut TrialStates<Self::State> {
        &mut self.states
    }

    fn trial(&self, trial: &PointTrial) -> Result<(Matrix3<f64>, TrialResult), RveError> {
        let gradient = matrix(&trial.target);
        let strain = 0.5 * (gradient + gradient.transpose());
        let change = Matrix3::identity() * (self.lambda * strain.trace()) + strain * (2.0 * self.shear);
        let elastic = self.states.committed[trial.point] + change;
        let stress = self.returned(&elastic);
        let has_tangent = trial.options.tangent != TangentKind::None;
        let answer = TrialResult {
            stress: tensor(&stress),
            tangent: has_tangent.then(|| Box::new(wire_operator(&self.operator(&elastic)))),
            scalars: Scalars { volume_ratio: 1.0, ..Scalars::default() },
            observed: Observed::default(),
            cost: Cost { force_evaluations: 1, ..Cost::default() },
            flags: TrialFlags::default(),
        };
        Ok((stress, answer))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(stress: &Matrix3<f64>, axes: usize) -> f64 {
        let values = DMatrix::from_fn(axes, axes, |i, j| stress[(i, j)]).symmetric_eigenvalues();
        (values.max() - values.min()) / -(values.max() + values.min())
    }

    #[test]
    fn stresses_within_the_cone_stay_and_others_come_to_it_with_their_mean() {
        for axes in [2, 3] {
            let material = FrictionalMaterial::new(axes, 0.5, 30f64.to_radians(), 1e5, 1);
            let inside = Matrix3::new(-3.0, 0.3, 0.0, 0.3, -4.0, 0.0, 0.0, 0.0, -3.5);
            assert!((material.returned(&inside) - inside).amax() < 1e-14);
            let outside = Matrix3::new(-1.0, 2.0, 0.0, 2.0, -4.0, 0.0, 0.0, 0.0, -2.0);
            let returned = material.returned(&outside);
            assert!((ratio(&returned, axes) - 0.5).abs() < 1e-12, "{}", ratio(&returned, axes));
            let trace = |stress: &Matrix3<f64>| (0..axes).map(|axis| stress[(axis, axis)]).sum::<f64>();
            assert!((trace(&returned) - trace(&outside)).abs() < 1e-12);
            assert_eq!(material.returned(&-outside), Matrix3::zeros());
        }
    }
}
