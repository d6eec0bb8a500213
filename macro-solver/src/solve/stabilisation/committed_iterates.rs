//! Committed iterates: where iterations from the last accepted state do not contract, a step goes on from the last of them.
//!
//! Every iterate of an attempt takes the cells from the last accepted state to another target. Where cells snap, almost equal targets
//! end on different branches, and the out-of-balance force then jumps about at a few per cent, however good the tangent is. A correction
//! that begins where the last iterate ended is a small increment of its own, and its answer is close to that iterate. So the iterate
//! is committed, though it is not in balance, and what is left of the out-of-balance force is corrected from there: path-dependent
//! iteration, as a servo-controlled test follows its path. The cells take another way to the accepted state, not straight but by way of the iterates.
//!
//! Corrections are increments of a [stabilised path](super::path) without viscosity. Where they do not lower the out-of-balance force,
//! viscosity is added as in every other such path, and the step counts as stabilised.

use crate::model::failure::failure;
use crate::observer::Outcome;
use crate::solve::accepted::{Counters, Followed, Unfinished};
use crate::solve::driver::{Session, Solver};
use crate::solve::stabilisation::limits::FEW_WITHOUT_GAIN;

impl Solver<'_> {
    /// Takes a step on to the share `target` of the path from an iterate, which the material has evaluated last; `before` are the
    /// counters of the step.
    pub(in crate::solve) fn continue_from_iterate(
        &mut self,
        unfinished: &Unfinished,
        target: f64,
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<Followed, Outcome> {
        let settings = self.stage().control.stabilisation.unwrap_or_default();
        let state = self.state_before(session);
        let Unfinished { increment, iterations, force_ratio } = unfinished;
        let reason = format!("{iterations} iterations did not contract: out-of-balance {force_ratio:.2e}");
        let mut path = self.stabilised_path(settings.viscosity, target, reason);
        (path.viscosity, path.iterations) = (0.0, *iterations);
        // Up to where a larger step has been stabilised in vain, smaller ones are stabilised by a few increments only.
        if self.stabilised_in_vain.is_some() && path.most_without_gain.is_some() {
            path.most_without_gain = Some(FEW_WITHOUT_GAIN);
        }
        path.event.largest_imbalance = *force_ratio;
        let after = self.constraints.restrict(&self.balance.residual());
        let committed = self.commit_part(&mut path, increment, target, &after, session);
        committed.map_err(|error| failure(error).into_outcome())?;
        self.take_path(path, state, settings, target, before, session)
    }
}
