//! Friction between the grains that changes over a stage.

use crate::model::body::Body;
use crate::problem::{Amplitude, Applied, Condition, Moment, Problem, ProblemError, Stage};

/// The changes of friction of a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct Frictions {
    /// Number of Gauss points.
    points: usize,
    changes: Vec<Change>,
}

/// One change, of the points of an element set.
#[derive(Clone, Debug)]
struct Change {
    points: Vec<usize>,
    from: f64,
    to: f64,
    history: Amplitude,
}

impl Frictions {
    /// Those of a stage.
    ///
    /// # Errors
    /// An element set that does not exist.
    pub(crate) fn new(problem: &Problem, stage: &Stage, body: &Body) -> Result<Self, ProblemError> {
        let mut changes = Vec::new();
        for Applied { condition, history, .. } in &stage.conditions {
            if let Condition::Friction { elements, from, to } = condition {
                let elements = problem.elements(elements)?;
                let points = elements.iter().flat_map(|&element| body.points_of(element)).collect();
                changes.push(Change { points, from: *from, to: *to, history: history.clone() });
            }
        }
        Ok(Self { points: problem.point_count(), changes })
    }

    /// Share by which the friction of each point is below that of its definition at a moment of the stage; empty where no friction changes.
    pub(crate) fn reductions(&self, moment: Moment) -> Vec<f64> {
        if self.changes.is_empty() {
            return Vec::new();
        }
        let mut reductions = vec![0.0; self.points];
        for change in &self.changes {
            let factor = change.from + (change.to - change.from) * change.history.factor(moment);
            // The last step of a motion may end a rounding behind its stage.
            let reduction = 1.0 - factor.clamp(0.0, 1.0);
            change.points.iter().for_each(|&point| reductions[point] = reduction);
        }
        reductions
    }
}
