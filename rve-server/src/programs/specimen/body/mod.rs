//! Grains and all forces between them: what a specimen and a frame have in common.
//!
//! The forces are the same bits for any number of threads. Pairs are evaluated in blocks of fixed size, each pair writes
//! its own record, every grain then collects the records of its own pairs in pair order, and sums of blocks are added in
//! block order: no sum depends on who computed what.

mod kept;
mod periods;
mod sides;

use self::periods::Periods;
pub(super) use self::sides::mean_place;
use super::SpecimenSpace;
use super::block::{Block, Listed};
use super::contact::{ContactSums, Grain, Load, OwnStiffness, PairLoad, Slot};
use crate::cell::{Cell, PairFinder, PairKey};
use crate::contact::ContactLaw;
use crate::homogenization::picture::ContactLine;
use crate::simd::Tuple;
use crate::space::{Components, Tensor};
use rayon::prelude::*;

/// Pairs evaluated as one unit of work.
const PAIRS_PER_BLOCK: usize = 2048;

/// Grains that collect their loads as one unit of work.
const GRAINS_PER_BLOCK: usize = 2048;

/// Listed pairs from which on threads are worth their cost.
const FEWEST_FOR_THREADS: usize = 8192;

/// Pair ends beyond reach, in mean radii, that are listed as well, so that a list lasts.
const SKIN: f64 = 0.1;

/// Which contacts a body shares with its neighbours; see [`Body::share_sides`].
#[derive(Clone, Debug, Default, PartialEq)]
struct Sides {
    masks: Vec<u8>,
    weight: f64,
}

/// Grains, the pairs between them and the loads that result.
#[derive(Clone, Debug)]
pub struct Body<S: SpecimenSpace, C: ContactLaw<S>> {
    law: C,
    /// Translations to the next image along the periodic axes; nothing where a body ends.
    periods: Periods<S>,
    /// The grains.
    pub grains: Vec<Grain<S>>,
    /// Loads of the last evaluation.
    pub loads: Vec<Load<S>>,
    masses: Vec<f64>,
    damping_ratio: f64,
    sides: Sides,
    keys: Vec<PairKey<S>>,
    pub(crate) pairs: Vec<Listed>,
    pub(crate) slots: Vec<Slot<S, C>>,
    /// Whether each listed pair touches, as its slot says: most questions need nothing else of it.
    touching: Vec<bool>,
    pair_loads: Vec<PairLoad<S>>,
    /// Sums of the blocks of pairs in the last evaluation, in their order.
    block_sums: Vec<ContactSums>,
    images: Vec<S::Coordinates<f64>>,
    /// Numbers of periods of each image.
    shifts: Vec<S::Shift>,
    /// Velocities of the images, m/s; empty while the sides stand still.
    image_velocities: Vec<S::Coordinates<f64>>,
    /// Sum over the contacts of the force on the origin grain times the number of periods to the end grain, per axis, N: what
    /// works when the sides move, and is computed only then.
    side_forces: [S::Vector; 3],
    /// Pairs of each grain: `2 pair + 1` where the grain is the end; grain `i` has entries `starts[i]..starts[i + 1]`.
    members: Vec<u32>,
    starts: Vec<u32>,
    finder: PairFinder<S>,
    skin: f64,
    listed_at: Vec<S::Coordinates<f64>>,
    /// The sides when pairs were listed.
    listed_periods: [Option<S::Vector>; 3],
    /// Renewals of the pair list so far.
    pub renewals: u64,
}

impl<S: SpecimenSpace, C: ContactLaw<S>> Body<S, C> {
    /// A body of grains with these masses, kg. `damping_ratio` is that of every contact's viscosity, 0 for none; `periods`
    /// are the translations to the next image along the periodic axes, which have no part along the other axes.
    pub fn new(
        law: C,
        grains: Vec<Grain<S>>,
        masses: Vec<f64>,
        damping_ratio: f64,
        periods: [Option<S::Vector>; 3],
    ) -> Self {
        let mean = grains.iter().map(|grain| grain.radius).sum::<f64>() / grains.len().max(1) as f64;
        let mut body = Self {
            law,
            periods: Periods::at_rest(periods),
            loads: vec![Load::none(); grains.len()],
            grains,
            masses,
            damping_ratio,
            sides: Sides { masks: Vec::new(), weight: 1.0 },
            keys: Vec::new(),
            pairs: Vec::new(),
            slots: Vec::new(),
            touching: Vec::new(),
            pair_loads: Vec::new(),
            block_sums: Vec::new(),
            images: Vec::new(),
            shifts: Vec::new(),
            image_velocities: Vec::new(),
            side_forces: [S::Vector::ZERO; 3],
            members: Vec::new(),
            starts: Vec::new(),
            finder: PairFinder::default(),
            skin: SKIN * mean,
            listed_at: Vec::new(),
            listed_periods: periods,
            renewals: 0,
        };
        body.list_pairs();
        body
    }

