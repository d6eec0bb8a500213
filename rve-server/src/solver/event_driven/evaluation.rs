//! One exact evaluation of all contacts after a given motion of the grains: geometry, springs, friction, and what is left
//! out of balance. Nothing is linearised here, so that the residual is the whole error of a predicted motion.

use super::near_pairs::{GroupConstants, NearPairs, Packed, WIDTH};
use crate::cell::{Cell, GrainState};
use crate::contact::{ContactLaw, ContactMotion, ContactResponse, PlainLinear};
use crate::simd::{LaneMask, Mask, Real, Tuple, Vectorised, dispatch};
use crate::solver::kernel::{Contact, ListedPair, PairSite, StepSums, Wanted, pair_forces};
use crate::solver::linear::DiscPair;
use crate::space::{Discs, add_scaled};
use std::sync::Arc;

/// Gap that a loose grain is left with when it is pushed away, over the distance of the centres.
const FREE_GAP: f64 = 3e-5;

/// Motion of a grain besides the affine one: two displacements and its spin times its radius, m.
pub(super) type Motion = [f64; 3];

/// Near pairs at the committed state.
type History = Contact<Discs, PlainLinear, Packed>;

/// Near pairs after the motion; masks are 1 where they hold.
#[derive(Clone, Copy, Debug, Default)]
struct GroupNow {
    branch: [Packed; 2],
    length: Packed,
    touches: Packed,
    normal_force: Packed,
    tangential_force: Packed,
    slides: Packed,
}

/// A near pair after the motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairNow {
    pub(super) branch: [f64; 2],
    pub(super) length: f64,
    pub(super) touches: bool,
    /// N; negative in compression.
    pub(super) normal_force: f64,
    /// N, along the tangent.
    pub(super) tangential_force: f64,
    /// Whether friction has cut the tangential force.
    pub(super) slides: bool,
}

/// The committed state as the evaluations of one trial need it.
#[derive(Debug)]
pub(super) struct Start<'a> {
    pub(super) state: &'a GrainState<Discs>,
    law: &'a PlainLinear,
    rotations_free: bool,
    near: Arc<NearPairs>,
    histories: Vec<History>,
}

/// All contacts after a motion.
#[derive(Debug)]
pub(super) struct Evaluation {
    pub(super) cell: Cell<Discs>,
    /// Position, m, spin, rad, and a zero of each grain, so that one load brings all.
    grains: Vec<[f64; 4]>,
    /// Force out of balance and moment over radius of each grain, N.
    pub(super) loads: Vec<[f64; 3]>,
    pub(super) sums: StepSums<f64>,
    groups: Vec<GroupNow>,
}

impl Evaluation {
    /// Positions of the grains, m.
    pub(super) fn positions(&self) -> Vec<[f64; 2]> {
        self.grains.iter().map(|[x, y, ..]| [*x, *y]).collect()
    }

    /// A near pair, by its place in the list.
    pub(super) fn pair(&self, place: usize) -> PairNow {
        let (group, lane) = (&self.groups[place / WIDTH], place % WIDTH);
        PairNow {
            branch: group.branch.map(|value| value.lane(lane)),
            length: group.length.lane(lane),
            touches: group.touches.lane(lane) > 0.0,
            normal_force: group.normal_force.lane(lane),
            tangential_force: group.tangential_force.lane(lane),
            slides: group.slides.lane(lane) > 0.0,
        }
    }
}

impl<'a> Start<'a> {
    /// With these near pairs; they must hold every contact of the state.
    pub(super) fn of(
        law: &'a PlainLinear,
        state: &'a GrainState<Discs>,
        near: Arc<NearPairs>,
        rotations_free: bool,
    ) -> Self {
        let histories = dispatch(Histories { state, near: &near });
        Self { state, law, rotations_free, near, histories }
    }

    /// The near pairs.
    pub(super) fn near(&self) -> &NearPairs {
        &self.near
    }

    /// The contacts after the stretch `I + strain` and `motion`.
    pub(super) fn evaluate(&self, strain: &[[f64; 2]; 2], motion: &[Motion]) -> Evaluation {
        dispatch(Contacts { start: self, strain, motion })
    }

