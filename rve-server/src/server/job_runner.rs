//! Where jobs are done: the RVEs built so far, the states at hand, and the engine behind a guard.
//!
//! Invariants: an answer depends on the job alone, never on what was done before it; an engine that panics costs one
//! failed answer, not the worker; no number that is not finite leaves.

use super::state_cache::StateCache;
use protocol::transport::LoadedReply;
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{
    ContentId, Definition, DefinitionId, RveEngine, RveError, RveSolver, StateId, TrialOptions, TrialRequest,
    TrialResult, nanoseconds_since,
};
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::time::Instant;

/// An answer that owns its snapshot and error text.
#[derive(Debug)]
pub(super) struct OwnedReply {
    pub(super) reply: TrialReply,
    pub(super) state: Rc<Vec<u8>>,
    pub(super) error: Vec<u8>,
}

impl OwnedReply {
    fn bare(job: &TrialJob, status: ReplyStatus) -> Self {
        Self { reply: TrialReply::bare(job, status), state: Rc::default(), error: Vec::new() }
    }

    /// A failure with its reason.
    pub(super) fn failed(job: &TrialJob, error: &RveError) -> Self {
        let error = rmp_serde::to_vec(error).expect("error values have no unserialisable parts");
        let mut reply = TrialReply::bare(job, ReplyStatus::Failed);
        reply.error_length = error.len() as u64;
        Self { reply, state: Rc::default(), error }
    }

    /// Borrowed, as a port sends it.
    pub(super) fn loaded(&self) -> LoadedReply<'_> {
        LoadedReply { reply: self.reply, state: &self.state, error: &self.error }
    }
}

/// What jobs that are solved side by side have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Model {
    /// Of several definitions, which differ in their initial states only.
    Shared(ContentId),
    /// Of one definition.
    Definition(DefinitionId),
}

/// One RVE that was defined.
struct Rve {
    definition: Definition,
    model: Model,
    /// Snapshot of the state in which the engine creates it.
    initial: Rc<Vec<u8>>,
    initial_id: StateId,
    /// None after a panic: what is left of a solver then is not trusted.
    solver: Option<Box<dyn RveSolver>>,
    /// Name of the solver's committed state.
    committed: StateId,
}

/// Does jobs with one engine.
pub(super) struct JobRunner<'a> {
    engine: &'a mut dyn RveEngine,
    rves: BTreeMap<DefinitionId, Rve>,
    /// Definitions over which the engine broke down, with what it said.
    broken: BTreeMap<DefinitionId, RveError>,
    states: StateCache,
}

impl<'a> JobRunner<'a> {
    /// An empty runner that keeps at most `state_cache` snapshots.
    pub(super) fn new(engine: &'a mut dyn RveEngine, state_cache: usize) -> Self {
        Self { engine, rves: BTreeMap::new(), broken: BTreeMap::new(), states: StateCache::new(state_cache) }
    }

    /// Builds an RVE; a definition that is already known is left alone. An engine that breaks down over it says nothing about the
    /// definition, whose refusal would end the run: jobs that need it fail with the fault, as after a fault in a trial.
    ///
    /// # Errors
    /// The engine's refusal.
    pub(super) fn define(&mut self, definition: Definition) -> Result<(), RveError> {
        let id = definition.id();
        if self.rves.contains_key(&id) {
            return Ok(());
        }
        let (solver, initial) = match build(self.engine, &definition) {
            Err(fault @ RveError::EngineFault(_)) => {
                tracing::error!(%fault, "the engine broke down over a definition");
                self.broken.insert(id, fault);
                return Ok(());
            }
            built => built?,
        };
        self.broken.remove(&id);
        let initial_id = StateId::of(&initial);
        let model = solver.model_identity().map_or(Model::Definition(id), Model::Shared);
        let rve = Rve {
            definition,
            model,
            initial: Rc::new(initial),
            initial_id,
            solver: Some(solver),
            committed: initial_id,
        };
        self.rves.insert(id, rve);
        Ok(())
    }

