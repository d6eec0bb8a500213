//! The quasi-static solver: stretches cells in small increments while the grains relax, then holds each until its grains
//! are in equilibrium.
//!
//! The deformation is applied as the pure stretch `I + tau (U - I)`; the caller turns the result by the rotation. A solve
//! depends on the state, the stretch, the ramp count and the options only, to the last bit: not on the cells that are
//! solved beside it, the instructions of the processor, or the age of a pair list.

pub(crate) mod batch;
pub(crate) mod criterion;
pub(crate) mod damping;
mod headway;
#[cfg(test)]
mod kernel_tests;
mod listing;
mod run;
#[cfg(test)]
mod sample;
mod setting;
pub(crate) mod stiffness;
#[cfg(test)]
mod tests;

use crate::cell::Cell;
use crate::definition::{ContactTable, DefinitionError, Rotations};
use crate::lanes::{Contact, Grain, Kinematics, Lanes, Real, Steering, StepSums, Tuple, Wanted};
use crate::law::{AT_LIMIT, ContactLaw, ExtendedHertzMindlin, ExtendedLinear, PlainHertzMindlin, PlainLinear};
use crate::model::GrainModel;
use crate::network::{ContactNetwork, NetworkContact};
use crate::pairs::PairKey;
use crate::space::{Axial, Components, Space, Tensor, largest_component};
use crate::state::{ContactRecord, GrainState};
use batch::{Batch, LaneContents, branch_of};
use protocol::RveError;
use run::Run;
pub(crate) use run::Solved;
pub(crate) use setting::Setting;
use std::collections::VecDeque;
use std::fmt::Debug;

/// Fewest ramp increments that the engine chooses by itself.
const FEWEST_RAMP_STEPS: u32 = 5;

/// Cells side by side in a batch.
const LANES: usize = 8;

/// Fewer cells than this are faster one by one: a step of all lanes costs 3.0 (discs) to 3.9 (spheres) of a single cell with
/// AVX-512, 3.6 to 5.3 with AVX2.
const FEWEST_LANES: usize = 4;

/// Number of ramp increments for a strain, if the asker leaves the choice to the engine.
pub(crate) fn chosen_ramp_steps<T: Tensor>(strain: &T, strain_per_step: f64) -> u32 {
    let steps = (largest_component(strain) / strain_per_step).ceil();
    (steps.min(f64::from(u32::MAX)) as u32).max(FEWEST_RAMP_STEPS)
}

/// A stretch to be solved.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a, S: Space> {
    pub(crate) state: &'a GrainState<S>,
    /// `U - I`.
    pub(crate) strain: S::Tensor,
    /// Increments of the ramp; with 0 the state is evaluated as it is, and nothing moves.
    pub(crate) ramp_steps: u32,
}

/// The end of a solve.
#[derive(Clone, Debug, PartialEq)]
pub struct End<S: Space> {
    pub(crate) solved: Solved,
    pub(crate) state: GrainState<S>,
    /// Whether each contact of the state was at the friction limit in most samples of the second half of the ramp.
    pub(crate) slid: Vec<bool>,
}

/// A solver with its working memory. Nothing but speed depends on what it has done before.
#[derive(Clone, Debug)]
pub(crate) struct Relaxation<S: Space, C: ContactLaw<S::Kinematics>> {
    law: C,
    single: Option<Batch<S, C, f64>>,
    lanes: Option<Batch<S, C, Lanes<LANES>>>,
    last: Option<End<S>>,
    /// Whether several jobs are solved side by side.
    pub(crate) uses_lanes: bool,
    /// Another skin of the pair list than usual, in mean radii.
    pub(crate) skin_in_radii: Option<f64>,
}

/// The solver of one packing, whatever its contact law: one choice per trial, none per contact. It holds the end of its
/// last solve, look or adoption until the next one.
pub trait QuasiStatic<S: Space>: Debug + Send + Sync {
    /// Evaluates a state as it is: nothing moves. Returns the value of the equilibrium criterion, not finite where the
    /// forces are not.
    fn look(&mut self, model: &GrainModel, state: &GrainState<S>) -> f64;

