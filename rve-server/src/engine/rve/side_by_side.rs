//! Several trials of one packing, side by side in lanes.

use super::{GrainRve, Stretch, checked_target};
use crate::cell::GrainState;
use crate::engine::snapshot::opened;
use crate::solver::{End, SolveJob, SolverFor};
use crate::space::Space;
use protocol::{
    DefinitionId, Observables, RveError, RveSolver, TrialOptions, TrialRequest, TrialResult, nanoseconds_since,
    solve_alone,
};
use std::time::Instant;

/// A request whose state has been read.
struct PreparedTrial<S: Space> {
    /// Its place among the requests.
    place: usize,
    /// Names its snapshots.
    definition: DefinitionId,
    state: GrainState<S>,
    stretch: Stretch<S>,
    options: TrialOptions,
}

/// An answer with the sealed snapshot of its trial state.
type TrialOutcome = Result<(TrialResult, Vec<u8>), RveError>;

impl<S: SolverFor> GrainRve<S> {
    /// Answers requests on cells of this model, each from the state that it names.
    pub(super) fn answer_side_by_side(&mut self, requests: &[TrialRequest<'_>]) -> Vec<TrialOutcome> {
        let mut answers: Vec<Option<TrialOutcome>> = requests.iter().map(|_| None).collect();
        let mut prepared = Vec::new();
        for (place, request) in requests.iter().enumerate() {
            let stretched = checked_target::<S::Tensor>(&request.target).and_then(|gradient| {
                if self.stays(&gradient, &request.options) {
                    return Ok(None);
                }
                let state = opened(request.state, request.definition, self.model.radii.len())?;
                Ok(Some((state, self.stretch(&gradient, &request.options)?)))
            });
            match stretched {
                Ok(Some((state, stretch))) => {
                    let (definition, options) = (request.definition, request.options);
                    prepared.push(PreparedTrial { place, definition, state, stretch, options });
                }
                Ok(None) => answers[place] = Some(self.named(request.definition, |rve| solve_alone(rve, request))),
                Err(error) => answers[place] = Some(Err(error)),
            }
        }
        // Cells of one friction share a law, and so their lanes.
        while let Some(reduction) = prepared.first().map(|one: &PreparedTrial<S>| one.options.friction_reduction) {
            let alike = |one: &PreparedTrial<S>| one.options.friction_reduction.to_bits() == reduction.to_bits();
            let (group, others) = prepared.into_iter().partition::<Vec<_>, _>(alike);
            prepared = others;
            let places: Vec<usize> = group.iter().map(|one| one.place).collect();
            let solved = match self.reduce_friction(reduction) {
                Ok(()) => self.solve_side_by_side(group),
                Err(error) => places.iter().map(|_| Err(error.clone())).collect(),
            };
            for (answer, place) in solved.into_iter().zip(places) {
                answers[place] = Some(answer);
            }
        }
        answers.into_iter().map(|answer| answer.expect("every request has been answered")).collect()
    }

    /// Does something under the name of another definition with the same model.
    fn named<R>(&mut self, definition: DefinitionId, work: impl FnOnce(&mut Self) -> R) -> R {
        let own = std::mem::replace(&mut self.id, definition);
        let result = work(self);
        self.id = own;
        result
    }

    /// Answers several requests whose states have been read and whose targets are stretches, side by side.
    fn solve_side_by_side(&mut self, opened: Vec<PreparedTrial<S>>) -> Vec<TrialOutcome> {
        let started = Instant::now();
        let jobs: Vec<SolveJob<'_, S>> = opened
            .iter()
            .map(|one| SolveJob {
                state: &one.state,
                strain: one.stretch.polar.strain,
                ramp_steps: one.stretch.ramp_steps,
                counts_work: one.options.observables.contains(Observables::ENERGY),
            })
            .collect();
        let ends = self.solver.solve(&self.model, &jobs);
        // Nobody can tell whose time it was; evaluations are a fair key.
        let evaluations = |end: &Result<End<S>, RveError>| end.as_ref().map_or(0, |end| end.solved.force_evaluations);
        let all = ends.iter().map(evaluations).sum::<u64>().max(1) as f64;
        let spent = nanoseconds_since(started) as f64;
        let mut answers = Vec::with_capacity(opened.len());
        for (end, one) in ends.into_iter().zip(opened) {
            let share = (spent * evaluations(&end) as f64 / all) as u64;
            answers.push(end.and_then(|end| {
                self.committed = one.state;
                let answer = self.conclude(end, &one.stretch, &one.options, share);
                let mut state = Vec::new();
                self.named(one.definition, |rve| rve.snapshot_trial(&mut state))?;
                self.trial = None;
                Ok((answer, state))
            }));
        }
        answers
    }
}
