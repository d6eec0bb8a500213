//! For tests: materials whose answers are those of another one, altered.

use super::{MaterialError, PointId, PointMaterial, PointTrial};
use crate::checkpoint::{Archive, CheckpointError};
use protocol::{RveError, TrialResult};

/// What is done to the answers of a material.
pub(crate) trait Alteration {
    /// Answers with the help of the material.
    ///
    /// # Errors
    /// Those of the material, and whatever the alteration adds.
    fn answer(
        &mut self,
        material: &mut dyn PointMaterial,
        trials: &[PointTrial],
    ) -> Result<Vec<TrialResult>, MaterialError>;
}

/// A material with altered answers; its states are those of the material.
pub(crate) struct Altered<M, A> {
    pub(crate) material: M,
    pub(crate) alteration: A,
}

impl<M: PointMaterial, A: Alteration> PointMaterial for Altered<M, A> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        self.alteration.answer(&mut self.material, trials)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.material.commit()
    }

    fn rollback(&mut self) {
        self.material.rollback();
    }

    fn mark(&mut self) {
        self.material.mark();
    }

    fn return_to_mark(&mut self) {
        self.material.return_to_mark();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.material.copy_state(from, to);
    }

    fn save(&self, archive: &mut Archive) {
        self.material.save(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.material.restore(archive)
    }
}

/// Changes the answers of the material one by one.
pub(crate) trait EachAnswer {
    /// Changes the answer to a trial.
    fn change(&mut self, trial: &PointTrial, answer: &mut TrialResult);
}

impl<A: EachAnswer> Alteration for A {
    fn answer(
        &mut self,
        material: &mut dyn PointMaterial,
        trials: &[PointTrial],
    ) -> Result<Vec<TrialResult>, MaterialError> {
        let mut answers = material.evaluate(trials)?;
        trials.iter().zip(&mut answers).for_each(|(trial, answer)| self.change(trial, answer));
        Ok(answers)
    }
}

/// Refuses targets with a component beyond a limit, and counts how often.
pub(crate) struct Timid {
    pub(crate) limit: f64,
    pub(crate) refused: u64,
}

impl Timid {
    pub(crate) fn new(limit: f64) -> Self {
        Self { limit, refused: 0 }
    }
}

impl Alteration for Timid {
    fn answer(
        &mut self,
        material: &mut dyn PointMaterial,
        trials: &[PointTrial],
    ) -> Result<Vec<TrialResult>, MaterialError> {
        let size = |trial: &PointTrial| trial.target.0.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let Some(trial) = trials.iter().find(|trial| size(trial) > self.limit) else {
            return material.evaluate(trials);
        };
        self.refused += 1;
        let reason = RveError::TargetTooLarge { norm: size(trial), limit: self.limit };
        Err(MaterialError::Point { point: trial.point, reason })
    }
}
