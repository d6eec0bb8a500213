//! A closed-form elastic material that verifies elements and solver without any grains.
//!
//! It keeps the contract of a granular point: a trial starts from the committed state, `H` is relative to it, and
//! the tangent is `d sigma_ij / d F_kl` relative to the end of the trial. The state is the total deformation gradient.

use crate::checkpoint::{Archive, CheckpointError};
use crate::material::{MaterialError, PointMaterial, PointTrial};
use nalgebra::{Matrix2, Matrix4};
use protocol::{Ask, Cost, Observed, RveError, Scalars, TangentKind, Tensor2, Tensor4, TrialAnswer, TrialFlags};

/// Law between total deformation gradient `F` and Cauchy stress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElasticLaw {
    /// `sigma = lambda tr(e) I + 2 G e` with `e = sym(F - I)`. Not objective: for comparison with linear theory.
    SmallStrain,
    /// Saint Venant-Kirchhoff, `S = S0 + lambda tr(E) I + 2 G E`, `sigma = F S F^T / det F`. Objective.
    SaintVenant,
}

/// Plane isotropic elasticity at every point.
#[derive(Clone, Debug)]
pub struct ElasticMaterial {
    law: ElasticLaw,
    lambda: f64,
    shear: f64,
    initial_stress: Matrix2<f64>,
    largest_target: Option<f64>,
    committed: Vec<Matrix2<f64>>,
    trials: Vec<Option<Matrix2<f64>>>,
}

impl ElasticMaterial {
    /// `points` undeformed points with the two-dimensional bulk modulus `bulk` (mean stress of `xx` and `yy` over
    /// areal strain) and shear modulus `shear`, Pa.
    pub fn new(law: ElasticLaw, bulk: f64, shear: f64, points: usize) -> Self {
        Self {
            law,
            lambda: bulk - shear,
            shear,
            initial_stress: Matrix2::zeros(),
            largest_target: None,
            committed: vec![Matrix2::identity(); points],
            trials: vec![None; points],
        }
    }

    /// Starts with a stress, Pa, tension positive.
    #[must_use]
    pub fn with_initial_stress(mut self, stress: [[f64; 2]; 2]) -> Self {
        self.initial_stress = Matrix2::from_fn(|i, j| stress[i][j]);
        self
    }

    /// Refuses targets whose largest `|H_ij|` exceeds `limit`, as an engine does that has lost the grains.
    #[must_use]
    pub fn with_largest_target(mut self, limit: f64) -> Self {
        self.largest_target = Some(limit);
        self
    }

    /// Cauchy stress at total deformation gradient `total`, Pa.
    pub fn stress(&self, total: &Matrix2<f64>) -> Matrix2<f64> {
        match self.law {
            ElasticLaw::SmallStrain => {
                let gradient = total - Matrix2::identity();
                self.initial_stress + self.linear(&(0.5 * (gradient + gradient.transpose())))
            }
            ElasticLaw::SaintVenant => {
                let strain = 0.5 * (total.transpose() * total - Matrix2::identity());
                let second_piola = self.initial_stress + self.linear(&strain);
                total * second_piola * total.transpose() / total.determinant()
            }
        }
    }

    fn linear(&self, strain: &Matrix2<f64>) -> Matrix2<f64> {
        Matrix2::identity() * (self.lambda * strain.trace()) + strain * (2.0 * self.shear)
    }

    /// Change of the stress for the change `rate` of the displacement gradient in the current configuration.
    fn stress_change(&self, total: &Matrix2<f64>, rate: &Matrix2<f64>) -> Matrix2<f64> {
        let stretching = 0.5 * (rate + rate.transpose());
        match self.law {
            ElasticLaw::SmallStrain => {
                let change = rate * total;
                self.linear(&(0.5 * (change + change.transpose())))
            }
            ElasticLaw::SaintVenant => {
                // Push-forward of the second Piola stress: its own change, then the change of F and of det F.
                let stress = self.stress(total);
                let strain_change = total.transpose() * stretching * total;
                let own = total * self.linear(&strain_change) * total.transpose() / total.determinant();
                own + rate * stress + stress * rate.transpose() - stress * rate.trace()
            }
        }
    }

    fn tangent(&self, total: &Matrix2<f64>) -> Matrix4<f64> {
        let mut tangent = Matrix4::zeros();
        for column in 0..4 {
            let mut rate = Matrix2::zeros();
            rate[(column / 2, column % 2)] = 1.0;
            let change = self.stress_change(total, &rate);
            for row in 0..4 {
                tangent[(row, column)] = change[(row / 2, row % 2)];
            }
        }
        tangent
    }

