//! The quasi-static solver: stretches cells in small increments while the grains relax, then holds each until its grains
//! are in equilibrium.
//!
//! The deformation is applied as the pure stretch `I + tau (U - I)`; the caller turns the result by the rotation. A solve
//! depends on the state, the stretch, the ramp count and the options only, to the last bit: not on the cells that are
//! solved next to it, the instructions of the processor, or the age of a pair list.

mod batch;
mod convergence;
mod criterion;
mod damping;
#[cfg(test)]
mod kernel_tests;
mod lane_access;
mod neighbour_list;
mod neighbour_list_memory;
mod run;
#[cfg(test)]
mod sample;
mod setting;
mod stiffness;
#[cfg(test)]
mod tests;

use super::grain_solver::{End, GrainSolver, SolveJob, Solved};
use super::kernel::backend::Backend;
use super::kernel::{Contact, Grain, Steering, StepSums, Wanted};
use crate::cell::{Cell, ContactNetwork, ContactRecord, GrainState, NetworkContact};
use crate::contact::{AT_LIMIT, ContactLaw, ContactLaws, ContactTable, LawVisitor, Rotations};
use crate::definition::GrainModel;
use crate::error::DefinitionError;
use crate::simd::{Lanes, Real, Tuple};
use crate::space::{Axial, Components, KernelSpace, Space};
pub(crate) use convergence::{Advice, ConvergenceMonitor};
pub(crate) use criterion::{Imbalance, LEAST_LOAD, holds_together_far_from_rest};
pub(crate) use damping::descent_share;

use batch::{Batch, CellInLane, Passage};
use lane_access::branch_of;
use protocol::RveError;
use run::Run;
use setting::Setting;
use std::collections::VecDeque;
use std::marker::PhantomData;

/// Cells side by side in a batch.
const LANES: usize = 8;

/// Fewer cells than this are faster one by one: a step of all lanes costs 3.0 (discs) to 3.9 (spheres) of a single cell with
/// AVX-512, 3.6 to 5.3 with AVX2.
const FEWEST_LANES: usize = 4;

/// Cells that are solved side by side on this processor.
pub(crate) fn side_by_side() -> u32 {
    if Backend::best().has_lanes() { LANES as u32 } else { 1 }
}

/// A solver with its working memory. Nothing but speed depends on what it has done before.
#[derive(Clone, Debug)]
pub(crate) struct RelaxationSolver<S: Space, C: ContactLaw<S::Kernel>> {
    law: C,
    single: Option<Batch<S, C, f64>>,
    lanes: Option<Batch<S, C, Lanes<LANES>>>,
    /// Whether several jobs are solved side by side.
    pub(crate) uses_lanes: bool,
    /// Whether work and damping are summed up.
    counts_energies: bool,
    /// Another skin of the pair list than usual, in mean radii.
    pub(crate) skin_in_radii: Option<f64>,
}

/// The relaxation solver for the law that a table chooses.
///
/// # Errors
/// A table that is not valid.
pub(super) fn for_contact<S: Space<Kernel: ContactLaws>>(
    contact: &ContactTable,
) -> Result<Box<dyn GrainSolver<S>>, DefinitionError> {
    contact.compile::<S::Kernel, _>(ForLaw(PhantomData))
}

/// Builds the solver for a law.
struct ForLaw<S>(PhantomData<S>);

impl<S: Space> LawVisitor<S::Kernel> for ForLaw<S> {
    type Output = Box<dyn GrainSolver<S>>;

    fn visit<C: ContactLaw<S::Kernel>>(self, law: C) -> Self::Output {
        Box::new(RelaxationSolver::<S, C>::new(law))
    }
}

