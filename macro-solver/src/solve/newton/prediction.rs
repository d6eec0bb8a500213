//! First iterate of a step.

use crate::model::failure::Failure;
use crate::problem::Predictor;
use crate::solve::accepted::LastStep;
use crate::solve::driver::Solver;
use crate::solve::vectors::norm;

/// A step repeats no more than this many times the share of the last one that goes with its size: supports that hardly moved in the last
/// step, or loads that hardly changed, predict nothing.
const MOST_REPEATED: f64 = 4.0;

/// Share of a change, by squares, that may be of another kind than the last one: a load that stops while another begins repeats nothing.
const MOST_NEW: f64 = 0.25;

/// Share of the last motion of supports below which they stand still.
const STOPPED: f64 = 1e-9;

/// The correction that the last step left is applied whole up to this share of its displacements, and cut down to it beyond: soft
/// tangents past a peak predict large corrections close to equilibrium.
const LARGEST_CORRECTION: f64 = 0.1;

impl Solver<'_> {
    /// First iterate of a step: prescribed components are exact, free ones extrapolated or from the tangent of the
    /// committed state.
    pub(super) fn predict(&mut self, load: f64) -> Result<Vec<f64>, Failure> {
        let moment = self.moment(load);
        let mut increment = self.given(moment);
        match self.share_to_repeat(load).zip(self.last_step.clone()) {
            Some((share, last)) => {
                if share < 0.0 {
                    self.tangents.turned();
                }
                // What the last step left to correct is due whatever this one does. Under loads alone it is not added: close to what
                // the body bears at most, it leads away from the equilibria that are left.
                let due = if self.supports_moved(&last.increment) { share_of_correction(&last) } else { 0.0 };
                for &dof in self.constraints.free() {
                    let correction = last.correction.get(dof).map_or(0.0, |correction| due * correction);
                    increment[dof] = share * last.increment[dof] + correction;
                }
            }
            None => {
                self.balance.clone_from(&self.committed_balance);
                self.balance.external = self.loads.force(&self.body.positions(&self.body.zero()), moment);
                let mut right = self.balance.residual();
                for (value, pulled) in right.iter_mut().zip(self.balance.stiffness_times(&increment)) {
                    *value = -(*value + pulled);
                }
                if self.tangents.factorizes() {
                    self.factorize().map_err(|error| Failure::Attempt(error.to_string()))?;
                }
                let free = self.solve_linear(&self.constraints.restrict(&right));
                let free = free.map_err(|error| Failure::Attempt(error.to_string()))?;
                for &dof in self.constraints.free() {
                    increment[dof] = free[dof];
                }
            }
        }
        self.constraints.complete(&mut increment, &self.body.displacements, moment);
        Ok(increment)
    }

    /// Whether any support has moved in an increment.
    fn supports_moved(&self, increment: &[f64]) -> bool {
        (0..increment.len()).any(|dof| self.constraints.is_prescribed(dof) && increment[dof] != 0.0)
    }

    /// Share of the last step that the one to `load` repeats; `None` if it repeats none: there is no last step, or supports and links move,
    /// or where none does loads change, at a pace of which the last step tells too little.
    pub(in crate::solve) fn share_to_repeat(&self, load: f64) -> Option<f64> {
        let repeats = self.stage().strategy.predictor == Predictor::Linear;
        let last = self.last_step.as_ref().filter(|_| repeats)?;
        let share_of_load = (load - self.load) / last.size;
        let [before, now, then] = [(self.load - last.size).max(0.0), self.load, load].map(|load| self.moment(load));
        let of_supports = |increment: &[f64]| -> Vec<f64> {
            let moved = |dof: usize| if self.constraints.is_prescribed(dof) { increment[dof] } else { 0.0 };
            (0..increment.len()).map(moved).collect()
        };
        let (mut moved, mut moves) = (of_supports(&last.increment), of_supports(&self.given(then)));
        self.constraints.add_given_motion(&mut moved, before, now);
        self.constraints.add_given_motion(&mut moves, now, then);
        let positions = self.body.positions(&self.body.zero());
        let change = |from, to| self.loads.change(&positions, from, to);
        let pace = match Pace::of(&moved, &moves) {
            Pace::Rest => Pace::of(&change(before, now), &change(now, then)),
            // The last step says nothing of what loads do to a body whose supports have stopped.
            Pace::Share(share) if share.abs() < STOPPED && change(now, then).iter().any(|value| *value != 0.0) => {
                Pace::Begins
            }
            of_supports => of_supports,
        };
        pace.share(share_of_load)
    }
}