    /// Pushes every loose grain that is out of balance by more than `threshold`, N, away from what it touches, and a little
    /// farther. A grain is loose if none of its contacts presses with more than `weak`, N. Returns whether any was moved.
    ///
    /// Statics does not say where such a grain is. That it carried nothing shows afterwards: the forces on the grains round it
    /// must be in balance without it. With cohesion it does not show: a grain may hang on bonds that carry nothing, and a push would break
    /// them. Then none is moved.
    pub(super) fn free_loose_grains(
        &self,
        evaluation: &Evaluation,
        motion: &mut [Motion],
        weak: f64,
        threshold: f64,
    ) -> bool {
        if self.law.cohesion > 0.0 {
            return false;
        }
        let mut strongest = vec![0.0_f64; motion.len()];
        let listed =
            || self.near.listed.iter().enumerate().map(|(place, pair)| (place, pair, evaluation.pair(place)));
        let touching = || listed().filter(|(.., now)| now.touches);
        for (_, pair, now) in touching() {
            for grain in [pair.origin as usize, pair.end as usize] {
                strongest[grain] = strongest[grain].max(now.normal_force.abs());
            }
        }
        let is_moved: Vec<bool> = strongest
            .iter()
            .zip(&evaluation.loads)
            .map(|(strongest, [x, y, turn])| *strongest <= weak && x.hypot(*y).max(turn.abs()) > threshold)
            .collect();
        for (place, pair, now) in touching() {
            let grains = [pair.origin as usize, pair.end as usize];
            let shared = if is_moved[grains[0]] && is_moved[grains[1]] { 0.5 } else { 1.0 };
            let ([first, second], _) = self.near.constants(place);
            let way = shared * ((first + second) * (1.0 + FREE_GAP) - now.length) / now.length;
            for (grain, sign) in grains.into_iter().zip([-1.0, 1.0]) {
                if is_moved[grain] {
                    motion[grain][0] += sign * way * now.branch[0];
                    motion[grain][1] += sign * way * now.branch[1];
                }
            }
        }
        is_moved.contains(&true)
    }

    /// The near pairs of an evaluation, for the linear equations. Open pairs are among them, so that the order of
    /// elimination holds for as long as the list does.
    pub(super) fn linear_pairs(&self, evaluation: &Evaluation) -> Vec<DiscPair> {
        let linear = |(place, pair): (usize, &ListedPair)| {
            let now = evaluation.pair(place);
            let ([first, second], constants) = self.near.constants(place);
            let [normal, tangential, _] =
                ContactLaw::<Discs>::stiffness(self.law, &constants, first + second - now.length);
            DiscPair {
                origin: pair.origin as usize,
                end: pair.end as usize,
                touches: now.touches,
                branch: now.branch,
                length: now.length,
                stiffness: [normal, tangential],
                normal_force: now.normal_force,
                tangential_force: now.tangential_force,
                slides: now.slides,
            }
        };
        self.near.listed.iter().enumerate().map(linear).collect()
    }
}

/// What the near pairs were at the committed state.
struct Histories<'a> {
    state: &'a GrainState<Discs>,
    near: &'a NearPairs,
}

impl Vectorised for Histories<'_> {
    type Output = Vec<History>;

    #[inline(always)]
    fn run(self) -> Vec<History> {
        let Self { state, near } = self;
        let images = near.images(&state.cell);
        let mut histories = vec![History::none(); near.groups.len()];
        let mut records = state.contacts.iter();
        let mut next = records.next();
        let pairs = near.keys.chunks(WIDTH).zip(near.listed.chunks(WIDTH));
        for (history, (keys, pairs)) in histories.iter_mut().zip(pairs) {
            // Branch vectors at first. Pairs without a record are infinitely far apart.
            history.direction = [Packed::splat(f64::INFINITY); 2];
            for (lane, (key, pair)) in keys.iter().zip(pairs).enumerate() {
                while next.is_some_and(|record| record.key() < *key) {
                    next = records.next();
                }
                let Some(record) = next.filter(|record| record.key() == *key) else { continue };
                next = records.next();
                history.tangential_force[0].set_lane(lane, record.tangential_force);
                let (origin, end) = (&state.positions[pair.origin as usize], &state.positions[pair.end as usize]);
                let image = &images[pair.image as usize];
                for axis in 0..2 {
                    history.direction[axis].set_lane(lane, end[axis] - origin[axis] + image[axis]);
                }
            }
        }
        let zero = Packed::default();
        for (history, constants) in histories.iter_mut().zip(&near.groups) {
            let branch = history.direction;
            let length = branch.dot(branch).sqrt();
            let touched = length.less(constants.radii[0] + constants.radii[1]);
            history.direction = branch.scaled(Packed::splat(1.0) / length).where_or(touched, [zero; 2]);
            history.tangential_force = history.tangential_force.where_or(touched, [zero]);
        }
        histories
    }
}