impl<S: Space, C: ContactLaw<S::Kernel>> GrainSolver<S> for RelaxationSolver<S, C> {
    fn solve(&mut self, model: &GrainModel, jobs: &[SolveJob<'_, S>]) -> Vec<Result<End<S>, RveError>> {
        let law = self.law;
        self.solve_in(&Setting::of(model, &law), jobs)
    }

    fn network(&self, model: &GrainModel, end: &End<S>) -> ContactNetwork<S> {
        frozen(model, &self.law, end)
    }

    fn elastic_energy(&self, model: &GrainModel, state: &GrainState<S>) -> f64 {
        let mut stored = 0.0;
        for (place, contact) in state.contacts.iter().enumerate() {
            let radii = [model.radii[contact.origin as usize], model.radii[contact.end as usize]];
            let (_, overlap) = geometry(state, contact, radii);
            let constants = self.law.constants(radii);
            let memory = self.law.resumed(overlap, rolling_moment(state, place));
            let force = contact.tangential_force.norm();
            stored += self.law.energy(&constants, overlap, force, &memory);
        }
        stored
    }

    fn use_lanes(&mut self, uses_lanes: bool) {
        self.uses_lanes = uses_lanes;
    }

    fn count_energies(&mut self, counts: bool) {
        self.counts_energies = counts;
    }

    fn new_instance(&self) -> Box<dyn GrainSolver<S>> {
        Box::new(Self { uses_lanes: self.uses_lanes, counts_energies: self.counts_energies, ..Self::new(self.law) })
    }
}

impl<S: Space, C: ContactLaw<S::Kernel>> RelaxationSolver<S, C> {
    /// A solver for a law, without any working memory.
    pub(crate) fn new(law: C) -> Self {
        Self { law, single: None, lanes: None, uses_lanes: true, counts_energies: false, skin_in_radii: None }
    }
}

/// A job on its way through the lanes.
struct LaneJob<S: Space, C: ContactLaw<S::Kernel>> {
    /// Its number among the jobs.
    job: usize,
    run: Run<S>,
    /// The cell after the present step.
    cell: Cell<S>,
    /// What goes into the lane and comes out of it.
    contents: CellInLane<S, C>,
}

/// All jobs: those that wait, and the ends of the others.
struct Jobs<'a, S: Space, C: ContactLaw<S::Kernel>> {
    given: &'a [SolveJob<'a, S>],
    /// Numbers of those that have not begun.
    waiting: VecDeque<usize>,
    /// Those that have left the lanes before their end.
    interrupted: VecDeque<LaneJob<S, C>>,
    ends: Vec<Option<Result<End<S>, RveError>>>,
    /// Memory of jobs that have ended.
    spare: Vec<CellInLane<S, C>>,
}

impl<'a, S: Space, C: ContactLaw<S::Kernel>> Jobs<'a, S, C> {
    fn new(given: &'a [SolveJob<'a, S>]) -> Self {
        // The longest first: what is short fills the gaps at the end.
        let mut order: Vec<usize> = (0..given.len()).collect();
        order.sort_by_key(|job| std::cmp::Reverse(given[*job].ramp_steps));
        let ends = given.iter().map(|_| None).collect();
        Self { given, waiting: order.into(), interrupted: VecDeque::new(), ends, spare: Vec::new() }
    }

    /// Number of those that are in no lane and have not ended.
    fn outside(&self) -> usize {
        self.waiting.len() + self.interrupted.len()
    }

    /// The next one for a lane.
    fn next(&mut self, setting: &Setting<'_, C>) -> Option<LaneJob<S, C>> {
        let Some(job) = self.waiting.pop_front() else { return self.interrupted.pop_front() };
        let state = self.given[job].state;
        let mut contents = self.spare.pop().unwrap_or_default();
        fill(&mut contents, setting, state);
        Some(LaneJob { job, run: Run::new(&self.given[job]), cell: state.cell, contents })
    }

    fn finish(&mut self, law: &C, lane_job: LaneJob<S, C>, outcome: Result<Solved, RveError>) {
        let LaneJob { job, run, contents, .. } = lane_job;
        self.ends[job] = Some(outcome.map(|solved| end_of(law, self.given[job].state, &run, solved, &contents)));
        self.spare.push(contents);
    }
}

