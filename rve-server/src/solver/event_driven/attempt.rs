//! One trial by linear responses: the stored one of the state if it holds, else Newton's method on the modes of the
//! contacts.
//!
//! The unknowns are the motions of all grains, the equations the balance of the exact contact forces after the whole
//! increment. A response is the derivative with every contact in its present mode (open, sticking, sliding). While no mode
//! changes, one step of it is an answer with a remainder of second order; where modes change, some steps find those of the
//! end.

use super::account::Spent;
use super::evaluation::{Evaluation, Motion, Start};
use super::near_pairs::{NearPairs, NearPairsMemory};
use crate::cell::{ContactRecord, GrainState, PairFinder, StoredResponse};
use crate::contact::{PlainLinear, Rotations};
use crate::definition::GrainModel;
use crate::solver::answered_by::AnsweredBy;
use crate::solver::grain_solver::{End, SolveJob, Solved};
use crate::solver::linear::{DiscMotions, LinearResponses};
use crate::solver::relaxation::Imbalance;
use crate::space::{Discs, Tensor, norm, rotated, transpose};
use std::sync::Arc;

/// Largest out-of-balance ratio of an answer, unless the tolerance is smaller. The error of the stress over the pressure is
/// a few per cent of it.
const LARGEST_UNBALANCED: f64 = 1e-4;

/// Newton's method goes on until this share of it.
const CONVERGED: f64 = 0.1;

/// Most factorisations of a trial.
const MOST_FACTORISATIONS: i32 = 8;

/// Factorisations without halving the least imbalance after which a trial is given up.
const MOST_IDLE: i32 = 4;

/// A grain whose contacts all press with less than this share of the mean contact force may be loose.
const WEAK: f64 = 1e-2;

/// Most times that loose grains are pushed aside after one motion.
const MOST_PUSHES: u32 = 4;

/// Largest motion of a grain, in mean radii, that a linear response may predict.
const LARGEST_MOTION: f64 = 1e-2;

/// Skin of the pair list in mean radii.
const SKIN: f64 = 0.05;

/// Why a trial is handed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GivenUp;

/// Working memory: nothing but speed depends on it.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    finder: PairFinder<Discs>,
    lists: NearPairsMemory,
}

/// An answer.
pub(super) struct Answered {
    pub(super) end: End<Discs>,
    pub(super) response: StoredResponse<Discs>,
}

/// Tries to answer a job; `spent` is counted up in any case.
pub(super) fn attempt(
    work: &mut Workspace,
    responses: &mut dyn LinearResponses,
    model: &GrainModel,
    law: &PlainLinear,
    job: &SolveJob<'_, Discs>,
    spent: &mut Spent,
) -> Result<Answered, GivenUp> {
    let stored = job.state.events.as_deref().and_then(|events| events.response.as_ref());
    if let Some(stored) = stored {
        let near = work.lists.of(&stored.pairs, model, law);
        let trial = Trial::new(model, law, job, near, stored.reach);
        match trial.solved(responses, Some(stored), spent) {
            Err(Stopped::ListEnds) => {}
            Err(Stopped::GivenUp) => return Err(GivenUp),
            Ok(answered) => return Ok(answered),
        }
    }
    let skin = SKIN * model.mean_radius();
    let mut pairs = Vec::new();
    work.finder.find(&job.state.cell, job.state.positions.iter().copied(), &model.radii, skin, &mut pairs);
    let near = work.lists.of(&Arc::new(pairs), model, law);
    let trial = Trial::new(model, law, job, near, skin);
    trial.solved(responses, stored, spent).map_err(|_| GivenUp)
}

/// Why a trial has no answer.
enum Stopped {
    /// Pairs that are not listed could touch.
    ListEnds,
    /// The modes of the contacts were not found.
    GivenUp,
}

struct Trial<'a> {
    model: &'a GrainModel,
    job: &'a SolveJob<'a, Discs>,
    start: Start<'a>,
    reach: f64,
}

impl<'a> Trial<'a> {
    fn new(
        model: &'a GrainModel,
        law: &'a PlainLinear,
        job: &'a SolveJob<'a, Discs>,
        near: Arc<NearPairs>,
        reach: f64,
    ) -> Self {
        let start = Start::of(law, job.state, near, model.rotations == Rotations::Free);
        Self { model, job, start, reach }
    }

