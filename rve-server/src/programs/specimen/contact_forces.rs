//! Forces of touching contacts of a body, from their histories and their motion. Written once: for one contact, and for several side by
//! side in lanes.

use super::SpecimenSpace;
use super::contact::ContactSums;
use crate::contact::{ContactLaw, ContactMotion};
use crate::simd::{Mask, Real, Tuple};

/// Constants of a contact, and what it was at the last evaluation.
#[derive(Clone, Copy, Debug)]
pub(super) struct History<S: SpecimenSpace, C: ContactLaw<S>, R: Real> {
    /// Constants of the law.
    pub constants: C::Constants<R>,
    /// Share of the contact that belongs to the body.
    pub weight: R,
    /// Twice the damping ratio times the square root of the reduced mass.
    pub viscosity: R,
    /// Viscous part of the normal force, N.
    pub viscous_force: R,
    /// 1 if it touched, else 0.
    pub touched: R,
    /// Unit vector from origin to end grain; zero unless it touched.
    pub direction: S::Coordinates<R>,
    /// Tangential force as an axial vector, N.
    pub tangential_force: S::Axial<R>,
    /// What else the law remembers.
    pub memory: C::Memory<R>,
}

impl<S: SpecimenSpace, C: ContactLaw<S>, R: Real> History<S, C, R> {
    /// Zero everywhere.
    pub(super) fn none() -> Self {
        let zero = R::default();
        Self {
            constants: Tuple::zero(),
            weight: zero,
            viscosity: zero,
            viscous_force: zero,
            touched: zero,
            direction: Tuple::zero(),
            tangential_force: Tuple::zero(),
            memory: Tuple::zero(),
        }
    }
}

/// Relative motion of the two surfaces since the last evaluation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Approach<S: SpecimenSpace, R: Real> {
    /// Unit vector from origin to end grain.
    pub direction: S::Coordinates<R>,
    /// Overlap, m.
    pub overlap: R,
    /// Distances of the contact point from the centres, m.
    pub arms: [R; 2],
    /// Slip, m, as an axial vector.
    pub slip: S::Axial<R>,
    /// The last tangential force, turned along with the contact, N.
    pub carried: S::Axial<R>,
    /// Spin of the origin minus that of the end grain, without its part along the normal, rad.
    pub rolling: S::Axial<R>,
    /// Rate at which the overlap grows, m/s; 0 without contact viscosity.
    pub closing: R,
}

/// Two grains `branch` apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairMotion<S: SpecimenSpace, R: Real> {
    /// Radii, m.
    pub radii: [R; 2],
    /// From the origin to the end grain, m.
    pub branch: S::Coordinates<R>,
    /// Rotations since the last evaluation, rad.
    pub spins: [S::Axial<R>; 2],
    /// Velocity of the origin less that of the end grain, m/s; only contact viscosity needs it.
    pub velocity: S::Coordinates<R>,
}

impl<S: SpecimenSpace, R: Real> PairMotion<S, R> {
    /// Zero everywhere.
    pub(super) fn none() -> Self {
        let spins = [Tuple::zero(); 2];
        Self { radii: [R::default(); 2], branch: Tuple::zero(), spins, velocity: Tuple::zero() }
    }

    /// The motion of the surfaces of two touching grains. The memory is carried along.
    #[inline(always)]
    pub(super) fn approach<C: ContactLaw<S>>(
        &self,
        law: &C,
        history: &mut History<S, C, R>,
        is_viscous: bool,
    ) -> Approach<S, R> {
        let length = self.branch.dot(self.branch).sqrt();
        let reciprocal = R::splat(1.0) / length;
        let direction = self.branch.scaled(reciprocal);
        let overlap = (self.radii[0] + self.radii[1]) - length;
        let half = R::splat(0.5) * overlap;
        let arms = [self.radii[0] - half, self.radii[1] - half];
        let [origin, end] = self.spins;
        let (slip, carrier) =
            S::slip_and_turning(history.direction, direction, reciprocal, length, arms, [origin, end]);
        law.carry(
            &mut history.memory,
            #[inline(always)]
            |moment| S::carried(&carrier, moment),
        );
        Approach {
            direction,
            overlap,
            arms,
            slip,
            carried: S::carried(&carrier, history.tangential_force),
            rolling: if C::ROLLS { S::across(origin.minus(end), direction) } else { Tuple::zero() },
            closing: if is_viscous { direction.dot(self.velocity) } else { R::default() },
        }
    }
}

