//! One near pair: from its geometry and history to forces, moments and the new history. Written once, for a pair of several
//! cells side by side and for several pairs of one cell.

use super::step::{Contact, Wanted};
use crate::contact::{ContactLaw, ContactMotion, ContactResponse};
use crate::simd::{Mask, Real, Tuple};
use crate::space::KernelSpace;

/// Where a pair's numbers come from and go to.
pub(in crate::solver) trait PairSite<K: KernelSpace, C: ContactLaw<K>, R: Real> {
    /// Radii of origin and end grain, m.
    fn radii(&self) -> [R; 2];

    /// Constants of the law.
    fn constants(&self) -> C::Constants<R>;

    /// History up to the last evaluation.
    fn contact(&self) -> &Contact<K, C, R>;

    /// Rotations of origin and end grain in the last step, rad.
    fn spins(&self) -> [K::Axial<R>; 2];

    /// A contact has opened or begun somewhere: where it has opened, the tangential energy lost there, J, and 1 where one has begun.
    fn change(&mut self, opened: R::Mask, loss: R, new_contacts: R);

    /// What the law was asked and has answered, also where the pair does not touch. Most sites have no use for it.
    #[inline(always)]
    fn answered(&mut self, _: &ContactMotion<K, R>, _: &ContactResponse<K, R>) {}

    /// The new history.
    fn keep(&mut self, contact: Contact<K, C, R>);

    /// Force on the origin grain, N, whose opposite acts on the end grain, and moments on both, N m.
    fn load(&mut self, force: K::Coordinates<R>, moments: [K::Axial<R>; 2]);

    /// Sums of every evaluation: 1 where the pair touches, |f_n|, N, work lost to friction, J.
    fn add(&mut self, touches: R, normal_force: R, dissipation: R);

    /// 1 where the pair is at the friction limit; only if wanted.
    fn add_at_limit(&mut self, at_limit: R);

    /// Square of the contact force, N2; only if wanted.
    fn add_force_square(&mut self, square: R);

    /// Stored energy, J; only if wanted.
    fn add_energy(&mut self, energy: R);

    /// Force on the origin grain, N, and branch vector, m; only if wanted.
    fn add_virial(&mut self, force: K::Coordinates<R>, branch: K::Coordinates<R>);
}

/// Force, history and loads of one pair with this branch vector, its length and one over it.
#[inline(always)]
pub(in crate::solver) fn pair_forces<K: KernelSpace, C: ContactLaw<K>, R: Real>(
    law: &C,
    branch: K::Coordinates<R>,
    length: R,
    reciprocal: R,
    wanted: Wanted,
    site: &mut impl PairSite<K, C, R>,
) {
    let (zero, one) = (R::default(), R::splat(1.0));
    let radii = site.radii();
    let direction = branch.scaled(reciprocal);
    let overlap = (radii[0] + radii[1]) - length;
    let touching = zero.less(overlap);
    let half = R::splat(0.5) * overlap;
    let arms = [radii[0] - half, radii[1] - half];
    let constants = site.constants();
    let before = site.contact().direction;
    let touched = R::splat(0.5).less(before.dot(before));
    let opened = touched & !touching;
    let born = touching & !touched;
    // One test for both: it costs more than either sum, and neither happens often.
    if (opened | born).any() {
        let contact = site.contact();
        let loss = law.opening_loss(&constants, contact.tangential_force, &contact.memory);
        site.change(opened, R::select(opened, loss, zero), R::select(born, one, zero));
    }
    let spins = site.spins();
    let (slip, carrier) = K::slip_and_turning(before, direction, reciprocal, length, arms, spins);
    let rolling = if C::ROLLS { K::across(spins[0].minus(spins[1]), direction) } else { Tuple::zero() };
    let carried = K::carried(&carrier, site.contact().tangential_force);
    let motion = ContactMotion::<K, R> { overlap, touched, carried, slip, rolling };
    let mut memory = site.contact().memory;
    law.carry(
        &mut memory,
        #[inline(always)]
        |moment| K::carried(&carrier, moment),
    );
    let response = law.respond(&constants, &motion, &mut memory);
    site.answered(&motion, &response);

    // From here on everything is zero in lanes that do not touch.
    let direction = direction.where_or(touching, Tuple::zero());
    let tangential = response.tangential_force.where_or(touching, Tuple::zero());
    let normal = R::select(touching, response.normal_force, zero);
    let memory = memory.where_or(touching, Tuple::zero());
    site.keep(Contact { direction, tangential_force: tangential, memory });
    // Viscous forces act, but they are no part of a contact's history.
    let (mut acting, mut across) = (normal, tangential);
    if let Some(viscous) = response.viscous {
        acting += R::select(touching, viscous.normal_force, zero);
        across = across.plus(viscous.tangential_force.where_or(touching, Tuple::zero()));
    }
    let force = direction.scaled_plus(acting, K::turn(across, direction));
    let mut moments = [across.scaled(arms[0]), across.scaled(arms[1])];
    if let Some(couple) = response.couple {
        let couple = couple.where_or(touching, Tuple::zero());
        moments = [moments[0].plus(couple), moments[1].minus(couple)];
    }
    site.load(force, moments);
    site.add(R::select(touching, one, zero), normal.abs(), R::select(touching, response.dissipation, zero));
    if wanted.limit_counts {
        site.add_at_limit(R::select(touching & response.at_limit, one, zero));
    }
    if wanted.has_extra_pair_sums() {
        if wanted.contact_force_square {
            site.add_force_square(normal.mul_add(normal, tangential.dot(tangential)));
        }
        if wanted.elastic_energy {
            let energy = law.energy(&constants, overlap, K::length(tangential), &memory);
            site.add_energy(R::select(touching, energy, zero));
        }
        if wanted.virial {
            site.add_virial(force, branch);
        }
    }
}
