//! The force kernel: all contact forces of one cell, once. Nearly all time is spent here.
//!
//! Pairs are visited in key order and forces are summed in that order, so the bits depend on the contacts alone and not
//! on which non-touching pairs happen to be listed. Nothing allocates. Conventions of one contact: see
//! [`crate::network`].

use crate::lanes::{Kinematics, Tuple};
use crate::law::{ContactLaw, ContactMotion};
use crate::space::{Axial, Components, Space};

/// One grain as the kernel sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GrainSlot<S: Space> {
    /// Centre, m.
    pub(crate) position: S::Vector,
    /// Rotation since the last evaluation, rad.
    pub(crate) spin: S::Spin,
    /// Radius, m.
    pub(crate) radius: f64,
}

/// What acts on one grain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LoadSlot<S: Space> {
    /// Sum of contact forces, N.
    pub(crate) force: S::Vector,
    /// Sum of their moments about the centre, N m.
    pub(crate) moment: S::Spin,
}

/// One listed pair and its contact history.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PairSlot<S: Space, L: ContactLaw<S::Kinematics>> {
    /// Origin grain.
    pub(crate) origin: u32,
    /// End grain.
    pub(crate) end: u32,
    /// Row of the table of image translations.
    pub(crate) image: u32,
    /// 1 if the pair touched at the last evaluation, else 0. A number, because the kernel computes with it.
    pub(crate) touching: u32,
    /// Evaluations at the Coulomb limit since the counter was last cleared.
    pub(crate) limit_count: u32,
    /// Whether the contact was at the Coulomb limit in most samples of the second half of the ramp.
    pub(crate) slid: bool,
    /// What the law knows about the pair.
    pub(crate) constants: L::Constants<f64>,
    /// Unit vector from origin to end at the last evaluation, if it touched then.
    pub(crate) direction: S::Vector,
    /// Tangential force as an axial vector, N.
    pub(crate) tangential_force: Axial<S>,
    /// What the law remembers about the contact.
    pub(crate) memory: L::Memory<f64>,
}

impl<S: Space, L: ContactLaw<S::Kinematics>> PairSlot<S, L> {
    /// A listed pair that does not touch.
    pub(crate) fn new(law: &L, origin: u32, end: u32, image: u32, radii: [f64; 2]) -> Self {
        Self {
            origin,
            end,
            image,
            touching: 0,
            limit_count: 0,
            slid: false,
            constants: law.constants(radii),
            direction: S::Vector::ZERO,
            tangential_force: Tuple::zero(),
            memory: Tuple::zero(),
        }
    }

    /// Whether the pair touched at the last evaluation.
    pub(crate) fn touches(&self) -> bool {
        self.touching != 0
    }
}

/// Sums over all contacts of one evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ContactSums {
    /// Number of touching pairs.
    pub(crate) contacts: u32,
    /// Sum of |f_n|, N.
    pub(crate) normal_force: f64,
    /// Stored energy lost during the motion since the last evaluation, to friction above all, J.
    pub(crate) dissipation: f64,
}

/// Geometry of the touching pairs of one evaluation, in pair order. Working memory of the kernel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Touching<S: Space> {
    pair: Vec<u32>,
    branch: Vec<S::Vector>,
    length: Vec<f64>,
    reciprocal: Vec<f64>,
}

impl<S: Space> Touching<S> {
    /// Makes room for the contacts of `count` listed pairs.
    pub(crate) fn reserve(&mut self, count: usize) {
        self.pair.resize(count, 0);
        self.branch.resize(count, S::Vector::ZERO);
        self.length.resize(count, 0.0);
        self.reciprocal.resize(count, 0.0);
    }
}

/// Evaluates all contacts: updates the histories for the motion since the last call and sums the loads. `touching` has
/// room for all `pairs`.
pub(crate) fn evaluate<S: Space, L: ContactLaw<S::Kinematics>>(
    law: &L,
    grains: &[GrainSlot<S>],
    images: &[S::Vector],
    pairs: &mut [PairSlot<S, L>],
    touching: &mut Touching<S>,
    loads: &mut [LoadSlot<S>],
) -> ContactSums {
    loads.fill(LoadSlot::default());
    // Three passes instead of one: each has a short chain of dependent operations and no branch that depends on the
    // data, so the processor overlaps many pairs. Measured 2x faster than the fused loop; the bits are the same.
    let mut sums = ContactSums::default();
    let contacts = find_touching(law, grains, images, pairs, touching, &mut sums);
    let Touching { pair: order, branch, length, reciprocal } = touching;
    for ((length, reciprocal), branch) in
        length.iter_mut().zip(reciprocal.iter_mut()).zip(branch.iter()).take(contacts)
    {
        *length = branch.dot(*branch).sqrt();
        *reciprocal = 1.0 / *length;
    }
    let geometry = order.iter().zip(branch.iter()).zip(length.iter().zip(reciprocal.iter()));
    for ((index, branch), (length, reciprocal)) in geometry.take(contacts) {
        load_contact(law, grains, &mut pairs[*index as usize], *branch, *length, *reciprocal, loads, &mut sums);
    }
    sums.contacts = contacts as u32;
    sums
}