/// What a contact answers.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactForces<S: SpecimenSpace, C: ContactLaw<S>, R: Real> {
    /// New tangential force as an axial vector, N.
    pub tangential_force: S::Axial<R>,
    /// What else the law remembers.
    pub memory: C::Memory<R>,
    /// Elastic normal force, N, negative in compression.
    pub normal_force: R,
    /// Viscous part of the normal force, N, positive while the grains approach.
    pub viscous_force: R,
    /// The share of the body: force on the origin grain, N; the opposite acts on the end grain.
    pub force: S::Coordinates<R>,
    /// The share of the body: moments on origin and end grain, N m.
    pub moments: [S::Axial<R>; 2],
    /// The share of the body: what the contact adds to the sums over all of them.
    pub sums: ForceSums<R>,
}

/// What touching contacts add to [`ContactSums`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ForceSums<R: Real> {
    /// |f_n|, N.
    normal_force: R,
    /// Work lost to friction, J.
    dissipation: R,
    /// Work lost to contact viscosity, J.
    viscous_work: R,
    /// Stored energy, J.
    elastic_energy: R,
    /// 1 at the friction limit.
    sliding: R,
    /// Overlap over the smaller radius; the largest one is kept.
    overlap_ratio: R,
}

impl<R: Real> ForceSums<R> {
    /// Adds those of further contacts where `valid` holds.
    #[inline(always)]
    pub(super) fn add(&mut self, other: &Self, valid: R::Mask) {
        let zero = R::default();
        self.normal_force += R::select(valid, other.normal_force, zero);
        self.dissipation += R::select(valid, other.dissipation, zero);
        self.viscous_work += R::select(valid, other.viscous_work, zero);
        self.elastic_energy += R::select(valid, other.elastic_energy, zero);
        self.sliding += R::select(valid, other.sliding, zero);
        self.overlap_ratio = self.overlap_ratio.larger(R::select(valid, other.overlap_ratio, zero));
    }

    /// Adds the lanes, one after the other, to the sums over all contacts; their number apart.
    pub(super) fn add_to(&self, sums: &mut ContactSums) {
        for lane in 0..R::LANES {
            sums.normal_force += self.normal_force.lane(lane);
            sums.dissipation += self.dissipation.lane(lane);
            sums.viscous_work += self.viscous_work.lane(lane);
            sums.elastic_energy += self.elastic_energy.lane(lane);
            sums.sliding += self.sliding.lane(lane) as u64;
            sums.largest_overlap = sums.largest_overlap.max(self.overlap_ratio.lane(lane));
        }
    }
}

/// What presses the surfaces of a contact together over what does without the dashpot: friction goes with the whole. `elastic` and
/// `normal` are the normal force without and with it, N, negative in compression.
#[inline(always)]
pub(super) fn share_with_dashpot<S: SpecimenSpace, C: ContactLaw<S>, R: Real>(
    law: &C,
    constants: &C::Constants<R>,
    elastic: R,
    normal: R,
) -> R {
    let zero = R::default();
    let repulsion = law.normal_force(constants, zero) - elastic;
    zero.larger(R::select(zero.less(repulsion), (repulsion + elastic - normal) / repulsion, zero))
}

