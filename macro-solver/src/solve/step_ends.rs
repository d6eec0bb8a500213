//! Where load steps end: on the grid of equal steps, at the turns of histories that lie on it, and at the end of the path.

use crate::problem::Stage;

/// Distance from the grid of equal steps, in steps, up to which a turn lies on it.
const ON_GRID: f64 = 1e-6;

/// Where the load steps of a stage end.
pub(super) struct StepEnds {
    increments: usize,
    min: f64,
    /// Shares of the path at which histories turn and at which an undisturbed run ends a step: steps that have been cut back must not jump over
    /// them. In ascending order.
    turns: Vec<f64>,
}

impl StepEnds {
    pub(super) fn of(stage: &Stage) -> Self {
        let increments = stage.control.increments;
        let mut turns = Vec::new();
        // Where the load factor is an unknown, histories turn at no share of the path.
        if !stage.finds_load_factor() {
            let changing = stage.conditions.iter().filter(|applied| applied.changes());
            let steps = changing
                .flat_map(|applied| applied.history.turns(stage.duration, increments))
                .map(|turn| turn * increments as f64);
            turns.extend(
                steps
                    .filter(|step| (step - step.round()).abs() < ON_GRID)
                    .map(|step| step.round() / increments as f64),
            );
            turns.sort_unstable_by(f64::total_cmp);
            turns.dedup();
        }
        Self { increments, min: stage.control.min, turns }
    }

    /// Share of the path that a step of `size` aims at. Snaps to the grid of equal steps, so that an undisturbed run meets
    /// exactly the same loads whatever rounding does, and ends at the next turn or at 1 without a sliver.
    pub(super) fn next(&self, done: f64, size: f64) -> f64 {
        let next = done + size;
        let end = self.turns.iter().copied().find(|turn| *turn > done + 1e-9).unwrap_or(1.0);
        if end - next < 0.5 * self.min {
            return end;
        }
        let on_grid = (next * self.increments as f64).round() / self.increments as f64;
        if (on_grid - next).abs() < 1e-9 { on_grid } else { next }
    }
}

/// Whether a step is as small as steps may be. Sizes are differences of shares of the path, which round.
pub(super) fn is_smallest(size: f64, min: f64) -> bool {
    size <= (1.0 + 1e-9) * min
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Amplitude, Applied, Axis, Condition};

    fn ends(increments: usize, table: &[[f64; 2]]) -> StepEnds {
        let moved = Applied::new(Condition::fixed("top", Axis::Y), Amplitude::Table(table.to_vec()));
        let mut stage = Stage::new("push", vec![moved]);
        (stage.control.increments, stage.control.min) = (increments, 1e-2);
        if let Condition::Displacement { value, .. } = &mut stage.conditions[0].condition {
            *value = -1e-3;
        }
        StepEnds::of(&stage)
    }

    #[test]
    fn steps_that_were_cut_back_end_at_the_turns_that_undisturbed_ones_meet() {
        let ends = ends(10, &[[0.0, 0.0], [0.3, 1.0], [0.55, 0.2], [1.0, 1.0]]);
        let path = |first: f64, size: f64| {
            let mut met = vec![first];
            while *met.last().unwrap() < 1.0 {
                met.push(ends.next(*met.last().unwrap(), size));
            }
            met
        };
        assert_eq!(
            path(0.0, 0.1),
            [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0],
            "0.55 lies between two steps"
        );
        let after = path(0.225, 0.1);
        assert_eq!(after[..2], [0.225, 0.3]);
        assert!((after[2] - 0.4).abs() < 1e-12);
        assert_eq!(ends.next(0.2, 0.096), 0.3, "no sliver is left");
    }
}