    /// Does the jobs of one message; jobs on RVEs of the same model side by side, if its engine can. `carried` next to each job is
    /// the snapshot that came with it, or empty.
    pub(super) fn run_all(&mut self, slice: &[(TrialJob, Vec<u8>)]) -> Vec<OwnedReply> {
        let begin = Instant::now();
        let mut replies: Vec<Option<OwnedReply>> = slice.iter().map(|_| None).collect();
        let mut ready: BTreeMap<Model, Vec<Ready>> = BTreeMap::new();
        for (place, (job, carried)) in slice.iter().enumerate() {
            match self.prepare(job, carried) {
                Ok(Prepared::Ready { options, wanted, start }) => {
                    let model = self.rves[&job.definition].model;
                    ready.entry(model).or_default().push(Ready { place, options, wanted, start });
                }
                Ok(Prepared::Answered(answer)) => replies[place] = Some(answer),
                Err(error) => replies[place] = Some(OwnedReply::failed(job, &error)),
            }
        }
        for group in ready.into_values() {
            if let [one] = group.as_slice() {
                replies[one.place] = Some(self.do_alone(&slice[one.place].0, one));
                continue;
            }
            for (one, answer) in group.iter().zip(self.do_together(slice, &group)) {
                replies[one.place] = Some(answer);
            }
        }
        let missing = RveError::EngineFault("the engine has returned fewer results than it was given jobs".into());
        let answers = replies.into_iter().zip(slice);
        let mut replies: Vec<OwnedReply> =
            answers.map(|(answer, (job, _))| answer.unwrap_or_else(|| OwnedReply::failed(job, &missing))).collect();
        let total = nanoseconds_since(begin);
        let worked = replies.iter().map(|answer| &answer.reply.cost);
        let worked = worked.fold(0u64, |sum, cost| {
            sum.saturating_add(cost.solve_nanoseconds).saturating_add(cost.tangent_nanoseconds)
        });
        let overhead = total.saturating_sub(worked) / replies.len().max(1) as u64;
        for answer in &mut replies {
            answer.reply.overhead_nanoseconds = overhead;
        }
        replies
    }

    /// Checks a job and finds the state it starts from.
    fn prepare(&mut self, job: &TrialJob, carried: &[u8]) -> Result<Prepared, RveError> {
        let options = job.options()?;
        if !job.target.is_finite() {
            return Err(RveError::TargetNotFinite);
        }
        if !carried.is_empty() {
            check_name(job.state, carried)?;
            self.states.insert(job.state, Rc::new(carried.to_vec()));
        }
        if let Some(fault) = self.broken.get(&job.definition) {
            return Err(fault.clone());
        }
        let Some(rve) = self.rves.get(&job.definition) else {
            return Ok(Prepared::Answered(OwnedReply::bare(job, ReplyStatus::NeedDefinition)));
        };
        let wanted = if job.state == StateId::NONE { rve.initial_id } else { job.state };
        let start = if wanted == rve.initial_id { Some(Rc::clone(&rve.initial)) } else { self.states.get(wanted) };
        Ok(match start {
            Some(start) => Prepared::Ready { options, wanted, start },
            None => Prepared::Answered(OwnedReply::bare(job, ReplyStatus::NeedState)),
        })
    }

    /// The solver of a known RVE; a caller puts it back intact.
    fn solver(&mut self, definition: DefinitionId) -> Result<Box<dyn RveSolver>, RveError> {
        let rve = self.rves.get_mut(&definition).expect("the RVE has been found before");
        match rve.solver.take() {
            Some(solver) => Ok(solver),
            None => {
                rve.committed = rve.initial_id;
                Ok(build(self.engine, &rve.definition)?.0)
            }
        }
    }

    fn put_back(&mut self, definition: DefinitionId, solver: Box<dyn RveSolver>, committed: StateId) {
        let rve = self.rves.get_mut(&definition).expect("the RVE has been found before");
        rve.solver = Some(solver);
        rve.committed = committed;
    }

    fn do_alone(&mut self, job: &TrialJob, ready: &Ready) -> OwnedReply {
        self.try_alone(job, ready).unwrap_or_else(|error| OwnedReply::failed(job, &error))
    }