    fn solved(
        &self,
        responses: &mut dyn LinearResponses,
        stored: Option<&StoredResponse<Discs>>,
        spent: &mut Spent,
    ) -> Result<Answered, Stopped> {
        let bound = self.model.options.tolerance().min(LARGEST_UNBALANCED);
        let mut motion = vec![[0.0; 3]; self.model.radii.len()];
        let mut columns = None;
        let mut evaluation = match stored {
            Some(stored) => {
                predict(&mut motion, stored, &self.job.strain);
                self.evaluate(&mut motion, bound, spent)
            }
            None => {
                // The response of the committed state, with its own forces out of balance.
                let still = self.start.evaluate(&[[0.0; 2]; 2], &motion);
                spent.evaluations += 1;
                let found = self.motions(responses, &still, spent)?;
                step(&mut motion, &found, strains(&self.job.strain));
                columns = Some(found);
                self.evaluate(&mut motion, bound, spent)
            }
        };
        let mut unbalanced = self.imbalance(&evaluation).ratio;
        let mut answered_by = AnsweredBy::Events;
        if stored.is_some() && unbalanced <= bound {
            answered_by = AnsweredBy::Elastic;
        } else {
            let (mut least, mut idle) = (f64::INFINITY, 0);
            while !is_within(unbalanced, CONVERGED * bound) {
                idle = if unbalanced < 0.5 * least { 0 } else { idle + 1 };
                least = least.min(unbalanced);
                if idle >= MOST_IDLE || spent.factorisations >= MOST_FACTORISATIONS {
                    break;
                }
                let found = self.motions(responses, &evaluation, spent)?;
                step(&mut motion, &found, [0.0; 3]);
                columns = Some(found);
                evaluation = self.evaluate(&mut motion, bound, spent);
                unbalanced = self.imbalance(&evaluation).ratio;
            }
        }
        if !is_within(unbalanced, bound) {
            return Err(Stopped::GivenUp);
        }
        self.answered(evaluation, &motion, columns, stored, answered_by, spent)
    }

    /// The contacts after `motion`; loose grains that were met are pushed aside, if that is what balance needs.
    fn evaluate(&self, motion: &mut [Motion], bound: f64, spent: &mut Spent) -> Evaluation {
        spent.evaluations += 1;
        let evaluation = self.start.evaluate(&self.job.strain, motion);
        if self.imbalance(&evaluation).ratio <= bound {
            return evaluation;
        }
        let mean = evaluation.sums.normal_force / evaluation.sums.contacts.max(1.0);
        let (mut pushed, mut after) = (motion.to_vec(), None);
        for _ in 0..MOST_PUSHES {
            let present = after.as_ref().unwrap_or(&evaluation);
            if !self.start.free_loose_grains(present, &mut pushed, WEAK * mean, 0.1 * bound * mean) {
                break;
            }
            spent.evaluations += 1;
            after = Some(self.start.evaluate(&self.job.strain, &pushed));
        }
        match after {
            Some(after) if self.imbalance(&after).ratio < self.imbalance(&evaluation).ratio => {
                motion.copy_from_slice(&pushed);
                after
            }
            _ => evaluation,
        }
    }

    fn imbalance(&self, evaluation: &Evaluation) -> Imbalance {
        let (grains, largest) = (self.model.radii.len(), self.job.state.largest_load);
        Imbalance::by(self.model.options.criterion, grains, 0.0, &evaluation.sums, largest)
    }

    fn motions(
        &self,
        responses: &mut dyn LinearResponses,
        evaluation: &Evaluation,
        spent: &mut Spent,
    ) -> Result<DiscMotions, Stopped> {
        spent.factorisations += 1;
        let pairs = self.start.linear_pairs(evaluation);
        let (model, loads) = (self.model, &evaluation.loads);
        let free = model.rotations == Rotations::Free;
        let found = responses.motions(&model.radii, model.friction, free, &pairs, loads);
        found.ok_or(Stopped::GivenUp)
    }