impl<S: Space, C: ContactLaw<S::Kernel>> RelaxationSolver<S, C> {
    /// As [`GrainSolver::solve`].
    pub(crate) fn solve_in(
        &mut self,
        setting: &Setting<'_, C>,
        jobs: &[SolveJob<'_, S>],
    ) -> Vec<Result<End<S>, RveError>> {
        let mut setting = Setting { counts_energies: self.counts_energies, ..*setting };
        if let Some(skin) = self.skin_in_radii {
            setting.skin = skin * setting.mean_radius;
        }
        let mut jobs = Jobs::new(jobs);
        if self.uses_lanes && setting.backend.has_lanes() {
            let batch = self.lanes.get_or_insert_with(|| Batch::new(&setting));
            drive(batch, &setting, &mut jobs, FEWEST_LANES);
        }
        let batch = self.single.get_or_insert_with(|| Batch::new(&setting));
        drive(batch, &setting, &mut jobs, 1);
        jobs.ends.into_iter().map(|end| end.expect("every job has been driven to its end")).collect()
    }
}

/// Drives the jobs through the lanes of a batch until fewer than `fewest` are left, which leave as they are.
fn drive<S: Space, C: ContactLaw<S::Kernel>, R: Real>(
    batch: &mut Batch<S, C, R>,
    setting: &Setting<'_, C>,
    jobs: &mut Jobs<'_, S, C>,
    fewest: usize,
) {
    let mut lane_jobs: Vec<Option<LaneJob<S, C>>> = (0..R::LANES).map(|_| None).collect();
    while lane_jobs.iter().flatten().count() + jobs.outside() >= fewest {
        let mut arrived = Vec::with_capacity(R::LANES);
        for (lane, place) in lane_jobs.iter_mut().enumerate().filter(|(_, place)| place.is_none()) {
            let Some(lane_job) = jobs.next(setting) else { break };
            *place = Some(lane_job);
            arrived.push(lane);
        }
        if !arrived.is_empty() {
            batch.put(setting, &mut passages(&mut lane_jobs, |lane| arrived.contains(&lane)));
        }
        let evaluated = step(batch, setting, &mut lane_jobs);
        let mut outcomes: Vec<Option<Result<Solved, RveError>>> = Vec::with_capacity(R::LANES);
        for (lane, place) in lane_jobs.iter_mut().enumerate() {
            let (sums, old_power) = (evaluated.sums.lane(lane), evaluated.old_power.lane(lane));
            outcomes.push(place.as_mut().and_then(|lane_job| lane_job.run.note(setting, &sums, old_power)));
        }
        if outcomes.iter().flatten().next().is_some() {
            batch.take(&mut passages(&mut lane_jobs, |lane| outcomes[lane].is_some()));
        }
        for (place, outcome) in lane_jobs.iter_mut().zip(outcomes) {
            if let Some((lane_job, outcome)) = outcome.and_then(|outcome| Some((place.take()?, outcome))) {
                jobs.finish(setting.law, lane_job, outcome);
            }
        }
    }
    batch.take(&mut passages(&mut lane_jobs, |_| true));
    jobs.interrupted.extend(lane_jobs.into_iter().flatten());
}

/// The occupied lanes that are chosen, with what goes through them.
fn passages<'a, S: Space, C: ContactLaw<S::Kernel>>(
    lane_jobs: &'a mut [Option<LaneJob<S, C>>],
    chosen: impl Fn(usize) -> bool,
) -> Vec<Passage<'a, S, C>> {
    let occupied = lane_jobs.iter_mut().enumerate().filter_map(|(lane, place)| Some((lane, place.as_mut()?)));
    occupied.filter(|(lane, _)| chosen(*lane)).map(|(lane, job)| (lane, &mut job.contents)).collect()
}

/// Sums of one step of all lanes.
struct Evaluated<R: Real> {
    sums: StepSums<R>,
    old_power: R,
}

