//! Committed and trial states of the points of a closed-form material: the part of [`PointMaterial`](super::PointMaterial) that does not depend on
//! its law.

use super::{MaterialError, PointTrial};
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
}

/// States and answers of all trials by the law of their points.
///
/// # Errors
/// The first trial that the law refuses.
pub(super) fn answers<S>(
    trials: &[PointTrial],
    law: impl Fn(&PointTrial) -> Result<(S, TrialResult), RveError>,
) -> Result<Vec<(S, TrialResult)>, MaterialError> {
    let answer =
        |trial: &PointTrial| law(trial).map_err(|reason| MaterialError::Point { point: trial.point, reason });
    trials.iter().map(answer).collect()
}