    /// Contacts between two grains of the same side count with `weight`: they belong to the neighbouring body as well.
    /// `masks` has a bit per side for every grain.
    pub fn share_sides(&mut self, masks: Vec<u8>, weight: f64) {
        self.sides = Sides { masks, weight };
        self.list_pairs();
    }

    /// The contact law.
    pub fn law(&self) -> &C {
        &self.law
    }

    /// Another law for all contacts, as when friction changes between two stages; histories are kept.
    pub fn change_law(&mut self, law: C) {
        if law == self.law {
            return;
        }
        self.law = law;
        for slot in &mut self.slots {
            slot.constants = law.constants(slot.radii);
        }
    }

    /// Mass of a grain, kg.
    pub fn mass(&self, grain: usize) -> f64 {
        self.masses[grain]
    }

    /// Masses of the grains in the motion, kg: contact viscosity follows them.
    pub(crate) fn change_masses(&mut self, masses: &[f64]) {
        self.masses.copy_from_slice(masses);
        if self.damping_ratio == 0.0 {
            return;
        }
        for (pair, slot) in self.pairs.iter().zip(&mut self.slots) {
            let [first, second] = [masses[pair.origin as usize], masses[pair.end as usize]];
            slot.change_mass(first * second / (first + second), self.damping_ratio);
        }
    }

    /// Damping ratio of every contact's viscosity.
    pub(crate) fn damping_ratio(&self) -> f64 {
        self.damping_ratio
    }

    /// Gives contacts the tangential forces and rolling moments that they have, as axial vectors on their origin grain,
    /// computed from the branch. Returns the number of those that do not touch: they are passed over.
    pub(crate) fn adopt<F>(&mut self, histories: impl Iterator<Item = (PairKey<S>, F)>) -> usize
    where
        F: FnOnce(S::Coordinates<f64>) -> [S::Axial<f64>; 2],
    {
        let mut passed_over = 0;
        for (key, history) in histories {
            let adopted = self.keys.binary_search(&key).is_ok_and(|index| {
                let branch = self.branch(index);
                let [force, moment] = history(branch);
                self.touching[index] = self.slots[index].adopt(&self.law, branch, force, moment);
                self.touching[index]
            });
            passed_over += usize::from(!adopted);
        }
        passed_over
    }

    /// Key of a listed pair.
    pub(crate) fn key(&self, index: usize) -> &PairKey<S> {
        &self.keys[index]
    }

