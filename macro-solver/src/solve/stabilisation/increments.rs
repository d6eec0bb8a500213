//! The increments of a stabilised step: how far supports, loads and the body move in the next one.

use super::path::StabilisedPath;
use crate::solve::driver::Solver;
use crate::solve::linear_solver::LinearSolverError;
use crate::solve::vectors::largest_component;

/// Share of the cap by which the response at fixed loads may strain the body while supports and loads move.
const LARGEST_LAG: f64 = 0.5;

/// Excess over the cap that is rounding.
const ROUNDING: f64 = 1e-9;

/// Times that a motion of supports and loads is halved because it strains the body by more than it should.
const MAX_HALVINGS: usize = 20;

/// An increment to be tried.
pub(super) struct Trial {
    pub(super) increment: Vec<f64>,
    /// Share of the stage's path at which supports and loads are after it.
    pub(super) to: f64,
    /// Out-of-balance force along the unknowns before it, with the part that the motion of supports and loads adds.
    pub(super) residual: Vec<f64>,
}

impl Solver<'_> {
    /// The next increment on the way to the share `target` of the path. No component of a displacement gradient is
    /// larger than `capped_change` in it, next to a support as anywhere else.
    pub(super) fn viscous_increment(
        &mut self,
        path: &mut StabilisedPath,
        target: f64,
    ) -> Result<Trial, LinearSolverError> {
        self.balance = self.committed_balance.clone();
        let viscosity = path.viscosity;
        if viscosity > 0.0 {
            let points = self.points.all();
            let viscous_blocks = path.viscous_blocks(&self.body, |point| points[point].first_moduli());
            // Blocks of elements come first.
            for (block, viscous) in self.balance.blocks.iter_mut().zip(viscous_blocks) {
                for (entry, viscous) in block.matrix.iter_mut().zip(&viscous.matrix) {
                    *entry += viscosity * viscous;
                }
            }
        }
        self.factorize()?;
        let cap = self.stage().strategy.capped_change;
        let at_fixed_loads = self.linear_response(path.stage_fraction)?;
        let lag = self.largest_change(&at_fixed_loads);
        if path.stage_fraction < target
            && let Some(trial) =
                self.loading_increment(path.stage_fraction, target, &at_fixed_loads, lag, path.loading_cap(cap))?
        {
            return Ok(trial);
        }
        let Trial { mut increment, to, residual } = at_fixed_loads;
        let share = (cap / lag).min(path.step_factor);
        for &dof in self.constraints.free() {
            increment[dof] *= share;
        }
        let moment = self.moment(to);
        self.constraints.complete(&mut increment, &self.body.displacements, moment);
        Ok(Trial { increment, to, residual })
    }

    /// An increment in which supports and loads move from the share `from` of the path as far towards `target` as no
    /// point is strained by more than `cap`; `None` while the body lags behind. `at_fixed_loads` is the increment in
    /// which they do not move, and `lag` the largest change of a displacement gradient in it.
    fn loading_increment(
        &mut self,
        from: f64,
        target: f64,
        at_fixed_loads: &Trial,
        lag: f64,
        cap: f64,
    ) -> Result<Option<Trial>, LinearSolverError> {
        let whole = self.linear_response(target)?;
        if self.largest_change(&whole) <= cap {
            return Ok(Some(whole));
        }
        if lag > LARGEST_LAG * cap {
            return Ok(None);
        }
        let by_loading: Vec<f64> =
            whole.increment.iter().zip(&at_fixed_loads.increment).map(|(whole, fixed)| whole - fixed).collect();
        let mut share = (cap - lag) / largest_component(&self.body.gradients(&by_loading));
        for _ in 0..MAX_HALVINGS {
            let part = self.linear_response(from + share * (target - from))?;
            if self.largest_change(&part) <= cap * (1.0 + ROUNDING) {
                return Ok(Some(part));
            }
            // Histories need not be straight.
            share *= 0.5;
        }
        Ok(None)
    }

    /// The linear response of the body to supports and loads at the share `to` of the path, from the committed state and with
    /// the factors in place. Prescribed components are exact.
    fn linear_response(&mut self, to: f64) -> Result<Trial, LinearSolverError> {
        let moment = self.moment(to);
        let mut increment = self.given(moment);
        self.balance.external = self.loads.force(&self.body.positions(&self.body.zero()), moment);
        let mut forces = self.balance.residual();
        for (force, of_supports) in forces.iter_mut().zip(self.balance.stiffness_times(&increment)) {
            *force += of_supports;
        }
        let residual = self.constraints.restrict(&forces);
        let free = self.solve_linear(&residual.iter().map(|force| -force).collect::<Vec<f64>>())?;
        for &dof in self.constraints.free() {
            increment[dof] = free[dof];
        }
        self.constraints.complete(&mut increment, &self.body.displacements, moment);
        Ok(Trial { increment, to, residual })
    }

    fn largest_change(&self, of: &Trial) -> f64 {
        largest_component(&self.body.gradients(&of.increment))
    }
}
