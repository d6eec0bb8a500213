//! The correction of an evaluated iterate: condensed stiffness, its factors, quasi-Newton pairs.

use crate::solve::driver::{Solver, timed};
use crate::solve::linear_solver::LinearSolverError;
use crate::solve::vectors::largest_component;

impl Solver<'_> {
    /// The correction of the evaluated iterate, zero at prescribed degrees of freedom: Newton's, with the tangents of the
    /// strategy's update rule, modified by quasi-Newton pairs.
    pub(super) fn correction(&mut self, iterate: &[f64]) -> Result<Vec<f64>, LinearSolverError> {
        let residual = self.constraints.restrict(&self.balance.residual());
        let right: Vec<f64> = residual.iter().map(|value| -value).collect();
        if let Some(memory) = &mut self.memory {
            let change = |step: &[f64]| largest_component(&self.body.gradients(&self.constraints.expand(step)));
            memory.learn(&self.constraints.select(iterate), &residual, change);
        }
        if self.tangents.factorizes() {
            self.factorize()?;
        }
        self.solve_linear(&right)
    }

    /// Factorizes the stiffness of the latest balance.
    pub(in crate::solve) fn factorize(&mut self) -> Result<(), LinearSolverError> {
        let blocks = self.constraints.condense(&self.balance.blocks);
        timed(&mut self.statistics.linear_solver_nanoseconds, || self.linear.factorize(&blocks))?;
        self.tangents.factorized();
        Ok(())
    }

    /// Solves with the factors in place and returns displacements that are zero where prescribed.
    pub(in crate::solve) fn solve_linear(&mut self, right: &[f64]) -> Result<Vec<f64>, LinearSolverError> {
        let (linear, memory) = (&mut self.linear, &self.memory);
        let solution = timed(&mut self.statistics.linear_solver_nanoseconds, || match memory {
            Some(memory) => memory.apply(right, |right| linear.solve(right)),
            None => linear.solve(right),
        });
        self.statistics.symbolic_factorizations = self.linear.symbolic_count();
        self.statistics.numeric_factorizations = self.linear.numeric_count();
        self.statistics.linear_iterations = self.linear.iteration_count();
        self.statistics.direct_fallbacks = self.linear.fallback_count();
        Ok(self.constraints.expand(&solution?))
    }
}