    /// Numbers of the touching pairs, in key order.
    pub(crate) fn touching(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.touching.len()).filter(|index| self.touching[*index])
    }

    /// Branch vector of a listed pair, m.
    pub(crate) fn branch(&self, index: usize) -> S::Coordinates<f64> {
        let pair = &self.pairs[index];
        let (origin, end) = (&self.grains[pair.origin as usize], &self.grains[pair.end as usize]);
        end.position.minus(origin.position).plus(self.images[pair.image as usize])
    }

    /// The contacts between grains as lines, in key order.
    pub(crate) fn contact_lines(&self) -> Vec<ContactLine> {
        let line = |index: usize| {
            let (pair, slot) = (&self.pairs[index], &self.slots[index]);
            let (from, force) = (self.grains[pair.origin as usize].position, self.pair_loads[index].force);
            let normal_force = force.dot(slot.direction);
            let tangential = force.minus(slot.direction.scaled(normal_force));
            ContactLine {
                grains: [pair.origin, pair.end],
                from: in_space(from.as_ref()),
                to: in_space(from.plus(self.branch(index)).as_ref()),
                normal_force,
                tangential_force: tangential.dot(tangential).sqrt(),
                force: in_space(force.as_ref()),
                overlap: slot.overlap,
                is_sliding: slot.is_sliding(&self.law),
            }
        };
        self.touching().map(line).collect()
    }

    /// Love-Weber sum `sum f x b` over all contacts, J, tension positive: stress times volume. Row-major, 3 x 3.
    pub fn stress_sum(&self) -> [[f64; 3]; 3] {
        let mut sum = [[0.0; 3]; 3];
        for index in self.touching() {
            let (branch, force) = (self.branch(index), self.pair_loads[index].force);
            for (row, component) in sum.iter_mut().zip(force.as_ref()) {
                for (value, arm) in row.iter_mut().zip(branch.as_ref()) {
                    *value += component * arm;
                }
            }
        }
        sum
    }

    /// Contact fabric `1/C sum n x n`, row-major, 3 x 3; zero without contacts.
    pub fn fabric(&self) -> [[f64; 3]; 3] {
        let (mut sum, mut count) = ([[0.0; 3]; 3], 0.0f64);
        for index in self.touching() {
            let direction = self.slots[index].direction;
            for (row, first) in sum.iter_mut().zip(direction.as_ref()) {
                for (value, second) in row.iter_mut().zip(direction.as_ref()) {
                    *value += first * second;
                }
            }
            count += 1.0;
        }
        sum.map(|row| row.map(|value| value / count.max(1.0)))
    }

    /// Renews the pair list if some unlisted pair may touch by now.
    ///
    /// Returns whether it was renewed.
    pub fn keep_list_complete(&mut self) -> bool {
        let renew =
            if self.periods.carried == self.listed_periods { self.has_wandered() } else { self.has_left_the_flow() };
        if renew {
            self.list_pairs();
        }
        renew
    }

    fn has_wandered(&self) -> bool {
        let limit = 0.25 * self.skin * self.skin;
        let has_wandered = |(grain, listed): (&Grain<S>, &S::Coordinates<f64>)| {
            let way = grain.position.minus(*listed);
            let covered = way.dot(way);
            // A position that is not a number has moved as well.
            covered.is_nan() || covered >= limit
        };
        if self.grains.len() >= FEWEST_FOR_THREADS {
            self.grains.par_iter().zip(&self.listed_at).any(has_wandered)
        } else {
            self.grains.iter().zip(&self.listed_at).any(has_wandered)
        }
    }

    /// Sum of the normal stiffnesses of a grain's contacts with grains that are not `driven`, N/m.
    pub(crate) fn stiffness_against_free(&self, grain: usize, driven: &[bool]) -> f64 {
        let members = &self.members[self.starts[grain] as usize..self.starts[grain + 1] as usize];
        let pairs = members.iter().map(|member| (*member >> 1) as usize).filter(|pair| self.touching[*pair]);
        pairs.fold(0.0, |sum, index| {
            let pair = &self.pairs[index];
            let is_free = !(driven[pair.origin as usize] && driven[pair.end as usize]);
            if is_free { sum + self.slots[index].stiffness(&self.law)[0] } else { sum }
        })
    }

    /// Viscous part of the forces of a grain's contacts on it, N.
    pub(crate) fn viscous_force(&self, grain: usize) -> S::Coordinates<f64> {
        let members = &self.members[self.starts[grain] as usize..self.starts[grain + 1] as usize];
        let touching = members.iter().filter(|member| self.touching[(**member >> 1) as usize]);
        touching.fold(Tuple::zero(), |sum: S::Coordinates<f64>, member| {
            let slot = &self.slots[(member >> 1) as usize];
            // The dashpot pushes the origin grain back along the branch, and the end grain forwards.
            let sign = if member & 1 == 1 { 1.0 } else { -1.0 };
            slot.direction.scaled_plus(sign * slot.weight * slot.viscous_force, sum)
        })
    }

    /// All contact forces after a motion of `step` seconds; loads hold contact forces alone afterwards.
    pub fn evaluate(&mut self, step: f64) -> ContactSums {
        let (law, grains, images) = (&self.law, &self.grains, &self.images);
        let image_velocities = &self.image_velocities;
        let is_viscous = self.damping_ratio > 0.0;
        let blocks = self.pairs.len().div_ceil(PAIRS_PER_BLOCK);
        let threaded = self.pairs.len() >= FEWEST_FOR_THREADS;
        self.block_sums.clear();
        self.block_sums.resize(blocks, ContactSums::default());
        let evaluated = |pairs, slots, touching, loads| {
            Block { law, grains, images, image_velocities, pairs, slots, touching, loads, is_viscous, step }
                .evaluate()
        };
        if threaded {
            self.pairs
                .par_chunks(PAIRS_PER_BLOCK)
                .zip(self.slots.par_chunks_mut(PAIRS_PER_BLOCK))
                .zip(self.touching.par_chunks_mut(PAIRS_PER_BLOCK))
                .zip(self.pair_loads.par_chunks_mut(PAIRS_PER_BLOCK))
                .zip(self.block_sums.par_iter_mut())
                .for_each(|((((pairs, slots), touching), loads), sums)| {
                    *sums = evaluated(pairs, slots, touching, loads);
                });
        } else {
            let blocks = self
                .pairs
                .chunks(PAIRS_PER_BLOCK)
                .zip(self.slots.chunks_mut(PAIRS_PER_BLOCK))
                .zip(self.touching.chunks_mut(PAIRS_PER_BLOCK))
                .zip(self.pair_loads.chunks_mut(PAIRS_PER_BLOCK));
            for ((((pairs, slots), touching), loads), sums) in blocks.zip(&mut self.block_sums) {
                *sums = evaluated(pairs, slots, touching, loads);
            }
        }
        self.collect(threaded);
        self.side_forces = self.sum_of_side_forces();
        self.block_sums.iter().fold(ContactSums::default(), |mut whole, block| {
            whole.add(block);
            whole
        })
    }

    /// Every grain sums the loads of its own pairs.
    fn collect(&mut self, threaded: bool) {
        let (starts, members, touching, pair_loads) = (&self.starts, &self.members, &self.touching, &self.pair_loads);
        let gather = |first: usize, loads: &mut [Load<S>]| {
            for (offset, load) in loads.iter_mut().enumerate() {
                let grain = first + offset;
                *load = Load::none();
                for &member in &members[starts[grain] as usize..starts[grain + 1] as usize] {
                    let pair = (member >> 1) as usize;
                    if !touching[pair] {
                        continue;
                    }
                    let is_end = (member & 1) as usize;
                    let record = &pair_loads[pair];
                    let force = if is_end == 1 { record.force.scaled(-1.0) } else { record.force };
                    load.force = load.force.plus(force);
                    load.moment = load.moment.plus(record.moments[is_end]);
                }
            }
        };
        if threaded {
            let blocks = self.loads.par_chunks_mut(GRAINS_PER_BLOCK).enumerate();
            blocks.for_each(|(block, loads)| gather(block * GRAINS_PER_BLOCK, loads));
        } else {
            gather(0, &mut self.loads);
        }
    }

    /// Per grain, what its contacts add up to in the stability bound; `inertia_factor` is the moment of inertia over mass
    /// times radius squared. Twice the stiffness over the mass bounds every squared frequency.
    pub fn own_stiffness(&self, inertia_factor: f64) -> Vec<OwnStiffness> {
        let mut sums = vec![OwnStiffness::default(); self.grains.len()];
        for index in self.touching() {
            for grain in [self.pairs[index].origin as usize, self.pairs[index].end as usize] {
                sums[grain].add(&self.slots[index].own(&self.law, self.grains[grain].radius, inertia_factor));
            }
        }
        sums
    }

    fn list_pairs(&mut self) {
        self.fold_periods();
        let cell = self.enclosing_cell();
        let radii: Vec<f64> = self.grains.iter().map(|grain| grain.radius).collect();
        let positions = self.grains.iter().map(|grain| S::Vector::from_fn(|axis| grain.position.as_ref()[axis]));
        let mut keys = Vec::new();
        self.finder.find(&cell, positions, &radii, self.skin, &mut keys);
        let mut slots = Vec::with_capacity(keys.len());
        let mut old = self.keys.iter().zip(&self.slots).peekable();
        for key in &keys {
            while old.next_if(|(old_key, _)| *old_key < key).is_some() {}
            let slot = match old.next_if(|(old_key, _)| *old_key == key) {
                Some((_, slot)) => Slot { weight: self.weight(key), ..*slot },
                None => self.fresh_slot(key),
            };
            slots.push(slot);
        }
        drop(old);
        (self.keys, self.slots) = (keys, slots);
        self.list_touching();
        self.list_shifts();
        self.pairs = self.keys.iter().map(|key| self.listed(key)).collect();
        self.pair_loads.clear();
        self.pair_loads.resize(self.pairs.len(), PairLoad::none());
        self.list_members();
        self.listed_at.clear();
        self.listed_at.extend(self.grains.iter().map(|grain| grain.position));
        self.listed_periods = self.periods.carried;
        self.place_images();
        self.renewals += 1;
    }

    /// Which of the listed pairs touch, from their slots.
    fn list_touching(&mut self) {
        self.touching.clear();
        self.touching.extend(self.slots.iter().map(|slot| slot.touches));
    }

    /// Share of a contact that belongs to this body.
    fn weight(&self, key: &PairKey<S>) -> f64 {
        let sides = (self.sides.masks.get(key.origin as usize), self.sides.masks.get(key.end as usize));
        let is_shared = matches!(sides, (Some(first), Some(second)) if first & second != 0);
        if is_shared { self.sides.weight } else { 1.0 }
    }

    /// A pair that does not touch yet.
    fn fresh_slot(&self, key: &PairKey<S>) -> Slot<S, C> {
        let ends = [key.origin as usize, key.end as usize];
        let (radii, masses) = (ends.map(|end| self.grains[end].radius), ends.map(|end| self.masses[end]));
        Slot::new(&self.law, radii, masses, self.damping_ratio, self.weight(key))
    }

    /// The images that the keys name.
    fn list_shifts(&mut self) {
        self.shifts.clear();
        self.shifts.extend(self.keys.iter().map(|key| key.shift));
        self.shifts.sort_unstable();
        self.shifts.dedup();
    }

    fn listed(&self, key: &PairKey<S>) -> Listed {
        let range = self.grains[key.origin as usize].radius + self.grains[key.end as usize].radius;
        let image = self.shifts.binary_search(&key.shift).expect("every shift was collected") as u32;
        // Nearer than the rounding of the distance: grains that touch overlap, and laws may divide by their stiffness.
        let near_square = range * range * (1.0 - 4.0 * f64::EPSILON);
        Listed { origin: key.origin, end: key.end, image, near_square }
    }

    fn list_members(&mut self) {
        self.starts.clear();
        self.starts.resize(self.grains.len() + 1, 0);
        for pair in &self.pairs {
            self.starts[pair.origin as usize + 1] += 1;
            self.starts[pair.end as usize + 1] += 1;
        }
        for grain in 1..self.starts.len() {
            self.starts[grain] += self.starts[grain - 1];
        }
        let mut next = self.starts.clone();
        self.members.clear();
        self.members.resize(2 * self.pairs.len(), 0);
        for (index, pair) in self.pairs.iter().enumerate() {
            for (end, grain) in [pair.origin, pair.end].into_iter().enumerate() {
                self.members[next[grain as usize] as usize] = (2 * index + end) as u32;
                next[grain as usize] += 1;
            }
        }
    }

    /// A box around all grains; along axes that are not periodic it is so wide that no image is ever near.
    fn enclosing_cell(&self) -> Cell<S> {
        let reach = 2.0 * self.grains.iter().fold(0.0, |largest: f64, grain| largest.max(grain.radius)) + self.skin;
        let along = |axis: usize| {
            let places = || self.grains.iter().map(|grain| grain.position.as_ref()[axis]).filter(|x| x.is_finite());
            let (low, high) = (places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max));
            (high - low).max(0.0) + 2.0 * reach
        };
        Cell {
            rows: S::Tensor::from_fn(|i, j| match self.periods.in_use(i) {
                Some(period) => period[j],
                None if i == j => along(i),
                None => 0.0,
            }),
        }
    }
}

/// Coordinates with zeros for the axes that the space does not have.
fn in_space(components: &[f64]) -> [f64; 3] {
    std::array::from_fn(|axis| components.get(axis).copied().unwrap_or(0.0))
}