/// How a change goes on that the last step has begun.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pace {
    /// Nothing changes and nothing did.
    Rest,
    /// Something begins to change that did not, or less than the rest of it.
    Begins,
    /// By this share of the last change, negative where it turns back.
    Share(f64),
}

impl Pace {
    /// Of the change `next` after the change `last`.
    fn of(last: &[f64], next: &[f64]) -> Self {
        let size: f64 = last.iter().map(|value| value * value).sum();
        if size == 0.0 {
            return if next.iter().any(|value| *value != 0.0) { Self::Begins } else { Self::Rest };
        }
        let share = last.iter().zip(next).map(|(last, next)| next * last).sum::<f64>() / size;
        let left: f64 = last.iter().zip(next).map(|(last, next)| (next - share * last).powi(2)).sum();
        let whole: f64 = next.iter().map(|value| value * value).sum();
        if left > MOST_NEW * whole { Self::Begins } else { Self::Share(share) }
    }

    /// Share of the last step that the next one repeats, whose size over that of the last one is `share_of_load`.
    fn share(self, share_of_load: f64) -> Option<f64> {
        match self {
            Self::Rest => Some(share_of_load),
            // What begins to change is no repetition of a step in which it stood still.
            Self::Begins => None,
            Self::Share(share) => {
                // On a straight path they differ by rounding.
                let share = if (share - share_of_load).abs() < 1e-9 { share_of_load } else { share };
                (share.abs() <= MOST_REPEATED * share_of_load).then_some(share)
            }
        }
    }
}

/// Share of the correction left by a step that the next one begins with.
fn share_of_correction(last: &LastStep) -> f64 {
    let (correction, step) = (norm(&last.correction), norm(&last.increment));
    if correction > LARGEST_CORRECTION * step { LARGEST_CORRECTION * step / correction } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_repeats_what_goes_on_at_about_the_same_pace() {
        let share = |last: &[f64], next: &[f64]| Pace::of(last, next).share(1.5);
        assert_eq!(share(&[0.0, 0.0], &[0.0, 0.0]), Some(1.5));
        assert_eq!(share(&[0.0, 0.0], &[0.0, 1e-6]), None, "it begins");
        assert_eq!(share(&[0.1, -0.2], &[0.15, -0.3]), Some(1.5), "in every bit, whatever rounding does");
        assert_eq!(share(&[0.5, 0.0], &[-0.25, 0.0]), Some(-0.5));
        assert_eq!(share(&[0.5, 0.0], &[0.0, 0.0]), Some(0.0));
        assert_eq!(share(&[0.5, 0.0], &[0.0, 0.5]), None, "one stops as another begins");
        assert_eq!(share(&[0.5, 0.0], &[0.05, 0.5]), None);
        assert_eq!(share(&[1e-3, 0.0], &[1.0, 0.0]), None, "a kink");
    }

    #[test]
    fn what_a_step_left_to_correct_is_carried_over_but_never_more_than_a_tenth_of_it() {
        let last = |correction: Vec<f64>| LastStep { increment: vec![3e-4, 4e-4], size: 0.1, correction };
        assert_eq!(share_of_correction(&last(vec![0.0, 4e-5])), 1.0);
        assert!((share_of_correction(&last(vec![0.0, 2e-4])) - 0.25).abs() < 1e-12);
        assert_eq!(share_of_correction(&last(vec![0.0, 0.0])), 1.0, "in balance");
        assert_eq!(share_of_correction(&last(Vec::new())), 1.0, "a procedure that knows no correction");
    }
}