/// One step of every lane: move, renew the pair lists that are due, evaluate.
fn step<S: Space, C: ContactLaw<S::Kernel>, R: Real>(
    batch: &mut Batch<S, C, R>,
    setting: &Setting<'_, C>,
    lane_jobs: &mut [Option<LaneJob<S, C>>],
) -> Evaluated<R> {
    let options = setting.options;
    let mut steering = Steering::<S::Kernel, R> {
        affine: [Tuple::zero(); 3],
        keep: R::default(),
        push: R::default(),
        local: options.local_share(),
    };
    let mut sampling = R::default();
    let mut wanted = Wanted {
        old_power: options.needs_old_power() || setting.counts_energies,
        virial: setting.counts_energies,
        blocked: !setting.rotations_free,
        ..criterion::wanted_by(options.criterion)
    };
    look_at_stiffness(batch, setting, lane_jobs);
    for (lane, lane_job) in lane_jobs.iter_mut().enumerate() {
        let Some(lane_job) = lane_job else { continue };
        let needs_virial = lane_job.run.needs_virial();
        let next = lane_job.run.next_move(setting, batch.cell(lane));
        wanted.old_power |= lane_job.run.needs_old_power();
        wanted.virial |= needs_virial;
        steering.keep.set_lane(lane, next.kick.keep);
        steering.push.set_lane(lane, next.kick.push);
        for (axis, row) in steering.affine.iter_mut().enumerate().take(S::DIMENSION) {
            for (place, value) in next.affine[axis].components().iter().enumerate() {
                row.as_mut()[place].set_lane(lane, *value);
            }
        }
        if next.clears_counts {
            batch.clear_limit_counts(lane);
        }
        if next.samples {
            sampling.set_lane(lane, 1.0);
            wanted.limit_counts = true;
        }
        lane_job.cell = next.cell;
    }
    let moved = batch.advance(setting, &steering, wanted);
    for (lane, lane_job) in lane_jobs.iter().enumerate() {
        if let Some(lane_job) = lane_job {
            batch.follow(setting, lane, lane_job.cell, moved.farthest_square.lane(lane).sqrt());
        }
    }
    Evaluated { sums: batch.evaluate(setting, wanted, sampling), old_power: moved.old_power }
}

/// Raises the masses of the cells whose contacts have to be looked at.
fn look_at_stiffness<S: Space, C: ContactLaw<S::Kernel>, R: Real>(
    batch: &mut Batch<S, C, R>,
    setting: &Setting<'_, C>,
    lane_jobs: &mut [Option<LaneJob<S, C>>],
) {
    let is_due = |lane_job: &LaneJob<S, C>| lane_job.run.needs_stiffness(setting);
    let places = lane_jobs.iter().enumerate();
    let due: Vec<usize> =
        places.filter(|(_, place)| place.as_ref().is_some_and(is_due)).map(|(lane, _)| lane).collect();
    if due.is_empty() {
        return;
    }
    let stiffness = batch.largest_own_stiffness(setting, &due);
    for lane in due {
        if let Some(lane_job) = &mut lane_jobs[lane] {
            lane_job.run.raise_mass(setting, stiffness.lane(lane));
        }
    }
}

/// Fills contents with a state as a lane holds it. Contacts get their force back, and their direction as the kernel would compute it, so
/// that the first evaluation sees a turn of exactly zero.
fn fill<S: Space, C: ContactLaw<S::Kernel>>(
    contents: &mut CellInLane<S, C>,
    setting: &Setting<'_, C>,
    state: &GrainState<S>,
) {
    let CellInLane { grains, contacts, neighbour_list, cell } = contents;
    (*neighbour_list, *cell) = (None, Cell { rows: state.cell.rows });
    grains.clear();
    // Adding zero makes a negative zero positive, which a step without motion would do as well.
    let at_rest = |position: &S::Vector| Grain::at_rest(S::Vector::from_fn(|axis| position[axis] + 0.0));
    grains.extend(state.positions.iter().map(at_rest));
    contacts.clear();
    contacts.reserve(state.contacts.len());
    contacts.extend(state.contacts.iter().enumerate().filter_map(|(place, record)| {
        let (origin, end) = (&grains[record.origin as usize], &grains[record.end as usize]);
        let image = state.cell.translation(record.shift);
        let (branch, length) = branch_of::<S::Kernel>(origin.position, end.position, image);
        let radii = [setting.radii[record.origin as usize], setting.radii[record.end as usize]];
        let overlap = (radii[0] + radii[1]) - length;
        if overlap.is_nan() || overlap <= 0.0 {
            return None;
        }
        let direction = branch.times(1.0 / length);
        let tangential_force = S::to_axial(record.tangential_force, direction);
        let memory = setting.law.resumed(overlap, rolling_moment(state, place));
        Some((record.key(), Contact { direction, tangential_force, memory }, 0.0))
    }));
}

