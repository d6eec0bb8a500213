//! Contact forces of one step of a single cell: the lanes hold several of its pairs in place of several cells.
//!
//! Neighbours in the list share a group. Constants and histories of a group stay in its lanes from one step to the next; what
//! a pair needs of its grains is collected, and what it does to them is handed out pair by pair in key order. A lane goes
//! through the operations that its pair would have gone through alone, so the bits are those of cells side by side.

use super::cells_in_lanes::{add_force, add_loads, branch_of};
use super::pair::{PairSite, pair_forces};
use super::step::{Contact, StepData, StepSums};
use crate::contact::ContactLaw;
use crate::simd::{Lanes, Mask, Real, Tuple, put_lane, take_lane};
use crate::space::KernelSpace;

/// Pairs side by side.
const WIDTH: usize = 8;

/// Groups that are collected before the first of them is worked on: numbers that have just been written one by one cannot be
/// read as a whole for a while.
const AHEAD: usize = 4;

type Packed = Lanes<WIDTH>;

/// Listed pairs of one cell in lanes, in key order: what they are, and their histories.
#[derive(Clone, Copy, Debug)]
pub struct PairGroup<K: KernelSpace, C: ContactLaw<K>> {
    /// Radii of origin and end grain, m; zero in lanes without a pair, which never touch.
    radii: [Packed; 2],
    near_square: Packed,
    constants: C::Constants<Packed>,
    contact: Contact<K, C, Packed>,
    limit_count: Packed,
    /// Whether a pair has a history.
    is_live: bool,
}

/// Inputs of a group from its grains, and its loads on them, in one step.
#[derive(Clone, Copy)]
struct PairGather<K: KernelSpace> {
    branch: K::Coordinates<Packed>,
    spins: [K::Axial<Packed>; 2],
    force: K::Coordinates<Packed>,
    moments: [K::Axial<Packed>; 2],
    /// Tangential energy lost by contacts that opened, and 1 where one has begun, if anything of that kind has happened.
    change: Option<[Packed; 2]>,
    touches: Packed,
    normal_force: Packed,
    dissipation: Packed,
    force_square: Packed,
    energy: Packed,
}

/// A group in one step.
struct GroupSite<'a, K: KernelSpace, C: ContactLaw<K>> {
    group: &'a mut PairGroup<K, C>,
    gather: &'a mut PairGather<K>,
    /// Count of an evaluation at the friction limit.
    sampling: Packed,
}

/// Puts the pairs of data with one lane into groups.
pub fn pack<K: KernelSpace, C: ContactLaw<K>, R: Real>(
    data: &StepData<'_, K, C, R>,
    groups: &mut Vec<PairGroup<K, C>>,
) {
    debug_assert_eq!(R::LANES, 1, "the lanes are for pairs");
    groups.clear();
    groups.resize(data.pairs.len().div_ceil(WIDTH), PairGroup::empty());
    for (index, constants) in data.pair_constants.iter().enumerate() {
        let (group, lane) = (&mut groups[index / WIDTH], index % WIDTH);
        put_lane::<_, f64, _, _>(&mut group.radii, lane, &constants.radii);
        group.near_square.set_lane(lane, constants.near_square);
        put_lane::<_, f64, _, _>(&mut group.constants, lane, &constants.law);
        let contact = &data.contacts[index];
        put_lane(&mut group.contact.direction, lane, &contact.direction);
        put_lane(&mut group.contact.tangential_force, lane, &contact.tangential_force);
        put_lane(&mut group.contact.memory, lane, &contact.memory);
        group.limit_count.set_lane(lane, data.limit_counts[index].lane(0));
        group.is_live |= data.live[index];
    }
}

/// Takes histories, whether there are any, and counts of the pairs out of their groups again.
pub fn unpack<K: KernelSpace, C: ContactLaw<K>, R: Real>(
    groups: &[PairGroup<K, C>],
    contacts: &mut [Contact<K, C, R>],
    live: &mut [bool],
    limit_counts: &mut [R],
) {
    let pairs = contacts.iter_mut().zip(live).zip(limit_counts);
    for (index, ((contact, live), limit_count)) in pairs.enumerate() {
        let (group, lane) = (&groups[index / WIDTH], index % WIDTH);
        *contact = Contact {
            direction: take_lane(&group.contact.direction, lane),
            tangential_force: take_lane(&group.contact.tangential_force, lane),
            memory: take_lane(&group.contact.memory, lane),
        };
        *live = group.is_live;
        *limit_count = R::splat(group.limit_count.lane(lane));
    }
}

