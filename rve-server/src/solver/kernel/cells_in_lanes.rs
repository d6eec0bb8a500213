//! Contact forces of one step of several cells side by side. Nearly all time is spent here.
//!
//! Pairs are visited in key order and forces are added in that order, accumulators start at +0.0 (so that the +0.0 of a pair
//! that does not touch changes nothing). The bits of a lane therefore depend on its own contacts alone: not on the pairs that
//! are listed next to them, not on the other lanes. Nothing allocates.

use super::pair::{PairSite, pair_forces};
use super::pairs_in_lanes::load_groups;
use super::step::{Contact, Grain, ListedPair, PairConstants, StepData, StepSums};
use crate::contact::ContactLaw;
use crate::simd::{Mask, Real, Tuple};
use crate::space::KernelSpace;

/// Pairs that are sifted before any of their forces. Two passes instead of one: each has a short chain of dependent
/// operations, so the processor overlaps many pairs; the chain through square root, quotient and law would let it overlap few.
const BLOCK: usize = 32;

/// Geometry of a pair that may touch in some lane, or has a history in one.
#[derive(Clone, Copy)]
struct Near<K: KernelSpace, R: Real> {
    index: usize,
    /// Whether it may touch now.
    is_near: bool,
    branch: K::Coordinates<R>,
    /// Square of its length, m2.
    square: R,
}

/// A listed pair in all lanes.
struct InLanes<'a, 'b, K: KernelSpace, C: ContactLaw<K>, R: Real> {
    data: &'a mut StepData<'b, K, C, R>,
    index: usize,
    pair: ListedPair,
    sums: &'a mut StepSums<R>,
}

/// Forces of all contacts, in key order. Those of a single cell are in groups if `PAIRS_IN_LANES`.
#[inline(always)]
pub(super) fn load_pairs<K: KernelSpace, C: ContactLaw<K>, R: Real, const PAIRS_IN_LANES: bool>(
    data: &mut StepData<'_, K, C, R>,
    sums: &mut StepSums<R>,
) {
    if R::LANES == 1 && PAIRS_IN_LANES {
        // Two functions: a test for each group would cost all other cells 1 % of their instructions.
        return if data.wanted.blocked {
            load_groups::<K, C, R, true>(data, sums)
        } else {
            load_groups::<K, C, R, false>(data, sums)
        };
    }
    let nowhere = Near { index: 0, is_near: false, branch: Tuple::zero(), square: R::default() };
    let mut near = [nowhere; BLOCK];
    let mut local = StepSums::default();
    let mut start = 0;
    while start < data.pairs.len() {
        let stop = (start + BLOCK).min(data.pairs.len());
        let count = find_near(data, start, stop, &mut near);
        // The root of the next pair is under way while the present one is worked on. The quotient is not put off into memory:
        // the compiler would take it apart into single numbers there.
        let mut next_length = near[0].square.sqrt();
        for place in 0..count {
            let Near { index, is_near, branch, .. } = near[place];
            let length = next_length;
            let reciprocal = R::splat(1.0) / length;
            next_length = near[(place + 1) % BLOCK].square.sqrt();
            let (law, wanted, pair) = (data.law, data.wanted, data.pairs[index]);
            data.live[index] = is_near;
            let mut site = InLanes { data, index, pair, sums: &mut local };
            pair_forces(law, branch, length, reciprocal, wanted, &mut site);
        }
        start = stop;
    }
    *sums = local;
}

/// Branch vector of a listed pair, m.
#[inline(always)]
pub(super) fn branch_of<K: KernelSpace, R: Real>(
    grains: &[Grain<K, R>],
    images: &[K::Coordinates<R>],
    pair: &ListedPair,
) -> K::Coordinates<R> {
    let (origin, end) = (&grains[pair.origin as usize], &grains[pair.end as usize]);
    end.position.minus(origin.position).plus(images[pair.image as usize])
}