    fn trial(&self, trial: &PointTrial) -> Result<(Matrix2<f64>, TrialAnswer), RveError> {
        if !trial.target.is_finite() {
            return Err(RveError::TargetNotFinite);
        }
        let plane = trial.target.plane();
        let gradient = Matrix2::from_fn(|i, j| plane[i][j]);
        let norm = gradient.amax();
        if let Some(limit) = self.largest_target.filter(|limit| norm > *limit) {
            return Err(RveError::TargetTooLarge { norm, limit });
        }
        let step = Matrix2::identity() + gradient;
        if step.determinant() <= 0.0 {
            return Err(RveError::TargetInverted { determinant: step.determinant() });
        }
        let total = step * self.committed[trial.point];
        Ok((total, self.answer(&total, &trial.ask)))
    }

    fn answer(&self, total: &Matrix2<f64>, ask: &Ask) -> TrialAnswer {
        let stress = self.stress(total);
        let tangent = (ask.tangent != TangentKind::None).then(|| {
            let tangent = self.tangent(total);
            let rows: [[f64; 4]; 4] = std::array::from_fn(|row| std::array::from_fn(|column| tangent[(row, column)]));
            Box::new(Tensor4::from_plane(rows))
        });
        TrialAnswer {
            stress: Tensor2::from_plane([[stress[(0, 0)], stress[(0, 1)]], [stress[(1, 0)], stress[(1, 1)]]]),
            tangent,
            scalars: Scalars { volume_ratio: total.determinant(), ..Scalars::default() },
            observed: Observed::default(),
            cost: Cost { force_evaluations: 1, ramp_steps: u64::from(ask.ramp_steps), ..Cost::default() },
            flags: TrialFlags::default(),
        }
    }
}

impl PointMaterial for ElasticMaterial {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialAnswer>, MaterialError> {
        let mut answers = Vec::with_capacity(trials.len());
        for trial in trials {
            let (total, answer) =
                self.trial(trial).map_err(|reason| MaterialError::Point { point: trial.point, reason })?;
            self.trials[trial.point] = Some(total);
            answers.push(answer);
        }
        Ok(answers)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        for (committed, trial) in self.committed.iter_mut().zip(&mut self.trials) {
            if let Some(total) = trial.take() {
                *committed = total;
            }
        }
        Ok(())
    }

    fn rollback(&mut self) {
        self.trials.fill(None);
    }

    fn save(&self, archive: &mut Archive) {
        let committed: Vec<&[f64]> = self.committed.iter().map(Matrix2::as_slice).collect();
        archive.put("elastic", 1, &committed);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let committed: Vec<Vec<f64>> = archive.get("elastic", 1)?;
        if committed.len() != self.committed.len() || committed.iter().any(|total| total.len() != 4) {
            return Err(CheckpointError::unfit("elastic", "the number of points or of their components differs"));
        }
        self.committed = committed.iter().map(|total| Matrix2::from_column_slice(total)).collect();
        self.trials.fill(None);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangent_is_the_derivative_of_the_stress() {
        let start = Matrix2::new(1.1, 0.2, -0.1, 0.9);
        for law in [ElasticLaw::SmallStrain, ElasticLaw::SaintVenant] {
            let material = ElasticMaterial::new(law, 3.0, 1.0, 1).with_initial_stress([[-0.5, 0.1], [0.1, -0.7]]);
            let tangent = material.tangent(&start);
            for column in 0..4 {
                let stress = |size: f64| {
                    let mut step = Matrix2::<f64>::identity();
                    step[(column / 2, column % 2)] += size;
                    material.stress(&(step * start))
                };
                let difference = (stress(1e-6) - stress(-1e-6)) / 2e-6;
                for row in 0..4 {
                    let error = difference[(row / 2, row % 2)] - tangent[(row, column)];
                    assert!(error.abs() < 1e-8, "{law:?} {row} {column}: {error:e}");
                }
            }
        }
    }

    #[test]
    fn trials_leave_the_committed_state_alone() {
        let mut material = ElasticMaterial::new(ElasticLaw::SaintVenant, 3.0, 1.0, 1);
        let target = Tensor2::from_plane([[0.01, 0.0], [0.0, -0.02]]);
        let trial = PointTrial { point: 0, target, ask: Ask::default() };
        let first = material.evaluate(&[trial]).unwrap();
        assert_eq!(material.evaluate(&[trial]).unwrap(), first);
        material.commit().unwrap();
        assert_ne!(material.evaluate(&[trial]).unwrap(), first);
    }
}
