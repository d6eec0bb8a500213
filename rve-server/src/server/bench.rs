//! Where jobs are done: the RVEs built so far, the states at hand, and the engine behind a guard.
//!
//! Invariants: an answer depends on the job alone, never on what was done before it; an engine that panics costs one
//! failed answer, not the worker; no number that is not finite leaves.

use super::states::StateCache;
use protocol::transport::LoadedReply;
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{ContentId, Definition, DefinitionId, RveEngine, RveError, RveSolver, StateId, TrialAnswer};
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

/// An answer that owns its snapshot and error text.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) reply: TrialReply,
    pub(super) state: Vec<u8>,
    pub(super) error: Vec<u8>,
}

impl Answer {
    fn bare(job: &TrialJob, status: ReplyStatus) -> Self {
        Self { reply: TrialReply::bare(job, status), state: Vec::new(), error: Vec::new() }
    }

    /// A failure with its reason.
    pub(super) fn failed(job: &TrialJob, error: &RveError) -> Self {
        let error = rmp_serde::to_vec(error).expect("error values have no unserialisable parts");
        let mut reply = TrialReply::bare(job, ReplyStatus::Failed);
        reply.error_length = error.len() as u64;
        Self { reply, state: Vec::new(), error }
    }

    /// Borrowed, as a port sends it.
    pub(super) fn loaded(&self) -> LoadedReply<'_> {
        LoadedReply { reply: self.reply, state: &self.state, error: &self.error }
    }
}

/// One RVE that was defined.
struct Rve {
    definition: Definition,
    /// Snapshot of the state in which the engine creates it.
    initial: Vec<u8>,
    initial_id: StateId,
    /// None after a panic: what is left of a solver then is not trusted.
    solver: Option<Box<dyn RveSolver>>,
    /// Name of the solver's committed state.
    committed: StateId,
}

/// Does jobs with one engine.
pub(super) struct Bench<'a> {
    engine: &'a mut dyn RveEngine,
    rves: BTreeMap<DefinitionId, Rve>,
    states: StateCache,
}

impl<'a> Bench<'a> {
    /// An empty bench that keeps at most `state_cache` snapshots.
    pub(super) fn new(engine: &'a mut dyn RveEngine, state_cache: usize) -> Self {
        Self { engine, rves: BTreeMap::new(), states: StateCache::new(state_cache) }
    }

    /// Builds an RVE; a definition that is already known is left alone.
    ///
    /// # Errors
    /// The engine's refusal.
    pub(super) fn define(&mut self, definition: Definition) -> Result<(), RveError> {
        let id = definition.id();
        if self.rves.contains_key(&id) {
            return Ok(());
        }
        let (solver, initial) = build(self.engine, &definition)?;
        let initial_id = StateId::of(&initial);
        let rve = Rve { definition, initial, initial_id, solver: Some(solver), committed: initial_id };
        self.rves.insert(id, rve);
        Ok(())
    }

    /// Does one job; `carried` is the snapshot that came with it, or empty.
    pub(super) fn answer(&mut self, job: &TrialJob, carried: &[u8]) -> Answer {
        let begin = Instant::now();
        let mut answer = match self.try_answer(job, carried) {
            Ok(answer) => answer,
            Err(error) => Answer::failed(job, &error),
        };
        let total = u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX);
        let cost = &answer.reply.cost;
        answer.reply.overhead_nanoseconds =
            total.saturating_sub(cost.solve_nanoseconds.saturating_add(cost.tangent_nanoseconds));
        answer
    }

    fn try_answer(&mut self, job: &TrialJob, carried: &[u8]) -> Result<Answer, RveError> {
        let ask = job.ask()?;
        if !job.target.is_finite() {
            return Err(RveError::TargetNotFinite);
        }
        if !carried.is_empty() {
            check_name(job.state, carried)?;
            self.states.keep(job.state, carried);
        }
        let Some(rve) = self.rves.get_mut(&job.definition) else {
            return Ok(Answer::bare(job, ReplyStatus::NeedDefinition));
        };
        let wanted = if job.state == StateId::NONE { rve.initial_id } else { job.state };
        let start = if wanted == rve.initial_id { Some(rve.initial.as_slice()) } else { self.states.get(wanted) };
        let Some(start) = start else {
            return Ok(Answer::bare(job, ReplyStatus::NeedState));
        };
        let mut solver = match rve.solver.take() {
            Some(solver) => solver,
            None => {
                rve.committed = rve.initial_id;
                build(self.engine, &rve.definition)?.0
            }
        };
        let committed = rve.committed;
        // The solver moves into the guarded call and only comes back from it whole.
        let (solver, outcome) = guarded(move || {
            let outcome = try_trial(solver.as_mut(), committed == wanted, start, job, &ask);
            solver.rollback();
            (solver, outcome)
        })?;
        rve.solver = Some(solver);
        let (answer, state) = match outcome {
            Outcome::NotRestored(error) => return Err(error),
            Outcome::NotSolved(error) => {
                rve.committed = wanted;
                return Err(error);
            }
            Outcome::Solved(answer, state) => (answer, state),
        };
        rve.committed = wanted;
        let id = StateId::of(&state);
        let reply = TrialReply::done(job, &answer, id, state.len() as u64);
        if !reply.is_finite() {
            return Err(RveError::NotFinite { force_evaluations: answer.cost.force_evaluations });
        }
        self.states.keep(id, &state);
        Ok(Answer { reply, state, error: Vec::new() })
    }
}

enum Outcome {
    /// The solver still has the committed state it had.
    NotRestored(RveError),
    /// The solver has the wanted committed state.
    NotSolved(RveError),
    /// Likewise, and here is its answer with the snapshot of the trial state.
    Solved(Box<TrialAnswer>, Vec<u8>),
}

fn try_trial(
    solver: &mut dyn RveSolver,
    at_start: bool,
    start: &[u8],
    job: &TrialJob,
    ask: &protocol::Ask,
) -> Outcome {
    if !at_start && let Err(error) = solver.restore(start) {
        return Outcome::NotRestored(error);
    }
    let mut state = Vec::new();
    let solved = solver.trial(&job.target, ask).and_then(|answer| {
        solver.snapshot_trial(&mut state)?;
        Ok(answer)
    });
    match solved {
        Ok(answer) => Outcome::Solved(Box::new(answer), state),
        Err(error) => Outcome::NotSolved(error),
    }
}

/// A new solver and the snapshot of its initial state.
fn build(engine: &mut dyn RveEngine, definition: &Definition) -> Result<(Box<dyn RveSolver>, Vec<u8>), RveError> {
    guarded(|| {
        let solver = engine.create(definition)?;
        let mut initial = Vec::new();
        solver.snapshot(&mut initial);
        Ok((solver, initial))
    })?
}

fn check_name(name: StateId, bytes: &[u8]) -> Result<(), RveError> {
    let found = ContentId::of(bytes);
    if found == name {
        return Ok(());
    }
    Err(RveError::Snapshot(format!("the snapshot sent for state {name} is in truth {found}: it was damaged")))
}

/// Runs engine code; a panic becomes an error.
fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, RveError> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| RveError::EngineFault(panic_text(panic.as_ref())))
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("a panic without a text").to_owned()
}