/// Lists the pairs `start..stop` that may touch in some lane, and those that a lane has a history of: they are let go in
/// key order with the others, so that sums over openings have one order. Returns their number.
#[inline(always)]
fn find_near<K: KernelSpace, C: ContactLaw<K>, R: Real>(
    data: &StepData<'_, K, C, R>,
    start: usize,
    stop: usize,
    near: &mut [Near<K, R>; BLOCK],
) -> usize {
    let mut count = 0;
    let listed = data.pairs[start..stop].iter().zip(&data.pair_constants[start..stop]);
    for (offset, (pair, constants)) in listed.enumerate() {
        let branch = branch_of(data.grains, data.images, pair);
        let square = branch.dot(branch);
        let index = start + offset;
        let is_near = square.less(R::splat(constants.near_square)).any();
        if is_near || data.live[index] {
            near[count] = Near { index, is_near, branch, square };
            count += 1;
        }
    }
    count
}

impl<K: KernelSpace, C: ContactLaw<K>, R: Real> PairSite<K, C, R> for InLanes<'_, '_, K, C, R> {
    #[inline(always)]
    fn radii(&self) -> [R; 2] {
        let radii = self.data.pair_constants[self.index].radii;
        [R::splat(radii[0]), R::splat(radii[1])]
    }

    #[inline(always)]
    fn constants(&self) -> C::Constants<R> {
        spread::<K, C, R>(&self.data.pair_constants[self.index])
    }

    #[inline(always)]
    fn contact(&self) -> &Contact<K, C, R> {
        &self.data.contacts[self.index]
    }

    #[inline(always)]
    fn spins(&self) -> [K::Axial<R>; 2] {
        [self.data.grains[self.pair.origin as usize].spin, self.data.grains[self.pair.end as usize].spin]
    }

    #[inline(always)]
    fn change(&mut self, opened: R::Mask, loss: R, new_contacts: R) {
        self.sums.opening_loss += loss;
        self.sums.new_contacts += new_contacts;
        let count = &mut self.data.limit_counts[self.index];
        *count = R::select(opened, R::default(), *count);
    }

    #[inline(always)]
    fn keep(&mut self, contact: Contact<K, C, R>) {
        self.data.contacts[self.index] = contact;
    }

    #[inline(always)]
    fn load(&mut self, force: K::Coordinates<R>, moments: [K::Axial<R>; 2]) {
        add_loads(self.data.grains, &self.pair, force, moments);
    }

    #[inline(always)]
    fn add(&mut self, touches: R, normal_force: R, dissipation: R) {
        self.sums.contacts += touches;
        self.sums.normal_force += normal_force;
        self.sums.dissipation += dissipation;
    }

    #[inline(always)]
    fn add_at_limit(&mut self, at_limit: R) {
        self.data.limit_counts[self.index] += at_limit * self.data.sampling;
    }

    #[inline(always)]
    fn add_force_square(&mut self, square: R) {
        self.sums.contact_force_square += square;
    }

    #[inline(always)]
    fn add_energy(&mut self, energy: R) {
        self.sums.elastic_energy += energy;
    }

    #[inline(always)]
    fn add_virial(&mut self, force: K::Coordinates<R>, branch: K::Coordinates<R>) {
        self.sums.add_virial(force.as_ref(), branch.as_ref());
    }
}

/// Adds a force to the origin grain and its opposite to the end grain.
#[inline(always)]
pub(super) fn add_force<K: KernelSpace, R: Real>(
    grains: &mut [Grain<K, R>],
    pair: &ListedPair,
    force: K::Coordinates<R>,
) {
    let origin = &mut grains[pair.origin as usize];
    origin.force = origin.force.plus(force);
    let end = &mut grains[pair.end as usize];
    end.force = end.force.minus(force);
}

/// Adds force and moments to both grains.
#[inline(always)]
pub(super) fn add_loads<K: KernelSpace, R: Real>(
    grains: &mut [Grain<K, R>],
    pair: &ListedPair,
    force: K::Coordinates<R>,
    moments: [K::Axial<R>; 2],
) {
    let origin = &mut grains[pair.origin as usize];
    origin.force = origin.force.plus(force);
    origin.moment = origin.moment.plus(moments[0]);
    let end = &mut grains[pair.end as usize];
    end.force = end.force.minus(force);
    end.moment = end.moment.plus(moments[1]);
}

/// Constants of a pair in every lane.
#[inline(always)]
pub(in crate::solver) fn spread<K: KernelSpace, C: ContactLaw<K>, R: Real>(
    constants: &PairConstants<K, C>,
) -> C::Constants<R> {
    <C::Constants<R>>::build(
        #[inline(always)]
        |i| R::splat(constants.law.as_ref()[i]),
    )
}