/// All contacts after a motion, to be found.
struct Contacts<'a> {
    start: &'a Start<'a>,
    strain: &'a [[f64; 2]; 2],
    motion: &'a [Motion],
}

/// Branch vectors, m, and spins of pairs side by side. Lanes without a pair have no radii, so that these never touch.
#[derive(Clone, Copy)]
struct Gather {
    branch: [Packed; 2],
    spins: [[Packed; 1]; 2],
}

/// Groups that are collected before the first of them is worked on: numbers that have just been written one by one cannot be
/// read as a whole for a while.
const AHEAD: usize = 4;

impl Vectorised for Contacts<'_> {
    type Output = Evaluation;

    #[inline(always)]
    fn run(self) -> Evaluation {
        let Self { start, strain, motion } = self;
        let (state, near) = (start.state, &*start.near);
        let cell = state.cell.deformed(&add_scaled(&[[1.0, 0.0], [0.0, 1.0]], 1.0, strain));
        let images = near.images(&cell);
        let mut grains = vec![[0.0; 4]; motion.len()];
        let given = state.positions.iter().zip(motion).zip(&near.inverse_radii);
        for (grain, (([x, y], [u, v, turn]), inverse_radius)) in grains.iter_mut().zip(given) {
            let by_strain = [strain[0][0] * x + strain[0][1] * y, strain[1][0] * x + strain[1][1] * y];
            *grain = [x + (by_strain[0] + u), y + (by_strain[1] + v), turn * inverse_radius, 0.0];
        }
        let mut gathers = [Gather { branch: [Packed::splat(1.0); 2], spins: [[Packed::default()]; 2] }; AHEAD];
        let mut groups = vec![GroupNow::default(); near.groups.len()];
        let mut moments = vec![[0.0; 4]; motion.len()];
        let mut sums = StepSums::<Packed>::default();
        let inputs = start.histories.chunks(AHEAD).zip(near.groups.chunks(AHEAD));
        for ((groups, (histories, constants)), pairs) in
            groups.chunks_mut(AHEAD).zip(inputs).zip(near.listed.chunks(AHEAD * WIDTH))
        {
            for (gather, pairs) in gathers.iter_mut().zip(pairs.chunks(WIDTH)) {
                for (lane, pair) in pairs.iter().enumerate() {
                    let (origin, end) = (&grains[pair.origin as usize], &grains[pair.end as usize]);
                    let image = &images[pair.image as usize];
                    for axis in 0..2 {
                        gather.branch[axis].set_lane(lane, end[axis] - origin[axis] + image[axis]);
                    }
                    gather.spins[0][0].set_lane(lane, origin[2]);
                    gather.spins[1][0].set_lane(lane, end[2]);
                }
            }
            let inputs = gathers.iter().zip(histories).zip(constants);
            for ((now, ((gather, history), constants)), pairs) in
                groups.iter_mut().zip(inputs).zip(pairs.chunks(WIDTH))
            {
                let Some([[x, y], [first, second]]) = loads_of(start.law, constants, history, gather, now, &mut sums)
                else {
                    continue;
                };
                for (lane, pair) in pairs.iter().enumerate() {
                    let [x, y, first, second] = [x, y, first, second].map(|value| value.lane(lane));
                    let load: &mut [f64; 4] = &mut moments[pair.origin as usize];
                    (load[0], load[1], load[2]) = (load[0] + x, load[1] + y, load[2] + first);
                    let load = &mut moments[pair.end as usize];
                    (load[0], load[1], load[2]) = (load[0] - x, load[1] - y, load[2] + second);
                }
            }
        }
        let mut sums = sum_of_lanes(&sums);
        let mut loads = vec![[0.0; 3]; motion.len()];
        // Four sums: each waits for itself alone.
        let (mut largest, mut squares) = ([0.0_f64; 4], [0.0_f64; 4]);
        let given = moments.iter().zip(&near.inverse_radii);
        for (grain, (load, ([x, y, moment, _], inverse_radius))) in loads.iter_mut().zip(given).enumerate() {
            let turning = if start.rotations_free { moment * inverse_radius } else { 0.0 };
            *load = [*x, *y, turning];
            let (force, turning, sum) = (x * x + y * y, turning * turning, grain % 4);
            let larger = if force < turning { turning } else { force };
            largest[sum] = if largest[sum] < larger { larger } else { largest[sum] };
            squares[sum] += force + turning;
        }
        sums.largest_force_square = largest.into_iter().fold(0.0, f64::max);
        sums.force_square = squares.into_iter().sum();
        Evaluation { cell, grains, loads, sums, groups }
    }
}

