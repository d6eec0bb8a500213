//! Committed and trial states of the points of a closed-form material: the part of [`PointMaterial`] that does not depend on its law.

use super::{MaterialError, PointId, PointMaterial, PointTrial};
use crate::checkpoint::{Archive, CheckpointError};
use protocol::{RveError, TrialResult};

/// States of all points.
#[derive(Clone, Debug)]
pub(super) struct TrialStates<S> {
    /// Committed state of every point.
    pub(super) committed: Vec<S>,
    marked: Vec<S>,
    /// Latest trial of every point since the last commit.
    trials: Vec<Option<S>>,
}

impl<S: Clone> TrialStates<S> {
    /// Points in these states, without trials.
    pub(super) fn new(committed: Vec<S>) -> Self {
        Self { trials: vec![None; committed.len()], marked: Vec::new(), committed }
    }

    /// Keeps the states that trials have ended in and hands on the answers.
    pub(super) fn keep(&mut self, trials: &[PointTrial], answers: Vec<(S, TrialResult)>) -> Vec<TrialResult> {
        let kept = trials.iter().zip(answers).map(|(trial, (state, answer))| {
            self.trials[trial.point] = Some(state);
            answer
        });
        kept.collect()
    }

    /// Makes the latest trial of every point its committed state.
    pub(super) fn commit(&mut self) {
        for (committed, trial) in self.committed.iter_mut().zip(&mut self.trials) {
            if let Some(state) = trial.take() {
                *committed = state;
            }
        }
    }

    /// Forgets all trials.
    pub(super) fn rollback(&mut self) {
        self.trials.fill(None);
    }

    /// Remembers the committed states.
    pub(super) fn mark(&mut self) {
        self.marked.clone_from(&self.committed);
    }

    /// Makes the remembered states the committed ones again and forgets all trials.
    pub(super) fn return_to_mark(&mut self) {
        self.committed.clone_from(&self.marked);
        self.rollback();
    }

    /// Gives a point the committed state of another one.
    pub(super) fn copy(&mut self, from: PointId, to: PointId) {
        self.committed[to] = self.committed[from].clone();
        self.trials[to] = None;
    }
}

/// A closed-form law at every point; it makes a [`PointMaterial`].
pub(super) trait ClosedForm {
    /// State of a point.
    type State: Clone;

    /// States of all points.
    fn states(&mut self) -> &mut TrialStates<Self::State>;

    /// State and answer after a trial, whose target is finite.
    ///
    /// # Errors
    /// A target that the law refuses.
    fn trial(&self, trial: &PointTrial) -> Result<(Self::State, TrialResult), RveError>;

    /// See [`PointMaterial::save`].
    fn save_states(&self, _archive: &mut Archive) {}

    /// See [`PointMaterial::restore`].
    ///
    /// # Errors
    /// A section that is missing or does not fit.
    fn restore_states(&mut self, _archive: &Archive) -> Result<(), CheckpointError> {
        Ok(())
    }
}

impl<L: ClosedForm> PointMaterial for L {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        let answer = |trial: &PointTrial| {
            let answer = if trial.target.is_finite() { self.trial(trial) } else { Err(RveError::TargetNotFinite) };
            answer.map_err(|reason| MaterialError::Point { point: trial.point, reason })
        };
        let answers = trials.iter().map(answer).collect::<Result<Vec<_>, _>>()?;
        Ok(self.states().keep(trials, answers))
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.states().commit();
        Ok(())
    }

    fn rollback(&mut self) {
        self.states().rollback();
    }

    fn mark(&mut self) {
        self.states().mark();
    }

    fn return_to_mark(&mut self) {
        self.states().return_to_mark();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.states().copy(from, to);
    }

    fn save(&self, archive: &mut Archive) {
        self.save_states(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.restore_states(archive)
    }
}