    fn try_alone(&mut self, job: &TrialJob, ready: &Ready) -> Result<OwnedReply, RveError> {
        let Ready { options, wanted, start, .. } = ready;
        let mut solver = self.solver(job.definition)?;
        let committed = self.rves[&job.definition].committed;
        // The solver moves into the guarded call and only comes back from it whole.
        let (solver, outcome) = guarded(move || {
            let outcome = try_trial(solver.as_mut(), committed == *wanted, start, job, options);
            solver.rollback();
            (solver, outcome)
        })?;
        let after = if matches!(outcome, Outcome::NotRestored(_)) { committed } else { *wanted };
        self.put_back(job.definition, solver, after);
        match outcome {
            Outcome::NotRestored(error) | Outcome::NotSolved(error) => Err(error),
            Outcome::Solved(answer, state) => self.delivered(job, &answer, state),
        }
    }

    /// Several jobs on RVEs of one model, by the solver of the first of them.
    fn do_together(&mut self, slice: &[(TrialJob, Vec<u8>)], group: &[Ready]) -> Vec<OwnedReply> {
        let job_of = |ready: &Ready| &slice[ready.place].0;
        let definition = job_of(&group[0]).definition;
        let mut solver = match self.solver(definition) {
            Ok(solver) => solver,
            Err(error) => return group.iter().map(|ready| OwnedReply::failed(job_of(ready), &error)).collect(),
        };
        let requests: Vec<TrialRequest<'_>> = group
            .iter()
            .map(|ready| {
                let TrialJob { definition, target, .. } = *job_of(ready);
                TrialRequest { definition, state: &ready.start, target, options: ready.options }
            })
            .collect();
        let together = guarded(|| {
            let outcomes = solver.solve_batch(&requests);
            (solver, outcomes)
        });
        let Ok((solver, outcomes)) = together else {
            // One of them brought the engine down. Alone, each takes only itself along.
            return group.iter().map(|ready| self.do_alone(job_of(ready), ready)).collect();
        };
        // No state has this name: the next job restores its own.
        self.put_back(definition, solver, StateId::NONE);
        let answered = outcomes.into_iter().zip(group).map(|(outcome, ready)| {
            let job = job_of(ready);
            let delivered = outcome.and_then(|(answer, state)| self.delivered(job, &answer, state));
            delivered.unwrap_or_else(|error| OwnedReply::failed(job, &error))
        });
        answered.collect()
    }

    /// A finished answer as it is sent; its state stays at hand.
    fn delivered(&mut self, job: &TrialJob, answer: &TrialResult, state: Vec<u8>) -> Result<OwnedReply, RveError> {
        let id = StateId::of(&state);
        let reply = TrialReply::done(job, answer, id, state.len() as u64);
        if !reply.is_finite() {
            return Err(RveError::NotFinite { force_evaluations: answer.cost.force_evaluations });
        }
        let state = Rc::new(state);
        self.states.insert(id, Rc::clone(&state));
        Ok(OwnedReply { reply, state, error: Vec::new() })
    }
}

/// A job that can be done.
struct Ready {
    /// Its place in the message.
    place: usize,
    options: TrialOptions,
    /// Name of the state it starts from.
    wanted: StateId,
    /// Snapshot of that state.
    start: Rc<Vec<u8>>,
}

/// State of a job after its arrival.
#[expect(clippy::large_enum_variant, reason = "a handful at a time, taken apart at once")]
enum Prepared {
    Ready { options: TrialOptions, wanted: StateId, start: Rc<Vec<u8>> },
    Answered(OwnedReply),
}

enum Outcome {
    /// The solver still has the committed state it had.
    NotRestored(RveError),
    /// The solver has the wanted committed state.
    NotSolved(RveError),
    /// Likewise, and here is its answer with the snapshot of the trial state.
    Solved(Box<TrialResult>, Vec<u8>),
}

fn try_trial(
    solver: &mut dyn RveSolver,
    at_start: bool,
    start: &[u8],
    job: &TrialJob,
    options: &TrialOptions,
) -> Outcome {
    if !at_start && let Err(error) = solver.restore(start) {
        return Outcome::NotRestored(error);
    }
    let mut state = Vec::new();
    let solved = solver.trial(&job.target, options).and_then(|answer| {
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