/// Pairs side by side in one evaluation.
struct Site<'a> {
    law: &'a PlainLinear,
    constants: &'a GroupConstants,
    history: &'a History,
    spins: [[Packed; 1]; 2],
    now: &'a mut GroupNow,
    sums: &'a mut StepSums<Packed>,
    force: [Packed; 2],
    moments: [Packed; 2],
}

/// Loads of pairs side by side: the force on the origin grain, N, whose opposite acts on the end grain, and the moments on both, N m.
/// `None` where no pair touches or has touched.
#[inline(always)]
fn loads_of(
    law: &PlainLinear,
    constants: &GroupConstants,
    history: &History,
    gather: &Gather,
    now: &mut GroupNow,
    sums: &mut StepSums<Packed>,
) -> Option<[[Packed; 2]; 2]> {
    let branch = gather.branch;
    let length = branch.dot(branch).sqrt();
    (now.branch, now.length) = (branch, length);
    let touched = Packed::splat(0.5).less(history.direction.dot(history.direction));
    if !(touched | length.less(constants.radii[0] + constants.radii[1])).any() {
        return None;
    }
    let wanted = Wanted { contact_force_square: true, ..Wanted::default() };
    let zero = Packed::default();
    let (force, moments, spins) = ([zero; 2], [zero; 2], gather.spins);
    let mut site = Site { law, constants, history, spins, now, sums, force, moments };
    pair_forces(law, branch, length, Packed::splat(1.0) / length, wanted, &mut site);
    Some([site.force, site.moments])
}

impl PairSite<Discs, PlainLinear, Packed> for Site<'_> {
    #[inline(always)]
    fn radii(&self) -> [Packed; 2] {
        self.constants.radii
    }

    #[inline(always)]
    fn constants(&self) -> [Packed; 7] {
        self.constants.law
    }

    #[inline(always)]
    fn contact(&self) -> &History {
        self.history
    }

    #[inline(always)]
    fn spins(&self) -> [[Packed; 1]; 2] {
        self.spins
    }

    #[inline(always)]
    fn change(&mut self, _: LaneMask<WIDTH>, loss: Packed, new_contacts: Packed) {
        self.sums.opening_loss += loss;
        self.sums.new_contacts += new_contacts;
    }

    /// A contact slides where friction has cut its force. Of a law without memory that is what the spring would have been without
    /// the limit, with the roundings of the law: where nothing was cut, both are equal.
    #[inline(always)]
    fn answered(&mut self, motion: &ContactMotion<Discs, Packed>, response: &ContactResponse<Discs, Packed>) {
        let (zero, one) = (Packed::default(), Packed::splat(1.0));
        let [_, stiffness, _] = ContactLaw::<Discs>::stiffness(self.law, &self.constants.law, motion.overlap);
        let [uncut] = motion.carried.plus(motion.slip.scaled(stiffness));
        let touches = zero.less(motion.overlap);
        let slides = touches & motion.touched & response.tangential_force[0].abs().less(uncut.abs());
        self.now.touches = Packed::select(touches, one, zero);
        self.now.normal_force = Packed::select(touches, response.normal_force, zero);
        self.now.slides = Packed::select(slides, one, zero);
    }

    #[inline(always)]
    fn keep(&mut self, contact: History) {
        [self.now.tangential_force] = contact.tangential_force;
    }

    #[inline(always)]
    fn load(&mut self, force: [Packed; 2], moments: [[Packed; 1]; 2]) {
        (self.force, self.moments) = (force, [moments[0][0], moments[1][0]]);
    }

    #[inline(always)]
    fn add(&mut self, touches: Packed, normal_force: Packed, dissipation: Packed) {
        self.sums.contacts += touches;
        self.sums.normal_force += normal_force;
        self.sums.dissipation += dissipation;
    }

    #[inline(always)]
    fn add_at_limit(&mut self, _: Packed) {}

    #[inline(always)]
    fn add_force_square(&mut self, square: Packed) {
        self.sums.contact_force_square += square;
    }

    #[inline(always)]
    fn add_energy(&mut self, _: Packed) {}

    #[inline(always)]
    fn add_virial(&mut self, _: [Packed; 2], _: [Packed; 2]) {}
}