/// Forces of touching contacts after a motion of `step` seconds; `smaller_radius` is that of the two grains, m.
#[inline(always)]
pub(super) fn contact_forces<S: SpecimenSpace, C: ContactLaw<S>, R: Real>(
    law: &C,
    history: &History<S, C, R>,
    approach: &Approach<S, R>,
    smaller_radius: R,
    step: R,
    is_viscous: bool,
) -> ContactForces<S, C, R> {
    let (zero, one, half) = (R::default(), R::splat(1.0), R::splat(0.5));
    let History { constants, weight, .. } = history;
    let touched = half.less(history.touched);
    let Approach { direction, overlap, carried, slip, rolling, .. } = *approach;
    let motion = ContactMotion { overlap, touched, carried, slip, rolling };
    let elastic = law.normal_force(constants, overlap);
    let [stiffness, tangential_stiffness, _] = law.stiffness(constants, overlap);
    let (mut normal, mut limited) = (elastic, *constants);
    if is_viscous {
        // Viscosity brakes the approach and the parting, but never pulls grains together.
        let viscous = -(history.viscosity * stiffness.sqrt() * approach.closing);
        let free = elastic.larger(zero);
        let pulls = zero.less(viscous) & free.less(elastic + viscous);
        normal = R::select(pulls, free, elastic + viscous);
        limited = law.limits_scaled(constants, share_with_dashpot(law, constants, elastic, normal));
    }
    let mut memory = history.memory;
    let response = law.respond(&limited, &motion, &mut memory);
    let tangential = response.tangential_force;
    // Laws book the work of friction for a limit that changes little in a step. This one may drop to nothing: with the
    // force of the dashpot, or at the beginning of a stage with less friction.
    let cut = touched & response.at_limit & zero.less(tangential_stiffness);
    let mut dissipation = *weight * response.dissipation;
    if cut.any() {
        let attempt = carried.plus(slip.scaled(tangential_stiffness));
        let work = attempt.minus(tangential).dot(carried.minus(tangential));
        dissipation += R::select(cut, *weight * half * work / tangential_stiffness, zero);
    }
    let stored = law.energy(constants, overlap, S::length(tangential), &memory);
    // The velocity between two evaluations meets the mean of both forces: so the energy of leap-frog steps adds up.
    let viscous_force = elastic - normal;
    let viscous_work = *weight * half * (history.viscous_force + viscous_force) * approach.closing * step;
    let force = direction.scaled_plus(normal, S::turn(tangential, direction));
    let mut moments = [tangential.scaled(approach.arms[0]), tangential.scaled(approach.arms[1])];
    if let Some(couple) = response.couple {
        moments = [moments[0].plus(couple), moments[1].minus(couple)];
    }
    ContactForces {
        tangential_force: tangential,
        memory,
        normal_force: elastic,
        viscous_force,
        force: force.scaled(*weight),
        moments: [moments[0].scaled(*weight), moments[1].scaled(*weight)],
        sums: ForceSums {
            normal_force: *weight * elastic.abs(),
            dissipation,
            viscous_work,
            elastic_energy: *weight * stored,
            sliding: R::select(response.at_limit, one, zero),
            overlap_ratio: overlap / smaller_radius,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{ContactTable, LawVisitor};
    use crate::space::{Discs, Spheres};

    struct WithoutOverlap;

    impl<S: SpecimenSpace> LawVisitor<S> for WithoutOverlap {
        type Output = ();

        fn visit<C: ContactLaw<S>>(self, law: C) {
            let constants = law.constants([1.0, 1.0]);
            let memory = law.resumed(1e-6, Tuple::zero());
            let history: History<S, C, f64> =
                History { constants, weight: 1.0, viscosity: 0.4, touched: 1.0, memory, ..History::none() };
            let approach = Approach {
                direction: <S::Coordinates<f64>>::build(|axis| if axis == 0 { 1.0 } else { 0.0 }),
                overlap: 0.0,
                arms: [1.0; 2],
                slip: Tuple::zero(),
                carried: <S::Axial<f64>>::build(|axis| if axis == 0 && S::DIMENSION == 3 { 0.0 } else { 0.1 }),
                rolling: Tuple::zero(),
                closing: -0.1,
            };
            let forces = contact_forces(&law, &history, &approach, 1.0, 1e-3, true);
            let numbers =
                [forces.force.as_ref(), forces.moments[0].as_ref(), forces.tangential_force.as_ref()].concat();
            assert!(numbers.iter().all(|number| number.is_finite()), "{forces:?}");
            assert_eq!(S::length(forces.tangential_force), 0.0, "{forces:?}");
            assert!(forces.sums.dissipation.is_finite() && forces.sums.elastic_energy.is_finite(), "{forces:?}");
        }
    }

    /// Grains may touch without any overlap: the difference of radii and distance rounds to nothing. Nothing presses then, and friction
    /// bears nothing.
    #[test]
    fn contacts_without_overlap_bear_no_tangential_force() {
        let table = |text: &str| -> ContactTable { toml::from_str(text).unwrap() };
        let linear = table("law = \"linear\"\nnormal_stiffness = 1e3\nstiffness_ratio = 0.8\nfriction = 0.5");
        linear.compile::<Discs, _>(WithoutOverlap).unwrap();
        let hertz = table("law = \"hertz_mindlin\"\nshear_modulus = 1e4\npoisson_ratio = 0.2\nfriction = 0.5");
        hertz.compile::<Spheres, _>(WithoutOverlap).unwrap();
    }
}