/// Contents of a lane at the end of a run, as a state.
fn end_of<S: Space, C: ContactLaw<S::Kernel>>(
    law: &C,
    start: &GrainState<S>,
    run: &Run<S>,
    solved: Solved,
    lane: &CellInLane<S, C>,
) -> End<S> {
    let positions = lane.grains.iter().map(|grain| grain.position).collect();
    let turned = start.rotations.iter().zip(&lane.grains);
    let rotations = turned.map(|(before, grain)| Components::plus(*before, S::spin(grain.turned))).collect();
    let contacts = lane
        .contacts
        .iter()
        .map(|(key, contact, _)| ContactRecord {
            origin: key.origin,
            end: key.end,
            shift: key.shift,
            tangential_force: S::from_axial(contact.tangential_force, contact.direction),
        })
        .collect();
    let rolling = lane.contacts.iter().filter(|_| C::ROLLS);
    let rolling_moments = rolling.map(|(_, contact, _)| S::spin(law.rolling_moment(&contact.memory))).collect();
    let samples = f64::from(run.samples());
    let slid = lane.contacts.iter().map(|(_, _, count)| 2.0 * count > samples).collect();
    let state = GrainState {
        cell: lane.cell,
        positions,
        rotations,
        contacts,
        rolling_moments,
        operators: start.operators.clone(),
        dissipation: start.dissipation + run.dissipation,
        damping: start.damping,
        initial_measure: start.initial_measure,
        unbalanced: solved.unbalanced,
        largest_load: run.largest_load(),
        bears_load: solved.bears_load,
        events: None,
    };
    End { solved, state, slid }
}

/// The contacts of an end as a network.
fn frozen<S: Space, C: ContactLaw<S::Kernel>>(model: &GrainModel, law: &C, end: &End<S>) -> ContactNetwork<S> {
    let state = &end.state;
    let ends = state.contacts.iter().zip(&end.slid).enumerate();
    let contacts = ends.map(|(place, (contact, slid))| {
        let radii = [model.radii[contact.origin as usize], model.radii[contact.end as usize]];
        let constants = law.constants(radii);
        let (_, overlap) = geometry(state, contact, radii);
        let [normal_stiffness, tangential_stiffness, rolling_stiffness] = law.stiffness(&constants, overlap);
        let moment = S::Kernel::length(rolling_moment(state, place));
        let rolls_on = moment >= AT_LIMIT * law.rolling_limit(&constants, overlap);
        NetworkContact {
            origin: contact.origin,
            end: contact.end,
            shift: contact.shift,
            normal_stiffness,
            tangential_stiffness,
            rolling_stiffness: if rolls_on { 0.0 } else { rolling_stiffness },
            normal_force: law.normal_force(&constants, overlap),
            tangential_force: contact.tangential_force,
            slid: *slid,
            at_limit: contact.tangential_force.norm() >= AT_LIMIT * law.friction_limit(&constants, overlap),
        }
    });
    ContactNetwork {
        cell: state.cell.rows,
        thickness: model.thickness,
        positions: state.positions.clone(),
        radii: model.radii.clone(),
        rotations_free: model.rotations == Rotations::Free,
        friction: model.friction,
        contacts: contacts.collect(),
    }
}

/// Branch vector and overlap of a contact of a state, m.
fn geometry<S: Space>(state: &GrainState<S>, contact: &ContactRecord<S>, radii: [f64; 2]) -> (S::Vector, f64) {
    let (origin, end) = (state.positions[contact.origin as usize], state.positions[contact.end as usize]);
    let branch = Components::plus(Components::minus(end, origin), state.cell.translation(contact.shift));
    (branch, (radii[0] + radii[1]) - branch.norm())
}

/// Rolling moment of a contact of a state, N m; zero for laws without.
fn rolling_moment<S: Space>(state: &GrainState<S>, place: usize) -> Axial<S> {
    S::axial(state.rolling_moments.get(place).copied().unwrap_or(S::Spin::ZERO))
}
