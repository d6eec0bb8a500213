//! The event-driven solver: small increments by the linear response of the grains, with an exact check of every answer.
//!
//! Between two events (a contact opens, closes, begins or ceases to slide) the grains of an equilibrated cell answer a strain
//! linearly. The response is found by one sparse factorisation, stored with the state, and used until it fails: an answer is
//! accepted only if the exact contact forces after the increment are in balance. Where they are not, Newton's method finds
//! the modes of the contacts at the end of the increment. Everything else is handed over to relaxation, which is the default
//! solver: increments that are large, laws other than linear springs with friction, spheres, cells that carry no load, modes
//! that are not found, and cells in which all this has cost more than it saved.

mod account;
mod attempt;
mod evaluation;
mod near_pairs;

use super::answered_by::AnsweredBy;
use super::grain_solver::{End, GrainSolver, SolveJob};
use super::linear::LinearResponses;
use super::relaxation;
use crate::cell::{ContactNetwork, EventMemory, GrainState};
use crate::contact::{ContactLaws, ContactTable, PlainLinear};
use crate::definition::{Criterion, GrainModel};
use crate::error::DefinitionError;
use crate::space::{Discs, Space, largest_component};
use account::{Spent, book};
use attempt::{Workspace, attempt};
use protocol::RveError;

/// Relaxation that marks every answer to a motion as handed over: all of this solver for grains or laws without linear responses.
#[derive(Debug)]
struct HandsOver<S: Space> {
    relaxation: Box<dyn GrainSolver<S>>,
}

/// The solver for discs with linear springs and friction, with its working memory.
#[derive(Debug)]
struct EventDrivenDiscs {
    /// Answers what this solver does not, and tells the state of the grains.
    rest: HandsOver<Discs>,
    law: PlainLinear,
    work: Workspace,
    /// Without them everything is handed over.
    responses: Option<Box<dyn LinearResponses>>,
}

/// The event-driven solver for discs and the law that a table chooses.
///
/// # Errors
/// A table that is not valid.
pub(super) fn for_discs(contact: &ContactTable) -> Result<Box<dyn GrainSolver<Discs>>, DefinitionError> {
    if !contact.law.is_linear() || contact.is_extended() || !contact.has_tangential_springs() {
        return for_others(contact);
    }
    let law = contact.plain_linear()?;
    let rest = HandsOver::for_contact(contact)?;
    Ok(Box::new(EventDrivenDiscs { rest, law, work: Workspace::default(), responses: None }))
}

/// The solver for grains or laws without linear responses: it hands everything over, and says so.
///
/// # Errors
/// A table that is not valid.
pub(super) fn for_others<S: Space<Kernel: ContactLaws>>(
    contact: &ContactTable,
) -> Result<Box<dyn GrainSolver<S>>, DefinitionError> {
    Ok(Box::new(HandsOver::for_contact(contact)?))
}

/// Whether a job asks for a motion; others are mere evaluations.
fn moves<S: Space>(job: &SolveJob<'_, S>) -> bool {
    job.ramp_steps > 0
}

impl<S: Space> HandsOver<S> {
    /// # Errors
    /// A table that is not valid.
    fn for_contact(contact: &ContactTable) -> Result<Self, DefinitionError>
    where
        S: Space<Kernel: ContactLaws>,
    {
        Ok(Self { relaxation: relaxation::for_contact(contact)? })
    }

    /// One with working memory of its own.
    fn another(&self) -> Self {
        Self { relaxation: self.relaxation.new_instance() }
    }
}

