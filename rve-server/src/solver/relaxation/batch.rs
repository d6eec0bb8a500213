//! The working set of a solver: cells of one packing side by side in lanes, with one list of pairs for all of them.
//!
//! Invariant: the list holds every pair that may touch in any occupied lane; its order is that of the pair keys. Which
//! other pairs it holds, and when it was made, cannot reach a result. Empty lanes have their periodic images at infinity:
//! nothing touches there.

use super::lane_access::{branch_of, set_lane, vector_of};
use super::neighbour_list::{NeighbourList, is_subset, merged};
use super::neighbour_list_memory::NeighbourListMemory;
use super::setting::Setting;
use super::stiffness::{PairsOfGrains, StiffContacts, StiffGrains, largest_own_stiffness};
use crate::cell::{Cell, PairFinder, PairKey};
use crate::contact::ContactLaw;
use crate::simd::{Real, Tuple};
use crate::solver::kernel::{
    Contact, Grain, GrainConstants, ListedPair, MoveSums, PairConstants, PairGroup, Steering, StepData, StepSums,
    Wanted, pack, unpack,
};
use crate::space::{Components, KernelSpace, Space, Tensor};

/// The list is rebuilt without the pairs of lanes that have left once it is longer than this times the longest list
/// of an occupied lane.
const SLACK: f64 = 1.25;

/// Contents of one lane, put in or taken out.
#[derive(Clone, Debug)]
pub(crate) struct CellInLane<S: Space, C: ContactLaw<S::Kernel>> {
    pub(crate) grains: Vec<Grain<S::Kernel, f64>>,
    /// Touching pairs in key order, each with its count of evaluations at the friction limit.
    pub(crate) contacts: Vec<(PairKey<S>, Contact<S::Kernel, C, f64>, f64)>,
    /// Absent for a lane that has not been listed yet.
    pub(crate) neighbour_list: Option<NeighbourList<S>>,
    pub(crate) cell: Cell<S>,
}

impl<S: Space, C: ContactLaw<S::Kernel>> Default for CellInLane<S, C> {
    /// Nothing.
    fn default() -> Self {
        Self { grains: Vec::new(), contacts: Vec::new(), neighbour_list: None, cell: Cell { rows: S::Tensor::ZERO } }
    }
}

/// A lane and what goes into it or comes out.
pub(crate) type Passage<'a, S, C> = (usize, &'a mut CellInLane<S, C>);

/// Several cells of one packing.
#[derive(Clone, Debug)]
pub(crate) struct Batch<S: Space, C: ContactLaw<S::Kernel>, R: Real> {
    grain_constants: Vec<GrainConstants>,
    grains: Vec<Grain<S::Kernel, R>>,
    keys: Vec<PairKey<S>>,
    pairs: Vec<ListedPair>,
    pair_constants: Vec<PairConstants<S::Kernel, C>>,
    contacts: Vec<Contact<S::Kernel, C, R>>,
    live: Vec<bool>,
    limit_counts: Vec<R>,
    /// The pairs of a single cell as evaluations work on them; while it is filled, histories and counts are in it.
    groups: Vec<PairGroup<S::Kernel, C>>,
    shifts: Vec<S::Shift>,
    images: Vec<<S::Kernel as KernelSpace>::Coordinates<R>>,
    lanes: Vec<Option<Occupied<S>>>,
    /// Lanes that have been emptied and still hold what was in them; the next cell overwrites it.
    stale: Vec<bool>,
    finder: PairFinder<S>,
    /// For the stiffness bound.
    pairs_of_grains: PairsOfGrains,
    memory: NeighbourListMemory<S>,
}

/// Cell and list of an occupied lane.
#[derive(Clone, Debug)]
struct Occupied<S: Space> {
    cell: Cell<S>,
    neighbour_list: NeighbourList<S>,
}

