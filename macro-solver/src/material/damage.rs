//! A softening point material that verifies localisation: isotropic elasticity that loses stiffness with the largest strain seen.
//!
//! `sigma = (1 - d) C : e` with the total strain `e`, the sum of the symmetric parts of all committed targets, and
//! `d = 1 - (k0 / k) exp(-(k - k0) / kf)` once the largest equivalent strain `k = max sqrt(e : C : e / M)` has passed the
//! threshold `k0`; `M` is the P-wave modulus, so that in uniaxial strain `k` is that strain. With an infinite threshold it is
//! linear elasticity in rate form, exact to rounding for strains of any size.

use crate::checkpoint::{Archive, CheckpointError};
use crate::formulation::tensor::{Operator, column, isotropic_moduli, matrix, tensor, wire_operator};
use crate::material::PointTrial;
use crate::material::trial_states::{ClosedForm, TrialStates};
use nalgebra::Matrix3;
use protocol::{Cost, Observed, RveError, Scalars, TangentKind, TrialFlags, TrialOptions, TrialResult};

/// Elasticity and softening of one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DamageLaw {
    /// Lamé modulus, Pa.
    pub(crate) lambda: f64,
    /// Shear modulus, Pa.
    pub(crate) shear: f64,
    /// Equivalent strain at which softening begins, `k0`; infinity never softens.
    pub(crate) threshold: f64,
    /// Equivalent strain over which the stress falls by a factor of e, `kf`.
    pub(crate) softening: f64,
}

impl DamageLaw {
    /// Linear elasticity.
    pub(crate) fn elastic(lambda: f64, shear: f64) -> Self {
        Self { lambda, shear, threshold: f64::INFINITY, softening: 1.0 }
    }

    /// Share of the stiffness left after the equivalent strain `largest`.
    pub(crate) fn integrity(&self, largest: f64) -> f64 {
        if largest <= self.threshold {
            return 1.0;
        }
        self.threshold / largest * (-(largest - self.threshold) / self.softening).exp()
    }

    /// Work lost in uniaxial strain up to the equivalent strain `largest`, J/m3.
    pub(crate) fn dissipation(&self, largest: f64) -> f64 {
        if largest <= self.threshold {
            return 0.0;
        }
        let softened = self.threshold * self.softening * (1.0 - (-(largest - self.threshold) / self.softening).exp());
        let given = 0.5 * self.threshold * self.threshold + softened;
        (self.lambda + 2.0 * self.shear) * (given - 0.5 * self.integrity(largest) * largest * largest)
    }

    fn elastic_stress(&self, strain: &Matrix3<f64>) -> Matrix3<f64> {
        Matrix3::identity() * (self.lambda * strain.trace()) + strain * (2.0 * self.shear)
    }

    fn equivalent_strain(&self, strain: &Matrix3<f64>) -> f64 {
        (self.elastic_stress(strain).dot(strain) / (self.lambda + 2.0 * self.shear)).sqrt()
    }
}

/// State of one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State {
    strain: Matrix3<f64>,
    largest: f64,
}

/// The law at every point.
#[derive(Clone, Debug)]
pub(crate) struct DamageMaterial {
    laws: Vec<DamageLaw>,
    states: TrialStates<State>,
    consistent: bool,
}

impl DamageMaterial {
    /// Undeformed points, each with its law.
    pub(crate) fn new(laws: Vec<DamageLaw>) -> Self {
        let start = State { strain: Matrix3::zeros(), largest: 0.0 };
        Self { states: TrialStates::new(vec![start; laws.len()]), laws, consistent: false }
    }

    /// With the derivative of the stress as tangent in place of the secant, softening included, exact in trials of any size.
    pub(crate) fn with_consistent_tangents(self) -> Self {
        Self { consistent: true, ..self }
    }

    /// Share of the stiffness that a point has left.
    pub(crate) fn integrity(&self, point: usize) -> f64 {
        self.laws[point].integrity(self.states.committed[point].largest)
    }

    /// Largest equivalent strain that a point has seen.
    pub(crate) fn largest_strain(&self, point: usize) -> f64 {
        self.states.committed[point].largest
    }
}

fn answer(law: &DamageLaw, strain: &Matrix3<f64>, integrity: f64, options: &TrialOptions) -> TrialResult {
    let moduli = isotropic_moduli(integrity * law.lambda, integrity * law.shear);
    TrialResult {
        stress: tensor(&(law.elastic_stress(strain) * integrity)),
        // The secant: positive, and exact while nothing softens.
        tangent: (options.tangent != TangentKind::None).then(|| Box::new(wire_operator(&moduli))),
        scalars: Scalars { volume_ratio: 1.0 + strain.trace(), ..Scalars::default() },
        observed: Observed::default(),
        cost: Cost { force_evaluations: 1, ramp_steps: u64::from(options.ramp_steps), ..Cost::default() },
        flags: TrialFlags::default(),
    }
}

