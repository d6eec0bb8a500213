//! Contact forces of one step of a single cell: the lanes hold several of its pairs in place of several cells.
//!
//! Pairs that may touch are collected in key order, worked on side by side, and what they give is added one by one in key
//! order. A lane goes through the operations that its pair would have gone through alone, so the bits are those of cells side
//! by side.

use super::array::Lanes;
use super::contacts::{add_loads, branch_of};
use super::kernel::{Contact, StepData, StepSums};
use super::kinematics::Kinematics;
use super::pair::{PairSite, press};
use super::real::{Mask, Real};
use super::tuple::Tuple;
use crate::law::ContactLaw;

/// Pairs side by side.
const ABREAST: usize = 8;

/// Groups of pairs collected before the first of them is worked on: numbers that have just been written one by one cannot be
/// read as a whole for a while.
const GROUPS: usize = 4;

type Packed = Lanes<ABREAST>;

/// Pairs in lanes, and what has become of them.
#[derive(Clone, Copy)]
struct Group<K: Kinematics, C: ContactLaw<K>> {
    branch: K::Coordinates<Packed>,
    radii: [Packed; 2],
    constants: C::Constants<Packed>,
    contact: Contact<K, C, Packed>,
    spins: [K::Axial<Packed>; 2],
    /// Whether a contact has opened or begun in some lane.
    has_changed: bool,
    opened: <Packed as Real>::Mask,
    opening_loss: Packed,
    births: Packed,
    force: K::Coordinates<Packed>,
    moments: [K::Axial<Packed>; 2],
    touches: Packed,
    normal_force: Packed,
    dissipation: Packed,
    at_limit: Packed,
    force_square: Packed,
    energy: Packed,
}

/// Forces of all contacts, in key order, of data with one lane.
#[inline(always)]
pub(super) fn load_pairs_abreast<K: Kinematics, C: ContactLaw<K>, R: Real>(
    data: &mut StepData<'_, K, C, R>,
    sums: &mut StepSums<R>,
) {
    debug_assert_eq!(R::LANES, 1, "the lanes are for pairs");
    let mut groups = [Group::<K, C>::empty(); GROUPS];
    let mut members = [(0, false); GROUPS * ABREAST];
    let mut local = StepSums::default();
    let mut next = 0;
    while next < data.pairs.len() {
        let mut count = 0;
        while next < data.pairs.len() && count < members.len() {
            let branch = branch_of(data.grains, data.images, &data.pairs[next]);
            let is_near = branch.dot(branch).less(R::splat(data.pair_constants[next].near_square)).any();
            if is_near || data.live[next] {
                members[count] = (next, is_near);
                groups[count / ABREAST].put(data, next, branch, count % ABREAST);
                count += 1;
            }
            next += 1;
        }
        for (group, members) in groups.iter_mut().zip(members[..count].chunks(ABREAST)) {
            let branch = group.branch;
            let length = branch.dot(branch).sqrt();
            group.has_changed = false;
            press(data.law, branch, length, Packed::splat(1.0) / length, data.wanted, group);
            for (lane, (index, is_near)) in members.iter().enumerate() {
                data.live[*index] = *is_near;
                group.take(data, *index, lane, &mut local);
            }
        }
    }
    *sums = local;
}

impl<K: Kinematics, C: ContactLaw<K>> Group<K, C> {
    #[inline(always)]
    fn empty() -> Self {
        let (zero, one) = (Packed::default(), Packed::splat(1.0));
        Self {
            branch: Tuple::filled(one),
            radii: [one; 2],
            constants: Tuple::filled(one),
            contact: Contact::none(),
            spins: [Tuple::zero(); 2],
            has_changed: false,
            opened: Mask::splat(false),
            opening_loss: zero,
            births: zero,
            force: Tuple::zero(),
            moments: [Tuple::zero(); 2],
            touches: zero,
            normal_force: zero,
            dissipation: zero,
            at_limit: zero,
            force_square: zero,
            energy: zero,
        }
    }