impl<S: Space, C: ContactLaw<S::Kernel>, R: Real> Batch<S, C, R> {
    /// Empty lanes for a packing.
    pub(crate) fn new(setting: &Setting<'_, C>) -> Self {
        let grain_constants: Vec<GrainConstants> = setting.grain_constants::<S>();
        Self {
            grains: vec![Grain::empty(); grain_constants.len()],
            grain_constants,
            keys: Vec::new(),
            pairs: Vec::new(),
            pair_constants: Vec::new(),
            contacts: Vec::new(),
            live: Vec::new(),
            limit_counts: Vec::new(),
            groups: Vec::new(),
            shifts: Vec::new(),
            images: Vec::new(),
            lanes: (0..R::LANES).map(|_| None).collect(),
            stale: vec![false; R::LANES],
            finder: PairFinder::default(),
            pairs_of_grains: PairsOfGrains::default(),
            memory: NeighbourListMemory::default(),
        }
    }

    /// Number of listed pairs.
    #[cfg(test)]
    pub(crate) fn listed(&self) -> usize {
        self.keys.len()
    }

    /// Fills empty lanes. The lists of the contents go along; the rest stays, as room for what is taken out.
    ///
    /// A lane alone touches the memory of all of them, so that several at once cost little more than one.
    pub(crate) fn put(&mut self, setting: &Setting<'_, C>, arrivals: &mut [Passage<'_, S, C>]) {
        self.unpack();
        for (number, grain) in self.grains.iter_mut().enumerate() {
            for (lane, contents) in &*arrivals {
                grain.set_lane(*lane, &contents.grains[number]);
            }
        }
        for (lane, contents) in &mut *arrivals {
            self.list(setting, *lane, contents);
        }
        let mut given: Vec<_> = arrivals
            .iter()
            .map(|(lane, contents)| {
                (*lane, std::mem::take(&mut self.stale[*lane]), contents.contacts.iter().peekable())
            })
            .collect();
        for (place, key) in self.keys.iter().enumerate() {
            for (lane, is_stale, contacts) in &mut given {
                if let Some((_, contact, count)) = contacts.next_if(|(wanted, ..)| wanted == key) {
                    self.contacts[place].set_lane(*lane, contact);
                    self.limit_counts[place].set_lane(*lane, *count);
                    self.live[place] = true;
                } else if *is_stale {
                    self.contacts[place].set_lane(*lane, &Contact::none());
                    self.limit_counts[place].set_lane(*lane, 0.0);
                }
            }
        }
        // A contact without a place would lose its history, and nobody would see it in the answer.
        assert!(given.iter_mut().all(|(.., contacts)| contacts.next().is_none()), "the list holds every contact");
    }

    /// Occupies a lane and lists the pairs of its grains, which are there already.
    fn list(&mut self, setting: &Setting<'_, C>, lane: usize, contents: &mut CellInLane<S, C>) {
        debug_assert!(self.lanes[lane].is_none(), "the lane is empty");
        let range = 2.0 * setting.largest_radius + setting.skin;
        let neighbour_list = contents.neighbour_list.take();
        let place = |grain: usize| vector_of::<S::Kernel, f64>(&contents.grains[grain].position, 0);
        let known = neighbour_list.or_else(|| self.memory.recall(&contents.cell, place, range, setting.skin));
        let is_new = known.is_none();
        self.lanes[lane] = Some(Occupied { cell: contents.cell, neighbour_list: known.unwrap_or_default() });
        if is_new {
            self.renew_neighbour_list(setting, lane);
            let keys = &self.lanes[lane].as_ref().expect("the lane is occupied").neighbour_list.keys;
            self.memory.keep(&contents.cell, (0..contents.grains.len()).map(place).collect(), keys);
        } else {
            self.include(setting, lane);
        }
    }

    /// Empties lanes into their contents, whatever these were.
    pub(crate) fn take(&mut self, departures: &mut [Passage<'_, S, C>]) {
        self.unpack();
        for (lane, contents) in &mut *departures {
            let Occupied { cell, neighbour_list } = self.lanes[*lane].take().expect("the lane is occupied");
            (contents.cell, contents.neighbour_list) = (cell, Some(neighbour_list));
            contents.grains.clear();
            contents.contacts.clear();
            self.stale[*lane] = true;
        }
        for grain in &self.grains {
            for (lane, contents) in &mut *departures {
                contents.grains.push(grain.lane(*lane));
            }
        }
        let histories = self.contacts.iter().zip(&self.limit_counts);
        for (key, (contact, count)) in self.keys.iter().zip(histories) {
            for (lane, contents) in &mut *departures {
                let contact = contact.lane(*lane);
                if contact.touches() {
                    contents.contacts.push((*key, contact, count.lane(*lane)));
                }
            }
        }
    }

    /// Clears a lane that has been emptied.
    fn clear(&mut self, lane: usize) {
        self.unpack();
        let empty = Grain::empty();
        for grain in &mut self.grains {
            grain.set_lane(lane, &empty);
        }
        for (contact, count) in self.contacts.iter_mut().zip(&mut self.limit_counts) {
            contact.set_lane(lane, &Contact::none());
            count.set_lane(lane, 0.0);
        }
        for image in &mut self.images {
            set_lane(image, lane, &[f64::INFINITY; 3]);
        }
        self.stale[lane] = false;
    }

    /// Forgets how often contacts of a lane have been at their limit.
    pub(crate) fn clear_limit_counts(&mut self, lane: usize) {
        self.unpack();
        for count in &mut self.limit_counts {
            count.set_lane(lane, 0.0);
        }
    }

    /// The cell of an occupied lane.
    pub(crate) fn cell(&self, lane: usize) -> Cell<S> {
        self.lanes[lane].as_ref().expect("the lane is occupied").cell
    }

    /// Sets the cell of an occupied lane after its grains have moved by up to `moved`, m, against the affine motion.
    /// Renews the list if an unlisted pair could touch by now.
    pub(crate) fn follow(&mut self, setting: &Setting<'_, C>, lane: usize, cell: Cell<S>, moved: f64) {
        let occupied = self.lanes[lane].as_mut().expect("the lane is occupied");
        let deforms = occupied.cell != cell;
        occupied.cell = cell;
        occupied.neighbour_list.add_motion(moved);
        if deforms {
            occupied.neighbour_list.stretch_to(&cell);
            self.set_images(lane);
        }
        let range = 2.0 * setting.largest_radius + setting.skin;
        let occupied = self.lanes[lane].as_ref().expect("the lane is occupied");
        if !occupied.neighbour_list.is_complete(range, setting.skin) {
            self.renew_neighbour_list(setting, lane);
        }
    }

    /// Kicks and moves all lanes.
    pub(crate) fn advance(
        &mut self,
        setting: &Setting<'_, C>,
        steering: &Steering<S::Kernel, R>,
        wanted: Wanted,
    ) -> MoveSums<R> {
        for lane in 0..R::LANES {
            if self.stale[lane] {
                self.clear(lane);
            }
        }
        setting.backend.advance(&mut self.data(setting, wanted, R::default()), steering)
    }

    /// Evaluates all contacts. `sampling` is what an evaluation at the friction limit counts in each lane.
    pub(crate) fn evaluate(&mut self, setting: &Setting<'_, C>, wanted: Wanted, sampling: R) -> StepSums<R> {
        if R::LANES == 1 && self.groups.is_empty() && setting.backend.has_lanes() {
            let mut groups = std::mem::take(&mut self.groups);
            pack(&self.data(setting, wanted, sampling), &mut groups);
            self.groups = groups;
        }
        setting.backend.evaluate(&mut self.data(setting, wanted, sampling))
    }

    /// Takes histories and counts of a single cell back from the groups that evaluations work on.
    pub(crate) fn unpack(&mut self) {
        if !self.groups.is_empty() {
            unpack(&self.groups, &mut self.contacts, &mut self.live, &mut self.limit_counts);
            self.groups.clear();
        }
    }

    /// Largest own stiffness of a grain, N/m, in each of these lanes; other lanes may hold any number.
    pub(crate) fn largest_own_stiffness(&mut self, setting: &Setting<'_, C>, lanes: &[usize]) -> R {
        self.unpack();
        self.pairs_of_grains.follow(self.grains.len(), &self.pairs);
        let grains = StiffGrains {
            law: setting.law,
            inertia: setting.inertia_factor(),
            radii: setting.radii,
            constants: &self.grain_constants,
            pairs: &self.pairs_of_grains,
            pair_constants: &self.pair_constants,
        };
        if let [lane] = *lanes {
            let mut found = R::default();
            found.set_lane(lane, largest_own_stiffness(grains, &OneLane { batch: self, lane }));
            return found;
        }
        largest_own_stiffness(grains, &AllLanes { batch: self })
    }

    fn data<'a>(
        &'a mut self,
        setting: &'a Setting<'_, C>,
        wanted: Wanted,
        sampling: R,
    ) -> StepData<'a, S::Kernel, C, R> {
        StepData {
            law: setting.law,
            grain_constants: &self.grain_constants,
            grains: &mut self.grains,
            pairs: &self.pairs,
            pair_constants: &self.pair_constants,
            contacts: &mut self.contacts,
            groups: &mut self.groups,
            live: &mut self.live,
            limit_counts: &mut self.limit_counts,
            sampling,
            images: &self.images,
            wanted,
        }
    }

    /// Lists the pairs of a lane for its present positions.
    fn renew_neighbour_list(&mut self, setting: &Setting<'_, C>, lane: usize) {
        let occupied = self.lanes[lane].as_mut().expect("the lane is occupied");
        let positions = self.grains.iter().map(|grain| vector_of::<S::Kernel, R>(&grain.position, lane));
        let neighbour_list = &mut occupied.neighbour_list;
        self.finder.find(&occupied.cell, positions, setting.radii, setting.skin, &mut neighbour_list.keys);
        neighbour_list.begin(&occupied.cell);
        self.include(setting, lane);
    }

    /// Makes sure that the common list holds the list of a lane.
    fn include(&mut self, setting: &Setting<'_, C>, lane: usize) {
        let longest = self.lanes.iter().flatten().map(|other| other.neighbour_list.keys.len()).max().unwrap_or(0);
        let own = &self.lanes[lane].as_ref().expect("the lane is occupied").neighbour_list.keys;
        let union = if self.keys.len() as f64 > SLACK * longest as f64 {
            self.unpack();
            // A contact that has come apart by more than the skin is in no list of its own any more, but its end has to be booked.
            let touching: Vec<PairKey<S>> =
                self.keys.iter().zip(&self.live).filter(|(_, live)| **live).map(|(key, _)| *key).collect();
            self.lanes.iter().flatten().fold(touching, |union, other| merged(&union, &other.neighbour_list.keys))
        } else if is_subset(own, &self.keys) {
            return self.set_images(lane);
        } else {
            merged(&self.keys, own)
        };
        if union == self.keys {
            return self.set_images(lane);
        }
        self.relist(setting, union);
    }

    /// Replaces the common list; histories move along.
    fn relist(&mut self, setting: &Setting<'_, C>, keys: Vec<PairKey<S>>) {
        self.unpack();
        self.pairs_of_grains.clear();
        self.shifts.clear();
        self.shifts.extend(keys.iter().map(|key| key.shift));
        self.shifts.sort_unstable();
        self.shifts.dedup();
        let old_contacts = std::mem::take(&mut self.contacts);
        let old_counts = std::mem::take(&mut self.limit_counts);
        let old_live = std::mem::take(&mut self.live);
        let old_constants = std::mem::take(&mut self.pair_constants);
        let mut old = self.keys.iter().enumerate().peekable();
        self.pairs.clear();
        self.pairs.reserve_exact(keys.len());
        self.contacts.reserve_exact(keys.len());
        self.limit_counts.reserve_exact(keys.len());
        self.live.reserve_exact(keys.len());
        self.pair_constants.reserve_exact(keys.len());
        for key in &keys {
            while old.next_if(|(_, old_key)| *old_key < key).is_some() {}
            let known = old.next_if(|(_, old_key)| *old_key == key).map(|(place, _)| place);
            let image = self.shifts.binary_search(&key.shift).expect("every shift was collected") as u32;
            self.pairs.push(ListedPair { origin: key.origin, end: key.end, image });
            let radii = || [setting.radii[key.origin as usize], setting.radii[key.end as usize]];
            self.pair_constants
                .push(known.map_or_else(|| PairConstants::new(setting.law, radii()), |place| old_constants[place]));
            self.contacts.push(known.map_or_else(Contact::none, |place| old_contacts[place]));
            self.limit_counts.push(known.map_or_else(R::default, |place| old_counts[place]));
            self.live.push(known.is_some_and(|place| old_live[place]));
        }
        self.keys = keys;
        self.images.clear();
        self.images.resize(self.shifts.len(), Tuple::filled(R::splat(f64::INFINITY)));
        for lane in 0..R::LANES {
            if self.lanes[lane].is_some() {
                self.set_images(lane);
            }
        }
    }

    fn set_images(&mut self, lane: usize) {
        let cell = self.cell(lane);
        for (image, shift) in self.images.iter_mut().zip(&self.shifts) {
            set_lane(image, lane, cell.translation(*shift).components());
        }
    }
}

