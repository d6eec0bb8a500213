//! Steps in which nothing changes: a stage that holds what there is, a cyclic history met at its zeros.
//!
//! Such a step has no displacement that its corrections could be compared with. If the body is in balance as it is, it stays so.

use crate::model::failure::Failure;
use crate::model::friction::Frictions;
use crate::observer::{Convergence, IterationReport};
use crate::solve::accepted::Converged;
use crate::solve::driver::{Session, Solver};
use crate::solve::vectors::norm;
use protocol::TangentKind;

/// Prescribed motion over the extent of the body, and change of the loads over the loads, below which nothing changes.
const NOTHING: f64 = 1e-12;

impl Solver<'_> {
    /// Takes the step without any motion if nothing changes in it and the out-of-balance force is within its tolerance.
    pub(super) fn remain(&mut self, target: f64, session: &mut Session<'_>) -> Result<Option<Converged>, Failure> {
        if !self.is_idle(target) {
            return Ok(None);
        }
        let still = self.body.zero();
        let norms = self.balance_at(&still, target, TangentKind::None, session)?;
        let tolerances = &self.stage().tolerances;
        let force_ratio = norms.force_ratio(tolerances);
        if force_ratio > tolerances.force {
            return Ok(None);
        }
        self.statistics.iterations += 1;
        self.statistics.idle_steps += 1;
        let report = IterationReport {
            evaluations: norms.evaluations,
            force_ratio,
            displacement_ratio: Some(0.0),
            ..self.blank_report(target, 1)
        };
        session.observer.iterated(&report);
        Ok(Some(Converged {
            increment: still,
            load: target,
            iterations: 1,
            force_ratio,
            displacement_ratio: 0.0,
            correction: None,
            convergence: Convergence::Full,
        }))
    }

    /// Whether supports, loads and friction are at the share `target` of the stage's path what they are now.
    fn is_idle(&self, target: f64) -> bool {
        if self.path_constraint.is_some() || target <= self.stage_fraction {
            return false;
        }
        let (now, then) = (self.moment(self.stage_fraction), self.moment(target));
        let friction = reduced(self.frictions.reductions(then));
        let begins_otherwise = || self.stage_fraction == 0.0 && friction != self.friction_before();
        if friction != reduced(self.frictions.reductions(now)) || begins_otherwise() {
            return false;
        }
        let given = self.given(then);
        let most = NOTHING * self.body.extent();
        if given.iter().any(|value| value.abs() > most) {
            return false;
        }
        let positions = self.body.positions(&self.body.zero());
        let [before, after] = [now, then].map(|moment| self.loads.force(&positions, moment));
        let change: Vec<f64> = before.iter().zip(&after).map(|(before, after)| after - before).collect();
        norm(&change) <= NOTHING * norm(&after)
    }

    /// Reductions of friction at the end of the stage before; none before the first.
    fn friction_before(&self) -> Vec<f64> {
        let Some(before) = self.stage.checked_sub(1).map(|number| &self.problem.stages[number]) else {
            return Vec::new();
        };
        let frictions = Frictions::new(self.problem, before, &self.body);
        frictions.map(|frictions| reduced(frictions.reductions(before.moment(1.0)))).unwrap_or_default()
    }
}

/// Reductions of friction, empty if there are none.
fn reduced(reductions: Vec<f64>) -> Vec<f64> {
    if reductions.iter().all(|reduction| *reduction == 0.0) { Vec::new() } else { reductions }
}