impl<S: Space> GrainSolver<S> for HandsOver<S> {
    fn solve(&mut self, model: &GrainModel, jobs: &[SolveJob<'_, S>]) -> Vec<Result<End<S>, RveError>> {
        let mut ends = self.relaxation.solve(model, jobs);
        for (end, job) in ends.iter_mut().zip(jobs) {
            if let Ok(end) = end
                && moves(job)
            {
                end.solved.answered_by = AnsweredBy::HandedOver;
            }
        }
        ends
    }

    fn network(&self, model: &GrainModel, end: &End<S>) -> ContactNetwork<S> {
        self.relaxation.network(model, end)
    }

    fn elastic_energy(&self, model: &GrainModel, state: &GrainState<S>) -> f64 {
        self.relaxation.elastic_energy(model, state)
    }

    fn use_lanes(&mut self, uses_lanes: bool) {
        self.relaxation.use_lanes(uses_lanes);
    }

    fn count_energies(&mut self, counts: bool) {
        self.relaxation.count_energies(counts);
    }

    fn new_instance(&self) -> Box<dyn GrainSolver<S>> {
        Box::new(self.another())
    }
}

impl GrainSolver<Discs> for EventDrivenDiscs {
    fn solve(&mut self, model: &GrainModel, jobs: &[SolveJob<'_, Discs>]) -> Vec<Result<End<Discs>, RveError>> {
        let mut ends: Vec<Option<Result<End<Discs>, RveError>>> = Vec::with_capacity(jobs.len());
        let (mut others, mut memories) = (Vec::new(), Vec::new());
        for job in jobs {
            let mut memory = job.state.events.as_deref().cloned().unwrap_or_default();
            let mut spent = Spent::default();
            let answer = self.answer(model, job, &mut memory, &mut spent);
            if answer.is_none() {
                memory.response = None;
                others.push(*job);
                memories.push((memory, spent));
            }
            ends.push(answer.map(Ok));
        }
        let mut relaxed = self.rest.solve(model, &others).into_iter().zip(&others).zip(memories);
        for end in ends.iter_mut().filter(|end| end.is_none()) {
            *end = relaxed.next().map(|((end, job), (memory, spent))| {
                end.map(|mut end| {
                    end.solved.force_evaluations += u64::from(spent.evaluations.unsigned_abs());
                    end.state.events = moves(job).then(|| Box::new(memory));
                    end
                })
            });
        }
        ends.into_iter().flatten().collect()
    }

    fn network(&self, model: &GrainModel, end: &End<Discs>) -> ContactNetwork<Discs> {
        self.rest.network(model, end)
    }

    fn elastic_energy(&self, model: &GrainModel, state: &GrainState<Discs>) -> f64 {
        self.rest.elastic_energy(model, state)
    }

    fn use_lanes(&mut self, uses_lanes: bool) {
        self.rest.use_lanes(uses_lanes);
    }

    fn count_energies(&mut self, counts: bool) {
        self.rest.count_energies(counts);
    }

    fn use_responses(&mut self, responses: Box<dyn LinearResponses>) {
        self.responses = Some(responses);
    }

    fn new_instance(&self) -> Box<dyn GrainSolver<Discs>> {
        let responses = self.responses.as_ref().map(|responses| responses.new_instance());
        Box::new(Self { rest: self.rest.another(), law: self.law, work: Workspace::default(), responses })
    }
}

impl EventDrivenDiscs {
    /// Answers a job, or leaves it to relaxation. `memory` becomes that of the state that follows in either case.
    fn answer(
        &mut self,
        model: &GrainModel,
        job: &SolveJob<'_, Discs>,
        memory: &mut EventMemory<Discs>,
        spent: &mut Spent,
    ) -> Option<End<Discs>> {
        // A state out of balance moves however small the increment is, and what its motion loses no linear response tells.
        let applies = moves(job)
            && job.state.bears_load
            && job.state.unbalanced <= model.options.tolerance()
            && !job.state.contacts.is_empty()
            && model.options.criterion != Criterion::Energy
            && largest_component(&job.strain) <= model.options.largest_event_increment();
        if !applies {
            return None;
        }
        if memory.pause > 0 {
            memory.pause -= 1;
            return None;
        }
        let responses = self.responses.as_deref_mut()?;
        let answered = attempt(&mut self.work, responses, model, &self.law, job, spent).ok();
        memory.response = None;
        let answer = answered.map(|answered| {
            memory.response = Some(answered.response);
            answered.end
        });
        book(memory, *spent, answer.is_some(), &model.options, job.ramp_steps);
        answer.map(|mut end| {
            end.state.events = Some(Box::new(memory.clone()));
            end
        })
    }
}
