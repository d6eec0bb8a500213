//! The check of the stress that the points start with, before any load step.

use super::driver::Solver;
use super::newton::ResidualNorms;
use crate::problem::{ForceMeasure, InitialLimits};
use thiserror::Error;

/// A limit of the problem that the initial stress exceeds.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub(super) enum InitialStateDefect {
    /// Another stress than expected.
    #[error(
        "the points start with a stress that differs by {deviation:.2e} of the largest expected component from what \
         initial_stress expects; take packings prepared at the stress of their place, or allow more"
    )]
    Deviation {
        /// Largest deviation over the largest component expected.
        deviation: f64,
    },
    /// Out of balance.
    #[error(
        "the initial stress is out of balance by {imbalance:.2e} of the loads and reactions; let the loads of the first \
         step be those that the packings were prepared under, or allow more and let step 0 equilibrate it"
    )]
    Imbalance {
        /// Out-of-balance force over loads and reactions.
        imbalance: f64,
    },
}

impl Solver<'_> {
    /// Records how far the initial stress is from balance and from what is expected.
    ///
    /// # Errors
    /// A limit of the problem is exceeded.
    pub(super) fn check_initial_state(&mut self, start: &ResidualNorms) -> Result<(), InitialStateDefect> {
        self.statistics.initial_imbalance = start.ratio(ForceMeasure::Largest);
        self.statistics.initial_deviation = self.initial_deviation();
        let InitialLimits { largest_deviation, largest_imbalance } = self.problem.initial.limits;
        let (imbalance, deviation) = (self.statistics.initial_imbalance, self.statistics.initial_deviation);
        if largest_deviation.is_some_and(|limit| deviation > limit) {
            return Err(InitialStateDefect::Deviation { deviation });
        }
        if largest_imbalance.is_some_and(|limit| imbalance > limit) {
            return Err(InitialStateDefect::Imbalance { imbalance });
        }
        Ok(())
    }

    /// Largest deviation of the initial stress from what is expected, over the largest component expected; 0 if nothing is.
    fn initial_deviation(&self) -> f64 {
        let Some(expected) = &self.problem.initial.expected else { return 0.0 };
        let axes = self.body.mesh().dimension.count();
        let (mut deviation, mut largest) = (0.0f64, 0.0f64);
        for (number, point) in self.points.all().iter().enumerate() {
            let wanted = expected.at(number, self.body.place(number, &self.body.mesh().nodes));
            let stress = &point.response.stress;
            // Cells of spheres have a stress across a plane mesh too; those of discs have none.
            let across = (axes < 3 && stress[(2, 2)] != 0.0 && wanted[(2, 2)] != 0.0).then_some((2, 2));
            for place in (0..axes).flat_map(|i| (0..axes).map(move |j| (i, j))).chain(across) {
                largest = largest.max(wanted[place].abs());
                deviation = deviation.max((stress[place] - wanted[place]).abs());
            }
        }
        if deviation == 0.0 { 0.0 } else { deviation / largest }
    }
}