    /// Stretches the state by `I + strain` in `ramp_steps` increments and relaxes it.
    ///
    /// # Errors
    /// [`RveError::NotFinite`], [`RveError::NotEquilibrated`].
    fn solve(
        &mut self,
        model: &GrainModel,
        state: &GrainState<S>,
        strain: &S::Tensor,
        ramp_steps: u32,
    ) -> Result<Solved, RveError>;

    /// Solves several jobs, side by side if there are enough of them. The bits are those of solving each alone.
    fn solve_all(&mut self, model: &GrainModel, jobs: &[Job<'_, S>]) -> Vec<Result<End<S>, RveError>>;

    /// Takes an end of [`solve_all`](Self::solve_all) for the last one.
    fn adopt(&mut self, end: End<S>);

    /// Whether several jobs are solved side by side.
    fn use_lanes(&mut self, uses_lanes: bool);

    /// The end state of the last solve or look; `state` is the one it started from.
    fn end_state(&self, state: &GrainState<S>, unbalanced: f64) -> GrainState<S>;

    /// The contacts of the last end, frozen.
    fn network(&self, model: &GrainModel) -> ContactNetwork<S>;

    /// Energy stored in the contacts of the last end, J.
    fn elastic_energy(&self, model: &GrainModel) -> f64;

    /// A solver for the same law without any working memory.
    fn another(&self) -> Box<dyn QuasiStatic<S>>;
}

/// The solver for a contact law. This is where laws are compiled: one kernel per kind of springs, with and without the
/// parts that most scenes do without. Called by [`Space::solver`] alone, so that no other crate compiles them again.
///
/// # Errors
/// A table that is not valid.
pub(crate) fn for_contact<S: Space>(contact: &ContactTable) -> Result<Box<dyn QuasiStatic<S>>, DefinitionError> {
    let parts = contact.parts();
    let is_extended = parts.is_extended();
    Ok(match parts.hertz_springs() {
        Some(springs) if is_extended => Box::new(Relaxation::<S, ExtendedHertzMindlin>::new(parts.law(springs))),
        Some(springs) => Box::new(Relaxation::<S, PlainHertzMindlin>::new(parts.law(springs))),
        None if is_extended => Box::new(Relaxation::<S, ExtendedLinear>::new(parts.law(parts.linear_springs()?))),
        None => Box::new(Relaxation::<S, PlainLinear>::new(parts.law(parts.linear_springs()?))),
    })
}

impl<S: Space, C: ContactLaw<S::Kinematics>> QuasiStatic<S> for Relaxation<S, C> {
    fn look(&mut self, model: &GrainModel, state: &GrainState<S>) -> f64 {
        let solved = self.solve(model, state, &S::Tensor::ZERO, 0);
        solved.map_or(f64::NAN, |solved| solved.unbalanced)
    }

    fn solve(
        &mut self,
        model: &GrainModel,
        state: &GrainState<S>,
        strain: &S::Tensor,
        ramp_steps: u32,
    ) -> Result<Solved, RveError> {
        let job = Job { state, strain: *strain, ramp_steps };
        let end = self.solve_all(model, &[job]).pop().expect("one job, one end")?;
        let solved = end.solved;
        self.last = Some(end);
        Ok(solved)
    }

    fn solve_all(&mut self, model: &GrainModel, jobs: &[Job<'_, S>]) -> Vec<Result<End<S>, RveError>> {
        let law = self.law;
        self.solve_in(&Setting::of(model, &law), jobs)
    }

    fn adopt(&mut self, end: End<S>) {
        self.last = Some(end);
    }

    fn use_lanes(&mut self, uses_lanes: bool) {
        self.uses_lanes = uses_lanes;
    }

    fn end_state(&self, _: &GrainState<S>, unbalanced: f64) -> GrainState<S> {
        GrainState { unbalanced, ..self.last().state.clone() }
    }

    fn network(&self, model: &GrainModel) -> ContactNetwork<S> {
        frozen(model, &self.law, self.last())
    }

    fn elastic_energy(&self, model: &GrainModel) -> f64 {
        let state = &self.last().state;
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

    fn another(&self) -> Box<dyn QuasiStatic<S>> {
        Box::new(Self { uses_lanes: self.uses_lanes, ..Self::new(self.law) })
    }
}

impl<S: Space, C: ContactLaw<S::Kinematics>> Relaxation<S, C> {
    /// A solver for a law, without any working memory.
    pub(crate) fn new(law: C) -> Self {
        Self { law, single: None, lanes: None, last: None, uses_lanes: true, skin_in_radii: None }
    }

    fn last(&self) -> &End<S> {
        self.last.as_ref().expect("something has been solved or looked at")
    }
}

/// A job under way in a lane.
struct Ride<S: Space> {
    job: usize,
    run: Run<S>,
}

impl<S: Space, C: ContactLaw<S::Kinematics>> Relaxation<S, C> {
    /// As [`QuasiStatic::solve_all`].
    pub(crate) fn solve_in(
        &mut self,
        setting: &Setting<'_, C>,
        jobs: &[Job<'_, S>],
    ) -> Vec<Result<End<S>, RveError>> {
        let mut setting = *setting;
        if let Some(skin) = self.skin_in_radii {
            setting.skin = skin * setting.mean_radius;
        }
        let mut ends: Vec<Option<Result<End<S>, RveError>>> = jobs.iter().map(|_| None).collect();
        // The longest first: what is short fills the gaps at the end.
        let mut order: Vec<usize> = (0..jobs.len()).collect();
        order.sort_by_key(|job| std::cmp::Reverse(jobs[*job].ramp_steps));
        let mut queue: VecDeque<(Ride<S>, LaneContents<S, C>)> = VecDeque::new();
        for job in order {
            let run = Run::new(&jobs[job]);
            queue.push_back((Ride { job, run }, contents(&setting, jobs[job].state)));
        }
        let mut finish = |ride: Ride<S>, outcome: Result<Solved, RveError>, lane: LaneContents<S, C>| {
            let end = outcome.map(|solved| end_of(setting.law, jobs[ride.job].state, &ride.run, solved, lane));
            ends[ride.job] = Some(end);
        };
        if self.uses_lanes && jobs.len() >= FEWEST_LANES {
            let batch = self.lanes.get_or_insert_with(|| Batch::new(&setting));
            drive(batch, &setting, &mut queue, FEWEST_LANES, &mut finish);
        }
        let batch = self.single.get_or_insert_with(|| Batch::new(&setting));
        drive(batch, &setting, &mut queue, 1, &mut finish);
        ends.into_iter().map(|end| end.expect("every job has been driven to its end")).collect()
    }
}

/// Drives the jobs of the queue through the lanes of a batch until fewer than `fewest` are left, which go back to the
/// queue as they are.
fn drive<S: Space, C: ContactLaw<S::Kinematics>, R: Real>(
    batch: &mut Batch<S, C, R>,
    setting: &Setting<'_, C>,
    queue: &mut VecDeque<(Ride<S>, LaneContents<S, C>)>,
    fewest: usize,
    finish: &mut impl FnMut(Ride<S>, Result<Solved, RveError>, LaneContents<S, C>),
) {
    let mut rides: Vec<Option<Ride<S>>> = (0..R::LANES).map(|_| None).collect();
    loop {
        for (lane, place) in rides.iter_mut().enumerate().filter(|(_, place)| place.is_none()) {
            let Some((ride, contents)) = queue.pop_front() else { break };
            batch.put(setting, lane, &contents);
            *place = Some(ride);
        }
        if rides.iter().flatten().count() < fewest {
            break;
        }
        let evaluated = step(batch, setting, &mut rides);
        for (lane, place) in rides.iter_mut().enumerate() {
            let Some(ride) = place else { continue };
            let (sums, old_power) = (evaluated.sums.lane(lane), evaluated.old_power.lane(lane));
            if let Some(outcome) = ride.run.note(setting, &sums, old_power) {
                let ride = place.take().expect("the lane is occupied");
                finish(ride, outcome, batch.take(lane));
            }
        }
    }
    for (lane, place) in rides.iter_mut().enumerate() {
        if let Some(ride) = place.take() {
            queue.push_back((ride, batch.take(lane)));
        }
    }
}

/// Sums of one step of all lanes.
struct Evaluated<R: Real> {
    sums: StepSums<R>,
    old_power: R,
}

/// One step of every lane: move, renew the pair lists that are due, evaluate.
fn step<S: Space, C: ContactLaw<S::Kinematics>, R: Real>(
    batch: &mut Batch<S, C, R>,
    setting: &Setting<'_, C>,
    rides: &mut [Option<Ride<S>>],
) -> Evaluated<R> {
    let options = setting.options;
    let mut steering = Steering::<S::Kinematics, R> {
        affine: [Tuple::zero(); 3],
        keep: R::default(),
        push: R::default(),
        local: options.local_share(),
    };
    let mut sampling = R::default();
    let mut wanted = Wanted { old_power: options.needs_old_power(), ..criterion::wanted_by(options.criterion) };
    let mut cells = vec![None; R::LANES];
    for (lane, ride) in rides.iter_mut().enumerate() {
        let Some(ride) = ride else { continue };
        let next = ride.run.next_move(setting, batch, lane);
        wanted.old_power |= ride.run.needs_old_power();
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
        cells[lane] = Some(next.cell);
    }
    let moved = batch.advance(setting, &steering, wanted);
    for (lane, cell) in cells.into_iter().enumerate() {
        if let Some(cell) = cell {
            batch.follow(setting, lane, cell, moved.farthest_square.lane(lane).sqrt());
        }
    }
    Evaluated { sums: batch.evaluate(setting, wanted, sampling), old_power: moved.old_power }
}

/// A state as a lane holds it. Contacts get their force back, and their direction as the kernel would compute it, so
/// that the first evaluation sees a turn of exactly zero.
fn contents<S: Space, C: ContactLaw<S::Kinematics>>(
    setting: &Setting<'_, C>,
    state: &GrainState<S>,
) -> LaneContents<S, C> {
    // Adding zero makes a negative zero positive, which a step without motion would do as well.
    let grains: Vec<Grain<S::Kinematics, f64>> = state
        .positions
        .iter()
        .map(|position| Grain::at_rest(S::Vector::from_fn(|axis| position[axis] + 0.0)))
        .collect();
    let contacts = state.contacts.iter().enumerate().filter_map(|(place, record)| {
        let (origin, end) = (&grains[record.origin as usize], &grains[record.end as usize]);
        let image = state.cell.translation(record.shift);
        let (branch, length) = branch_of::<S::Kinematics>(origin.position, end.position, image);
        let radii = [setting.radii[record.origin as usize], setting.radii[record.end as usize]];
        let overlap = (radii[0] + radii[1]) - length;
        if overlap.is_nan() || overlap <= 0.0 {
            return None;
        }
        let direction = branch.times(1.0 / length);
        let tangential_force = S::to_axial(record.tangential_force, direction);
        let memory = setting.law.resumed(overlap, rolling_moment(state, place));
        Some((record.key(), Contact { direction, tangential_force, memory }, 0.0))
    });
    let contacts: Vec<(PairKey<S>, Contact<S::Kinematics, C, f64>, f64)> = contacts.collect();
    LaneContents { contacts, grains, listing: None, cell: Cell { rows: state.cell.rows } }
}

/// What a lane holds at the end of a run, as a state.
fn end_of<S: Space, C: ContactLaw<S::Kinematics>>(
    law: &C,
    start: &GrainState<S>,
    run: &Run<S>,
    solved: Solved,
    lane: LaneContents<S, C>,
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
        initial_measure: start.initial_measure,
        unbalanced: solved.unbalanced,
        largest_load: run.largest_load(),
        bears_load: solved.bears_load,
    };
    End { solved, state, slid }
}

/// The contacts of an end as a network.
fn frozen<S: Space, C: ContactLaw<S::Kinematics>>(model: &GrainModel, law: &C, end: &End<S>) -> ContactNetwork<S> {
    let state = &end.state;
    let ends = state.contacts.iter().zip(&end.slid).enumerate();
    let contacts = ends.map(|(place, (contact, slid))| {
        let radii = [model.radii[contact.origin as usize], model.radii[contact.end as usize]];
        let constants = law.constants(radii);
        let (_, overlap) = geometry(state, contact, radii);
        let [normal_stiffness, tangential_stiffness, rolling_stiffness] = law.stiffness(&constants, overlap);
        let moment = S::Kinematics::length(rolling_moment(state, place));
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