/// Forces of all contacts, in key order, of data with one lane whose pairs are in groups. Where all grains are `BLOCKED`, spins are not
/// read and moments not summed.
#[inline(always)]
pub(super) fn load_groups<K: KernelSpace, C: ContactLaw<K>, R: Real, const BLOCKED: bool>(
    data: &mut StepData<'_, K, C, R>,
    sums: &mut StepSums<R>,
) {
    debug_assert_eq!(data.groups.len(), data.pairs.len().div_ceil(WIDTH), "pairs have been packed");
    let sampling = Packed::splat(data.sampling.lane(0));
    let mut gathers = [PairGather::<K>::empty(); AHEAD];
    let mut local = StepSums::default();
    for (groups, pairs) in data.groups.chunks_mut(AHEAD).zip(data.pairs.chunks(AHEAD * WIDTH)) {
        for (gather, pairs) in gathers.iter_mut().zip(pairs.chunks(WIDTH)) {
            if BLOCKED {
                for (lane, pair) in pairs.iter().enumerate() {
                    put_lane(&mut gather.branch, lane, &branch_of(data.grains, data.images, pair));
                }
                continue;
            }
            for (lane, pair) in pairs.iter().enumerate() {
                put_lane(&mut gather.branch, lane, &branch_of(data.grains, data.images, pair));
                put_lane(&mut gather.spins[0], lane, &data.grains[pair.origin as usize].spin);
                put_lane(&mut gather.spins[1], lane, &data.grains[pair.end as usize].spin);
            }
        }
        for ((group, gather), pairs) in groups.iter_mut().zip(&mut gathers).zip(pairs.chunks(WIDTH)) {
            let branch = gather.branch;
            let square = branch.dot(branch);
            let is_near = square.less(group.near_square).any();
            if !is_near && !group.is_live {
                continue;
            }
            group.is_live = is_near;
            let length = square.sqrt();
            gather.change = None;
            let mut site = GroupSite { group, gather, sampling };
            pair_forces(data.law, branch, length, Packed::splat(1.0) / length, data.wanted, &mut site);
            if BLOCKED {
                for (lane, pair) in pairs.iter().enumerate() {
                    add_force(data.grains, pair, take_lane(&gather.force, lane));
                    gather.add_to(&mut local, lane);
                }
            } else {
                for (lane, pair) in pairs.iter().enumerate() {
                    let moments = [take_lane(&gather.moments[0], lane), take_lane(&gather.moments[1], lane)];
                    add_loads(data.grains, pair, take_lane(&gather.force, lane), moments);
                    gather.add_to(&mut local, lane);
                }
            }
            if data.wanted.contact_force_square {
                for lane in 0..pairs.len() {
                    local.contact_force_square += R::splat(gather.force_square.lane(lane));
                }
            }
            if data.wanted.elastic_energy {
                for lane in 0..pairs.len() {
                    local.elastic_energy += R::splat(gather.energy.lane(lane));
                }
            }
            if data.wanted.virial {
                for lane in 0..pairs.len() {
                    let force: K::Coordinates<R> = take_lane(&gather.force, lane);
                    let branch: K::Coordinates<R> = take_lane(&gather.branch, lane);
                    local.add_virial(force.as_ref(), branch.as_ref());
                }
            }
        }
    }
    *sums = local;
}

impl<K: KernelSpace, C: ContactLaw<K>> PairGroup<K, C> {
    fn empty() -> Self {
        let zero = Packed::default();
        Self {
            radii: [zero; 2],
            near_square: zero,
            constants: Tuple::zero(),
            contact: Contact::none(),
            limit_count: zero,
            is_live: false,
        }
    }
}

impl<K: KernelSpace> PairGather<K> {
    #[inline(always)]
    fn empty() -> Self {
        let (zero, one) = (Packed::default(), Packed::splat(1.0));
        Self {
            branch: Tuple::filled(one),
            spins: [Tuple::zero(); 2],
            force: Tuple::zero(),
            moments: [Tuple::zero(); 2],
            change: None,
            touches: zero,
            normal_force: zero,
            dissipation: zero,
            force_square: zero,
            energy: zero,
        }
    }

    /// Adds what every evaluation sums up.
    #[inline(always)]
    fn add_to<R: Real>(&self, sums: &mut StepSums<R>, lane: usize) {
        let of = |value: &Packed| R::splat(value.lane(lane));
        sums.contacts += of(&self.touches);
        sums.normal_force += of(&self.normal_force);
        sums.dissipation += of(&self.dissipation);
        if let Some([opening_loss, new_contacts]) = &self.change {
            sums.opening_loss += of(opening_loss);
            sums.new_contacts += of(new_contacts);
        }
    }
}

impl<K: KernelSpace, C: ContactLaw<K>> PairSite<K, C, Packed> for GroupSite<'_, K, C> {
    #[inline(always)]
    fn radii(&self) -> [Packed; 2] {
        self.group.radii
    }

    #[inline(always)]
    fn constants(&self) -> C::Constants<Packed> {
        self.group.constants
    }

    #[inline(always)]
    fn contact(&self) -> &Contact<K, C, Packed> {
        &self.group.contact
    }

    #[inline(always)]
    fn spins(&self) -> [K::Axial<Packed>; 2] {
        self.gather.spins
    }

    #[inline(always)]
    fn change(&mut self, opened: <Packed as Real>::Mask, loss: Packed, new_contacts: Packed) {
        self.gather.change = Some([loss, new_contacts]);
        self.group.limit_count = Packed::select(opened, Packed::default(), self.group.limit_count);
    }

    #[inline(always)]
    fn keep(&mut self, contact: Contact<K, C, Packed>) {
        self.group.contact = contact;
    }

    #[inline(always)]
    fn load(&mut self, force: K::Coordinates<Packed>, moments: [K::Axial<Packed>; 2]) {
        (self.gather.force, self.gather.moments) = (force, moments);
    }

    #[inline(always)]
    fn add(&mut self, touches: Packed, normal_force: Packed, dissipation: Packed) {
        self.gather.touches = touches;
        self.gather.normal_force = normal_force;
        self.gather.dissipation = dissipation;
    }

    #[inline(always)]
    fn add_at_limit(&mut self, at_limit: Packed) {
        self.group.limit_count += at_limit * self.sampling;
    }

    #[inline(always)]
    fn add_force_square(&mut self, square: Packed) {
        self.gather.force_square = square;
    }

    #[inline(always)]
    fn add_energy(&mut self, energy: Packed) {
        self.gather.energy = energy;
    }

    /// The gather holds both already.
    #[inline(always)]
    fn add_virial(&mut self, _: K::Coordinates<Packed>, _: K::Coordinates<Packed>) {}
}