/// Lists the touching pairs and lets go of those that touched until now. Returns their number.
fn find_touching<S: Space, L: ContactLaw<S::Kinematics>>(
    law: &L,
    grains: &[GrainSlot<S>],
    images: &[S::Vector],
    pairs: &mut [PairSlot<S, L>],
    touching: &mut Touching<S>,
    sums: &mut ContactSums,
) -> usize {
    let mut count = 0;
    for (index, pair) in pairs.iter_mut().enumerate() {
        let (o, e) = (&grains[pair.origin as usize], &grains[pair.end as usize]);
        let branch = e.position.minus(o.position).plus(images[pair.image as usize]);
        let range = o.radius + e.radius;
        let apart = branch.dot(branch) >= range * range;
        touching.pair[count] = index as u32;
        touching.branch[count] = branch;
        count += usize::from(!apart);
        // One test that hardly ever succeeds, not two of which one is a coin toss.
        if u32::from(apart) & pair.touching != 0 {
            sums.dissipation += law.opening_loss(&pair.constants, pair.tangential_force, &pair.memory);
            pair.touching = 0;
            pair.tangential_force = Tuple::zero();
            pair.memory = Tuple::zero();
            pair.slid = false;
        }
    }
    count
}

/// Force, history and loads of one touching pair.
#[expect(clippy::too_many_arguments, reason = "the innermost loop's body; a struct would only rename the arguments")]
#[inline(always)]
fn load_contact<S: Space, L: ContactLaw<S::Kinematics>>(
    law: &L,
    grains: &[GrainSlot<S>],
    pair: &mut PairSlot<S, L>,
    branch: S::Vector,
    length: f64,
    reciprocal: f64,
    loads: &mut [LoadSlot<S>],
    sums: &mut ContactSums,
) {
    let (origin, end) = (pair.origin as usize, pair.end as usize);
    let (o, e) = (&grains[origin], &grains[end]);
    let direction = branch.times(reciprocal);
    let overlap = (o.radius + e.radius) - length;
    let arms = [o.radius - 0.5 * overlap, e.radius - 0.5 * overlap];
    let (slip, carrier) = S::slip(pair.direction, direction, length, arms, [o.spin, e.spin]);
    let rolling =
        if L::ROLLS { S::Kinematics::across(S::axial(o.spin.minus(e.spin)), direction) } else { Tuple::zero() };
    let motion = ContactMotion::<S::Kinematics, f64> {
        overlap,
        touched: pair.touches(),
        carried: S::carry(&carrier, pair.tangential_force),
        slip,
        rolling,
    };
    law.carry(&mut pair.memory, |moment| S::carry(&carrier, moment));
    let response = law.respond(&pair.constants, &motion, &mut pair.memory);

    pair.limit_count += u32::from(response.at_limit);
    sums.dissipation += response.dissipation;
    pair.touching = 1;
    pair.direction = direction;
    pair.tangential_force = response.tangential_force;

    let (mut normal_force, mut tangential_force) = (response.normal_force, response.tangential_force);
    if let Some(viscous) = response.viscous {
        normal_force += viscous.normal_force;
        tangential_force = tangential_force.plus(viscous.tangential_force);
    }
    let force = S::contact_force(direction, normal_force, S::from_axial(tangential_force, direction));
    let turning = S::spin(tangential_force);
    let on_origin = &mut loads[origin];
    on_origin.force = on_origin.force.plus(force);
    on_origin.moment = on_origin.moment.plus(turning.times(arms[0]));
    let on_end = &mut loads[end];
    on_end.force = on_end.force.minus(force);
    on_end.moment = on_end.moment.plus(turning.times(arms[1]));
    if let Some(couple) = response.couple {
        let couple = S::spin(couple);
        loads[origin].moment = loads[origin].moment.plus(couple);
        loads[end].moment = loads[end].moment.minus(couple);
    }
    sums.normal_force += response.normal_force.abs();
}