    fn answered(
        &self,
        evaluation: Evaluation,
        motion: &[Motion],
        columns: Option<DiscMotions>,
        stored: Option<&StoredResponse<Discs>>,
        answered_by: AnsweredBy,
        spent: &Spent,
    ) -> Result<Answered, Stopped> {
        let (model, near) = (self.model, self.start.near());
        let farthest = motion.iter().map(|[x, y, _]| x * x + y * y).fold(0.0, f64::max).sqrt();
        if !is_within(farthest, LARGEST_MOTION * near.mean_radius) {
            return Err(Stopped::GivenUp);
        }
        let stretch = norm(&self.job.strain);
        let range = 2.0 * near.largest_radius + SKIN * near.mean_radius;
        let reach = self.reach - (2.0 * farthest * (1.0 + 2.0 * stretch) + stretch * range);
        if reach <= 0.0 {
            return Err(Stopped::ListEnds);
        }
        let imbalance = self.imbalance(&evaluation);
        let start = self.job.state;
        let load = evaluation.sums.normal_force;
        if !imbalance.bears(load, start.largest_load, model.options.tolerance()) {
            return Err(Stopped::GivenUp);
        }
        let (columns, frame) = match (columns, stored) {
            (Some(columns), _) => {
                let strains = columns.iter().flatten().flat_map(|[a, b, c, _]| [*a, *b, *c]);
                (Arc::new(strains.collect()), <[[f64; 2]; 2]>::IDENTITY)
            }
            (None, Some(stored)) => (Arc::clone(&stored.columns), stored.frame),
            (None, None) => return Err(Stopped::GivenUp),
        };
        let keys = &near.keys;
        let closed = keys.iter().enumerate().map(|(place, key)| (key, evaluation.pair(place)));
        let count = evaluation.sums.contacts as usize;
        let (mut contacts, mut slid) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (key, now) in closed.filter(|(_, now)| now.touches) {
            contacts.push(ContactRecord {
                origin: key.origin,
                end: key.end,
                shift: key.shift,
                tangential_force: now.tangential_force,
            });
            slid.push(now.slides);
        }
        let turned = start.rotations.iter().zip(motion).zip(&near.inverse_radii);
        let state = GrainState {
            cell: evaluation.cell,
            positions: evaluation.positions(),
            rotations: turned.map(|((before, motion), inverse_radius)| before + motion[2] * inverse_radius).collect(),
            contacts,
            rolling_moments: Vec::new(),
            operators: start.operators.clone(),
            dissipation: start.dissipation + evaluation.sums.dissipation + evaluation.sums.opening_loss,
            damping: start.damping,
            initial_measure: start.initial_measure,
            unbalanced: imbalance.ratio,
            largest_load: start.largest_load.max(load),
            bears_load: true,
            events: None,
        };
        let solved = Solved {
            force_evaluations: spent.evaluations.unsigned_abs().into(),
            ramp_steps: self.job.ramp_steps,
            unbalanced: imbalance.ratio,
            equilibrated: true,
            bears_load: true,
            changed_damping: false,
            answered_by,
            work: None,
            energies: None,
        };
        let response = StoredResponse { pairs: Arc::clone(keys), columns, frame, reach };
        Ok(Answered { end: End { solved, state, slid }, response })
    }
}

/// Whether a number is at most `bound`; false for NaN.
fn is_within(value: f64, bound: f64) -> bool {
    value <= bound
}

/// The strains 11, 22 and 12 of which the response has columns.
fn strains(strain: &[[f64; 2]; 2]) -> [f64; 3] {
    [strain[0][0], strain[1][1], strain[0][1] + strain[1][0]]
}

/// Adds the response to these strains and to the forces out of balance.
fn step(motion: &mut [Motion], found: &DiscMotions, [first, second, shear]: [f64; 3]) {
    for (motion, rows) in motion.iter_mut().zip(found) {
        for (value, row) in motion.iter_mut().zip(rows) {
            *value += row[0] * first + row[1] * second + row[2] * shear + row[3];
        }
    }
}

/// The motion that a stored response gives.
fn predict(motion: &mut [Motion], stored: &StoredResponse<Discs>, strain: &[[f64; 2]; 2]) {
    let [first, second, shear] = strains(&rotated(strain, &transpose(&stored.frame)));
    for (motion, columns) in motion.iter_mut().zip(stored.columns.chunks_exact(9)) {
        let row = |unknown: usize| {
            let columns = &columns[3 * unknown..];
            columns[0] * first + columns[1] * second + columns[2] * shear
        };
        let (x, y) = (row(0), row(1));
        let frame = &stored.frame;
        *motion = [frame[0][0] * x + frame[0][1] * y, frame[1][0] * x + frame[1][1] * y, row(2)];
    }
}
