//! First iterate of a step.

use crate::model::failure::Failure;
use crate::problem::Predictor;
use crate::solve::accepted::LastStep;
use crate::solve::driver::Solver;
use crate::solve::linear_solver::norm;

/// A step repeats no more than so many times the share of the last one that goes with its size: supports that hardly moved in the last
/// step predict nothing.
const MOST_REPEATED: f64 = 4.0;

/// The correction that the last step left is applied whole up to this share of its displacements, and cut down to it beyond: soft
/// tangents past a peak predict large corrections close to equilibrium.
const LARGEST_CORRECTION: f64 = 0.1;

impl Solver<'_> {
    /// First iterate of a step: prescribed components are exact, free ones extrapolated or from the tangent of the
    /// committed state.
    pub(super) fn predict(&mut self, load: f64) -> Result<Vec<f64>, Failure> {
        let moment = self.moment(load);
        let mut increment = self.given(moment);
        let linear = self.stage().strategy.predictor == Predictor::Linear;
        let repeated = self.last_step.as_ref().filter(|_| linear).and_then(|last| {
            let share = self.share_of_last_step(&increment, &last.increment, (load - self.load) / last.size)?;
            Some((share, last.clone()))
        });
        match repeated {
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

    /// Share of the last step that the coming one repeats: that of the motion of the supports, negative where they turn back, and
    /// `share_of_load` where none has moved. `None` if they have moved too little to tell.
    fn share_of_last_step(&self, given: &[f64], last: &[f64], share_of_load: f64) -> Option<f64> {
        let supports = || (0..last.len()).filter(|&dof| self.constraints.is_prescribed(dof));
        let moved: f64 = supports().map(|dof| last[dof] * last[dof]).sum();
        if moved == 0.0 {
            // Supports that begin to move are no repetition of a step in which they stood still.
            return (!self.supports_moved(given)).then_some(share_of_load);
        }
        let share = supports().map(|dof| given[dof] * last[dof]).sum::<f64>() / moved;
        // On a straight path they differ by rounding.
        let share = if (share - share_of_load).abs() < 1e-9 { share_of_load } else { share };
        (share.abs() <= MOST_REPEATED * share_of_load).then_some(share)
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
    fn what_a_step_left_to_correct_is_carried_over_but_never_more_than_a_tenth_of_it() {
        let last = |correction: Vec<f64>| LastStep { increment: vec![3e-4, 4e-4], size: 0.1, correction };
        assert_eq!(share_of_correction(&last(vec![0.0, 4e-5])), 1.0);
        assert!((share_of_correction(&last(vec![0.0, 2e-4])) - 0.25).abs() < 1e-12);
        assert_eq!(share_of_correction(&last(vec![0.0, 0.0])), 1.0, "in balance");
        assert_eq!(share_of_correction(&last(Vec::new())), 1.0, "a procedure that knows no correction");
    }
}