/// The contacts of all lanes at the last evaluation. What the bound asks of them is compiled for the instructions of its loop.
struct AllLanes<'a, S: Space, C: ContactLaw<S::Kernel>, R: Real> {
    batch: &'a Batch<S, C, R>,
}

impl<S: Space, C: ContactLaw<S::Kernel>, R: Real> StiffContacts<S> for AllLanes<'_, S, C, R> {
    type Number = R;

    #[inline(always)]
    fn direction(&self, pair: usize) -> <S::Kernel as KernelSpace>::Coordinates<R> {
        self.batch.contacts[pair].direction
    }

    #[inline(always)]
    fn overlap(&self, pair: usize) -> R {
        let Batch { grains, images, pairs, .. } = self.batch;
        let ListedPair { origin, end, image } = pairs[pair];
        let (origin, end) = (&grains[origin as usize], &grains[end as usize]);
        let branch = end.position.minus(origin.position).plus(images[image as usize]);
        let radii = self.batch.pair_constants[pair].radii;
        R::splat(radii[0] + radii[1]) - branch.dot(branch).sqrt()
    }
}

/// Those of one of them.
struct OneLane<'a, S: Space, C: ContactLaw<S::Kernel>, R: Real> {
    batch: &'a Batch<S, C, R>,
    lane: usize,
}

impl<S: Space, C: ContactLaw<S::Kernel>, R: Real> StiffContacts<S> for OneLane<'_, S, C, R> {
    type Number = f64;

    #[inline(always)]
    fn direction(&self, pair: usize) -> S::Vector {
        vector_of::<S::Kernel, R>(&self.batch.contacts[pair].direction, self.lane)
    }

    #[inline(always)]
    fn overlap(&self, pair: usize) -> f64 {
        let Batch { grains, images, pairs, .. } = self.batch;
        let ListedPair { origin, end, image } = pairs[pair];
        let place = |grain: u32| vector_of::<S::Kernel, R>(&grains[grain as usize].position, self.lane);
        let image = vector_of::<S::Kernel, R>(&images[image as usize], self.lane);
        let radii = self.batch.pair_constants[pair].radii;
        radii[0] + radii[1] - branch_of::<S::Kernel>(place(origin), place(end), image).1
    }
}
