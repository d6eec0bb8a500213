//! One explicit step of one cell, or of several cells side by side: what it reads and writes, and what it does with grains.
//! Contacts: `cells_in_lanes` and `pairs_in_lanes`.
//!
//! Grains are summed in their order, accumulators start at +0.0. The bits of a lane depend on its own grains alone. Nothing
//! allocates.

use super::pairs_in_lanes::PairGroup;
use crate::contact::ContactLaw;
use crate::simd::{Real, Tuple};
use crate::space::KernelSpace;

/// Squared motion per step, m2 or rad2, below which a grain is put to rest: products of numbers so small become
/// subnormal, and those cost a hundred times more.
const REST: f64 = 1e-280;

/// One grain in all lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Grain<K: KernelSpace, R: Real> {
    /// Centre, m.
    pub position: K::Coordinates<R>,
    /// Motion against the affine motion of the cell in the last step, m.
    pub velocity: K::Coordinates<R>,
    /// Rotation in the last step, rad.
    pub spin: K::Axial<R>,
    /// Sum of all rotations, rad.
    pub turned: K::Axial<R>,
    /// Sum of contact forces, N.
    pub force: K::Coordinates<R>,
    /// Sum of their moments about the centre, N m.
    pub moment: K::Axial<R>,
}

/// Constants of a grain, the same in all lanes because the cells of a batch share their packing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GrainConstants {
    /// Inertia of translation per unit of the lane's mass.
    pub mass: f64,
    /// 1 / `mass`.
    pub inverse_mass: f64,
    /// Inertia of rotation, m2, per unit of the lane's mass; 0 for blocked grains.
    pub rotation: f64,
    /// 1 / `rotation`; 0 for blocked grains.
    pub inverse_rotation: f64,
    /// 1 / radius, 1/m; 0 for blocked grains.
    pub inverse_radius: f64,
}

/// A listed pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ListedPair {
    /// Origin grain.
    pub origin: u32,
    /// End grain.
    pub end: u32,
    /// Row of the table of image translations.
    pub image: u32,
}

/// Constants of a pair, the same in all lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairConstants<K: KernelSpace, C: ContactLaw<K>> {
    /// Radii of origin and end grain, m.
    pub radii: [f64; 2],
    /// No pair whose branch vector has a larger square than this touches, m2.
    pub near_square: f64,
    /// Constants of the law.
    pub law: C::Constants<f64>,
}

/// History of one pair in all lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Contact<K: KernelSpace, C: ContactLaw<K>, R: Real> {
    /// Unit vector from origin to end at the last evaluation; zero if the pair did not touch then.
    pub direction: K::Coordinates<R>,
    /// Tangential force as an axial vector, N.
    pub tangential_force: K::Axial<R>,
    /// Memory of the law.
    pub memory: C::Memory<R>,
}

/// How the lanes move in one step.
#[derive(Clone, Copy, Debug)]
pub struct Steering<K: KernelSpace, R: Real> {
    /// Rows of the affine motion of the cell in this step; rows beyond the dimension are not used.
    pub affine: [K::Coordinates<R>; 3],
    /// Factor of the old velocity.
    pub keep: R,
    /// Factor of force over relative mass, 1 / N per unit.
    pub push: R,
    /// Coefficient of local damping, 0 for none.
    pub local: f64,
}

/// Which extras an evaluation sums up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Count the evaluations at the friction limit.
    pub limit_counts: bool,
    /// Sum the squares of the contact forces.
    pub contact_force_square: bool,
    /// Sum the stored energy.
    pub elastic_energy: bool,
    /// Sum the products of contact forces and branch vectors.
    pub virial: bool,
    /// Sum the work of the old forces on the step just made.
    pub old_power: bool,
    /// No grain rotates: a single cell, with its pairs in lanes, reads no spins and sums no moments. The constants of the grains make both
    /// count for nothing, so no result depends on it.
    pub blocked: bool,
}

/// Sums over the grains of one move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MoveSums<R: Real> {
    /// Square of the longest motion against the affine motion, m2.
    pub farthest_square: R,
    /// Sum of force before the move times motion in the move, J; only if wanted.
    pub old_power: R,
}