    /// Puts a pair into a lane.
    #[inline(always)]
    fn put<R: Real>(&mut self, data: &StepData<'_, K, C, R>, index: usize, branch: K::Coordinates<R>, lane: usize) {
        let (pair, constants, contact) = (&data.pairs[index], &data.pair_constants[index], &data.contacts[index]);
        put(&mut self.branch, lane, &branch);
        put::<f64, _, _>(&mut self.radii, lane, &constants.radii);
        put::<f64, _, _>(&mut self.constants, lane, &constants.law);
        put(&mut self.contact.direction, lane, &contact.direction);
        put(&mut self.contact.tangential_force, lane, &contact.tangential_force);
        put(&mut self.contact.memory, lane, &contact.memory);
        put(&mut self.spins[0], lane, &data.grains[pair.origin as usize].spin);
        put(&mut self.spins[1], lane, &data.grains[pair.end as usize].spin);
    }

    /// Takes what has become of a pair out of a lane.
    #[inline(always)]
    fn take<R: Real>(&self, data: &mut StepData<'_, K, C, R>, index: usize, lane: usize, sums: &mut StepSums<R>) {
        let of = |value: &Packed| R::splat(value.lane(lane));
        if self.has_changed {
            sums.opening_loss += of(&self.opening_loss);
            sums.births += of(&self.births);
            if self.opened.lane(lane) {
                data.limit_counts[index] = R::default();
            }
        }
        data.contacts[index] = Contact {
            direction: get(&self.contact.direction, lane),
            tangential_force: get(&self.contact.tangential_force, lane),
            memory: get(&self.contact.memory, lane),
        };
        let pair = data.pairs[index];
        let moments = [get(&self.moments[0], lane), get(&self.moments[1], lane)];
        add_loads(data.grains, &pair, get(&self.force, lane), moments);
        sums.contacts += of(&self.touches);
        sums.normal_force += of(&self.normal_force);
        sums.dissipation += of(&self.dissipation);
        if data.wanted.limit_counts {
            data.limit_counts[index] += of(&self.at_limit) * data.sampling;
        }
        if data.wanted.contact_force_square {
            sums.contact_force_square += of(&self.force_square);
        }
        if data.wanted.elastic_energy {
            sums.elastic_energy += of(&self.energy);
        }
    }
}

impl<K: Kinematics, C: ContactLaw<K>> PairSite<K, C, Packed> for Group<K, C> {
    #[inline(always)]
    fn radii(&self) -> [Packed; 2] {
        self.radii
    }

    #[inline(always)]
    fn constants(&self) -> C::Constants<Packed> {
        self.constants
    }

    #[inline(always)]
    fn contact(&self) -> &Contact<K, C, Packed> {
        &self.contact
    }

    #[inline(always)]
    fn spins(&self) -> [K::Axial<Packed>; 2] {
        self.spins
    }

    #[inline(always)]
    fn change(&mut self, opened: <Packed as Real>::Mask, loss: Packed, births: Packed) {
        self.has_changed = true;
        (self.opened, self.opening_loss, self.births) = (opened, loss, births);
    }

    #[inline(always)]
    fn keep(&mut self, contact: Contact<K, C, Packed>) {
        self.contact = contact;
    }

    #[inline(always)]
    fn load(&mut self, force: K::Coordinates<Packed>, moments: [K::Axial<Packed>; 2]) {
        (self.force, self.moments) = (force, moments);
    }

    #[inline(always)]
    fn add(&mut self, touches: Packed, normal_force: Packed, dissipation: Packed) {
        (self.touches, self.normal_force, self.dissipation) = (touches, normal_force, dissipation);
    }

    #[inline(always)]
    fn add_at_limit(&mut self, at_limit: Packed) {
        self.at_limit = at_limit;
    }

    #[inline(always)]
    fn add_force_square(&mut self, square: Packed) {
        self.force_square = square;
    }

    #[inline(always)]
    fn add_energy(&mut self, energy: Packed) {
        self.energy = energy;
    }
}

/// Sets one lane of a tuple.
#[inline(always)]
fn put<R: Real, P: Tuple<Packed>, T: Tuple<R>>(tuple: &mut P, lane: usize, given: &T) {
    for (value, given) in tuple.as_mut().iter_mut().zip(given.as_ref()) {
        value.set_lane(lane, given.lane(0));
    }
}

/// One lane of a tuple.
#[inline(always)]
fn get<R: Real, P: Tuple<Packed>, T: Tuple<R>>(tuple: &P, lane: usize) -> T {
    T::build(
        #[inline(always)]
        |i| R::splat(tuple.as_ref()[i].lane(lane)),
    )
}