/// Sums over the lanes, in their order, of what is summed over pairs.
#[inline(always)]
fn sum_of_lanes(sums: &StepSums<Packed>) -> StepSums<f64> {
    let of = |value: &Packed| value.0.iter().sum();
    StepSums {
        contacts: of(&sums.contacts),
        normal_force: of(&sums.normal_force),
        contact_force_square: of(&sums.contact_force_square),
        dissipation: of(&sums.dissipation),
        opening_loss: of(&sums.opening_loss),
        ..StepSums::default()
    }
}

#[cfg(test)]
mod tests {
    use super::super::near_pairs::NearPairsMemory;
    use super::*;
    use crate::cell::PairFinder;
    use crate::contact::ContactTable;
    use crate::definition::{GrainDefinition, GrainModel, PackingFile, RveOptions};
    use crate::engine::GrainRve;
    use std::path::Path;

    /// The shipped packing of 100 discs under a contact law, as it stands, given to `look`.
    fn with_discs(friction: f64, cohesion: f64, look: impl FnOnce(&Start<'_>)) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let linear = ContactTable::linear(1.0, 0.8, friction);
        let contact = ContactTable { normal_stiffness: None, modulus: Some(1.0e8), cohesion, ..linear };
        let packing = PackingFile::read(&file).unwrap();
        let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
        let model = GrainModel::new(&definition).unwrap();
        let law = definition.contact.plain_linear().unwrap();
        let state = GrainRve::new(&definition).unwrap().committed().clone();
        let mut pairs = Vec::new();
        let positions = state.positions.iter().copied();
        PairFinder::default().find(&state.cell, positions, &model.radii, 1e-5, &mut pairs);
        let near = NearPairsMemory::default().of(&Arc::new(pairs), &model, &law);
        look(&Start::of(&law, &state, near, true));
    }

    /// A grain in bonds without force was pushed out of them, and the energy that it takes to break them was missing.
    #[test]
    fn no_grain_is_pushed_out_of_its_bonds() {
        for cohesion in [0.0, 1e-6] {
            with_discs(0.5, cohesion, |start| {
                let mut motion = vec![[0.0; 3]; start.state.positions.len()];
                let evaluation = start.evaluate(&[[-1e-5, 0.0], [0.0, 1e-5]], &motion);
                // As if every grain were loose.
                let is_moved = start.free_loose_grains(&evaluation, &mut motion, f64::INFINITY, 0.0);
                let moves = motion.iter().any(|motion| *motion != [0.0; 3]);
                assert_eq!((is_moved, moves), (cohesion == 0.0, cohesion == 0.0));
            });
        }
    }

    /// Motions of all grains that open, close and slide contacts, in a strained cell: the same bits whatever the processor has.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        for friction in [0.0, 0.3, 1.0] {
            with_discs(friction, 0.0, |start| {
                let motion: Vec<Motion> = (0..start.state.positions.len())
                    .map(|grain| [0.3, 0.7, 1.1].map(|phase| 2e-6 * (phase * grain as f64).sin()))
                    .collect();
                let strain = [[-2e-4, 1e-4], [1e-4, -5e-4]];
                let wide = start.evaluate(&strain, &motion);
                let plain = Contacts { start, strain: &strain, motion: &motion }.run();
                assert_eq!(wide.loads, plain.loads);
                assert_eq!((wide.positions(), wide.sums), (plain.positions(), plain.sums));
                let listed = 0..start.near().keys.len();
                let kinds = listed.fold([0; 3], |[touching, sliding, open], place| {
                    let now = wide.pair(place);
                    assert_eq!(format!("{now:?}"), format!("{:?}", plain.pair(place)));
                    [
                        touching + usize::from(now.touches),
                        sliding + usize::from(now.slides),
                        open + usize::from(!now.touches),
                    ]
                });
                assert!(kinds[1] > 0 && kinds[2] > 0 && kinds[0] == wide.sums.contacts as usize, "{kinds:?}");
                assert!(wide.sums.opening_loss > 0.0 || friction == 0.0, "no contact has opened");
            });
        }
    }
}