/// Sums over the contacts and grains of one evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepSums<R: Real> {
    /// Number of touching pairs.
    pub contacts: R,
    /// Sum of |f_n|, N.
    pub normal_force: R,
    /// Work lost to friction during the step, J.
    pub dissipation: R,
    /// Tangential energy lost by contacts that opened in the step, J.
    pub opening_loss: R,
    /// Sum of squared contact forces, N2; only if wanted.
    pub contact_force_square: R,
    /// Energy stored in the contacts, J; only if wanted.
    pub elastic_energy: R,
    /// Sum of contact force (on the origin grain, viscous forces included) times branch vector, N m, by rows; only if wanted. Tension is positive.
    pub virial: [R; 9],
    /// Number of pairs that have begun to touch.
    pub new_contacts: R,
    /// Largest of |F|^2 and (M / R)^2, N2.
    pub largest_force_square: R,
    /// Sum of |F|^2 + (M / R)^2, N2.
    pub force_square: R,
    /// Sum of F.v + M.w, J.
    pub power: R,
    /// Sum of |F|^2 / m + |M|^2 / I per unit of the lane's mass.
    pub scaled_force_square: R,
    /// Sum of m |v|^2 + I |w|^2 per unit of the lane's mass: twice the kinetic energy.
    pub motion_square: R,
}

/// Everything that a move or an evaluation reads and writes.
#[derive(Debug)]
pub struct StepData<'a, K: KernelSpace, C: ContactLaw<K>, R: Real> {
    /// The contact law.
    pub law: &'a C,
    /// Constants of the grains.
    pub grain_constants: &'a [GrainConstants],
    /// The grains.
    pub grains: &'a mut [Grain<K, R>],
    /// Listed pairs in key order.
    pub pairs: &'a [ListedPair],
    /// Constants of the pairs.
    pub pair_constants: &'a [PairConstants<K, C>],
    /// Histories of the pairs; those of a single cell are in `groups` where these are filled.
    pub contacts: &'a mut [Contact<K, C, R>],
    /// The pairs of a single cell with their histories; empty for several cells.
    pub groups: &'a mut [PairGroup<K, C>],
    /// Whether a pair has a history in some lane.
    pub live: &'a mut [bool],
    /// Evaluations at the friction limit per pair, weighted; starts from zero when a contact opens.
    pub limit_counts: &'a mut [R],
    /// Count of an evaluation at the limit in each lane: 1 while sampling, else 0.
    pub sampling: R,
    /// Translations of the periodic images, m.
    pub images: &'a [K::Coordinates<R>],
    /// Extras to sum up.
    pub wanted: Wanted,
}

impl Wanted {
    /// Whether a pair has more to sum up than every evaluation does: one test in place of three.
    #[inline(always)]
    pub(super) fn has_extra_pair_sums(self) -> bool {
        self.contact_force_square | self.elastic_energy | self.virial
    }
}

impl<R: Real> MoveSums<R> {
    /// Sums that no run goes on with.
    pub(super) fn not_finite() -> Self {
        Self { farthest_square: R::splat(f64::NAN), ..Self::default() }
    }
}

impl<R: Real> StepSums<R> {
    /// Adds the product of a contact's force and branch vector.
    #[inline(always)]
    pub(super) fn add_virial(&mut self, force: &[R], branch: &[R]) {
        for (row, force) in force.iter().enumerate() {
            for (column, along) in branch.iter().enumerate() {
                self.virial[row * branch.len() + column] += *force * *along;
            }
        }
    }

    /// Sums that no run goes on with.
    pub(super) fn not_finite() -> Self {
        Self { force_square: R::splat(f64::NAN), motion_square: R::splat(f64::NAN), ..Self::default() }
    }

    /// The sums of one lane.
    pub fn lane(&self, lane: usize) -> StepSums<f64> {
        StepSums {
            contacts: self.contacts.lane(lane),
            normal_force: self.normal_force.lane(lane),
            dissipation: self.dissipation.lane(lane),
            opening_loss: self.opening_loss.lane(lane),
            contact_force_square: self.contact_force_square.lane(lane),
            elastic_energy: self.elastic_energy.lane(lane),
            virial: std::array::from_fn(|place| self.virial[place].lane(lane)),
            new_contacts: self.new_contacts.lane(lane),
            largest_force_square: self.largest_force_square.lane(lane),
            force_square: self.force_square.lane(lane),
            power: self.power.lane(lane),
            scaled_force_square: self.scaled_force_square.lane(lane),
            motion_square: self.motion_square.lane(lane),
        }
    }
}