/// `d sigma / d F` at the end of a trial of the target `gradient` to the total strain `strain`.
fn derivative(
    law: &DamageLaw,
    strain: &Matrix3<f64>,
    largest: f64,
    softens: bool,
    gradient: &Matrix3<f64>,
) -> Operator {
    let integrity = law.integrity(largest);
    let mut change = isotropic_moduli(integrity * law.lambda, integrity * law.shear);
    if softens {
        // g = k0 / k exp(-(k - k0) / kf), dk = C : e : de / (M k).
        let stress = column(&law.elastic_stress(strain));
        let slope = -integrity * (1.0 / largest + 1.0 / law.softening) / ((law.lambda + 2.0 * law.shear) * largest);
        change += slope * stress * stress.transpose();
    }
    // The target changes by dL (I + H).
    let end = Matrix3::identity() + gradient;
    Operator::from_fn(|row, pair| (0..3).map(|r| change[(row, 3 * (pair / 3) + r)] * end[(pair % 3, r)]).sum())
}

impl ClosedForm for DamageMaterial {
    type State = State;

    fn states(&mut self) -> &mut TrialStates<Self::State> {
        &mut self.states
    }

    fn trial(&self, trial: &PointTrial) -> Result<(State, TrialResult), RveError> {
        let (law, committed) = (&self.laws[trial.point], &self.states.committed[trial.point]);
        let gradient = matrix(&trial.target);
        let strain = committed.strain + 0.5 * (gradient + gradient.transpose());
        let largest = committed.largest.max(law.equivalent_strain(&strain));
        let mut answer = answer(law, &strain, law.integrity(largest), &trial.options);
        if self.consistent && answer.tangent.is_some() {
            let softens = largest > committed.largest && largest > law.threshold;
            answer.tangent = Some(Box::new(wire_operator(&derivative(law, &strain, largest, softens, &gradient))));
        }
        Ok((State { strain, largest }, answer))
    }

    fn save_states(&self, archive: &mut Archive) {
        let committed: Vec<(&[f64], f64)> =
            self.states.committed.iter().map(|state| (state.strain.as_slice(), state.largest)).collect();
        archive.put("damage", 1, &committed);
    }

    fn restore_states(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let committed: Vec<(Vec<f64>, f64)> = archive.get("damage", 1)?;
        if committed.len() != self.states.committed.len() || committed.iter().any(|(strain, _)| strain.len() != 9) {
            return Err(CheckpointError::unfit("damage", "the number of points or of their components differs"));
        }
        let state = |(strain, largest): &(Vec<f64>, f64)| State {
            strain: Matrix3::from_column_slice(strain),
            largest: *largest,
        };
        self.states.committed = committed.iter().map(state).collect();
        self.states.rollback();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::PointMaterial;

    /// Uniaxial strain beyond the threshold, back and forth.
    #[test]
    fn softening_follows_the_curve_and_unloading_the_secant() {
        let law = DamageLaw { lambda: 1.0, shear: 2.0, threshold: 0.01, softening: 0.02 };
        let mut material = DamageMaterial::new(vec![law]);
        let mut pull = |by: f64| {
            let target = tensor(&Matrix3::from_diagonal(&[by, 0.0, 0.0].into()));
            let trial = PointTrial { point: 0, target, options: TrialOptions::default() };
            let answer = material.evaluate(&[trial]).unwrap().remove(0);
            material.commit().unwrap();
            answer.stress.get(0, 0)
        };
        assert!((pull(0.01) - 0.05).abs() < 1e-15);
        let softened = 5.0 * 0.01 * (-1.0f64).exp();
        assert!((pull(0.02) - softened).abs() < 1e-15);
        assert!((pull(-0.015) - 0.5 * softened).abs() < 1e-15);
        assert!((pull(0.015) - softened).abs() < 1e-15);
        assert_eq!(DamageLaw::elastic(1.0, 2.0).integrity(1e9), 1.0);
        // Work given up to k by the trapezium rule, less what unloading gives back.
        let cells = 20_000;
        let curve = |strain: f64| 5.0 * law.integrity(strain) * strain;
        let width = 0.03 / f64::from(cells);
        let given: f64 = (0..cells).map(|cell| curve((f64::from(cell) + 0.5) * width) * width).sum();
        assert!((law.dissipation(0.03) - (given - 0.5 * curve(0.03) * 0.03)).abs() < 1e-8 * given);
    }
}