impl<K: KernelSpace, C: ContactLaw<K>> PairConstants<K, C> {
    /// Those of two grains with these radii, m.
    pub fn new(law: &C, radii: [f64; 2]) -> Self {
        let range = radii[0] + radii[1];
        // A touch more than the square: whether a pair touches is decided by its overlap alone.
        Self { radii, near_square: range * range * (1.0 + 1e-14), law: law.constants(radii) }
    }
}

impl<K: KernelSpace, C: ContactLaw<K>, R: Real> Contact<K, C, R> {
    /// A pair that does not touch.
    pub fn none() -> Self {
        Self { direction: Tuple::zero(), tangential_force: Tuple::zero(), memory: Tuple::zero() }
    }
}

/// Moves one grain by `affine x + v` after its velocities have been kicked by its loads, and clears the loads.
#[inline(always)]
pub(super) fn kick_grain<K: KernelSpace, R: Real>(
    grain: &mut Grain<K, R>,
    constants: &GrainConstants,
    steering: &Steering<K, R>,
    old_power: bool,
    sums: &mut MoveSums<R>,
) {
    let (mut force, mut moment) = (grain.force, grain.moment);
    if steering.local != 0.0 {
        force = locally_damped(steering.local, force, grain.velocity);
        moment = locally_damped(steering.local, moment, grain.spin);
    }
    let push = steering.push * R::splat(constants.inverse_mass);
    let velocity = at_rest(force.scaled_plus(push, grain.velocity.scaled(steering.keep)));
    let torque = steering.push * R::splat(constants.inverse_rotation);
    let spin = at_rest(moment.scaled_plus(torque, grain.spin.scaled(steering.keep)));
    let old = grain.position;
    let position = K::Coordinates::build(
        #[inline(always)]
        |i| {
            let (x, v) = (old.as_ref()[i], velocity.as_ref()[i]);
            x + (steering.affine[i].dot(old) + v)
        },
    );
    if old_power {
        sums.old_power += grain.force.dot(velocity) + grain.moment.dot(spin);
    }
    sums.farthest_square = sums.farthest_square.larger(velocity.dot(velocity));
    grain.position = position;
    grain.velocity = velocity;
    grain.spin = spin;
    grain.turned = grain.turned.plus(spin);
    grain.force = Tuple::zero();
    grain.moment = Tuple::zero();
}

#[inline(always)]
fn at_rest<R: Real, T: Tuple<R>>(motion: T) -> T {
    motion.where_or(R::splat(REST).less(motion.dot(motion)), T::zero())
}

/// Each component loses a share of its size against the sign of its velocity.
#[inline(always)]
fn locally_damped<R: Real, T: Tuple<R>>(coefficient: f64, load: T, velocity: T) -> T {
    let zero = R::default();
    load.zip(
        velocity,
        #[inline(always)]
        |force, motion| {
            let loss = force.abs() * R::splat(coefficient);
            let loss = R::select(motion.less(zero), -loss, R::select(zero.less(motion), loss, zero));
            force - loss
        },
    )
}

#[inline(always)]
pub(super) fn sum_grain<K: KernelSpace, R: Real>(
    grain: &Grain<K, R>,
    constants: &GrainConstants,
    sums: &mut StepSums<R>,
) {
    let force_square = grain.force.dot(grain.force);
    let moment_square = grain.moment.dot(grain.moment);
    let per_radius = R::splat(constants.inverse_radius);
    let turning = moment_square * (per_radius * per_radius);
    sums.largest_force_square = sums.largest_force_square.larger(force_square).larger(turning);
    sums.force_square += force_square + turning;
    sums.power += grain.force.dot(grain.velocity) + grain.moment.dot(grain.spin);
    sums.scaled_force_square +=
        force_square.mul_add(R::splat(constants.inverse_mass), moment_square * R::splat(constants.inverse_rotation));
    sums.motion_square += grain
        .velocity
        .dot(grain.velocity)
        .mul_add(R::splat(constants.mass), grain.spin.dot(grain.spin) * R::splat(constants.rotation));
}
