//! Linear springs with Coulomb friction.

use super::kinematics::Kinematics;
use super::law::{AT_LIMIT, ContactLaw, ContactMotion, ContactResponse};
use super::real::Real;
use super::tuple::Tuple;
use crate::definition::NormalStiffness;

/// Linear springs with Coulomb friction and cohesion.
///
/// The law is [Argilaga2018] eqs. A.4 to A.7 with the contact point on the branch (alpha = 1/2):
/// `f_n = -k_n (h - C)`, `df_t = k_t [db.t - (l_O dtheta_O + l_E dtheta_E)]`. Erratum: the paper gives no tension bound
/// and no friction limit for cohesive contacts; used here are `|f_t| <= mu (-f_n + k_n C)`, which equals `mu k_n h`, and
/// loss of contact at `f_n > k_n C`, which is `h < 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearLaw {
    /// How k_n follows from the radii.
    pub normal: NormalStiffness,
    /// k_t / k_n.
    pub stiffness_ratio: f64,
    /// Coulomb coefficient.
    pub friction: f64,
    /// Cohesive overlap C, m.
    pub cohesion: f64,
}

impl<K: Kinematics> ContactLaw<K> for LinearLaw {
    /// k_n, k_t, 1 / k_t (0 without tangential stiffness), k_n C, mu k_n.
    type Constants<R: Real> = [R; 5];
    type Memory<R: Real> = [R; 0];

    fn recalled(&self, _: &[f64; 5], _: f64) -> [f64; 0] {
        []
    }

    fn constants(&self, [first, second]: [f64; 2]) -> [f64; 5] {
        let normal = self.normal.of(first, second);
        let tangential = self.stiffness_ratio * normal;
        let compliance = if tangential > 0.0 { 1.0 / tangential } else { 0.0 };
        [normal, tangential, compliance, normal * self.cohesion, self.friction * normal]
    }

    #[inline(always)]
    fn respond<R: Real>(
        &self,
        &[normal, tangential, compliance, adhesion, friction]: &[R; 5],
        motion: &ContactMotion<K, R>,
        _: &mut [R; 0],
    ) -> ContactResponse<K, R> {
        let limit = friction * motion.overlap;
        let attempt = motion.slip.scaled_plus(tangential, motion.carried);
        let attempt = attempt.where_or(motion.touched, K::Axial::zero());
        let kept = K::shortened(attempt, limit);
        let at_limit = (limit * R::splat(AT_LIMIT)).at_most(K::length(attempt));
        ContactResponse {
            normal_force: (-normal).mul_add(motion.overlap, adhesion),
            tangential_force: kept,
            couple: None,
            at_limit,
            dissipation: kept.dot(attempt.minus(kept)) * compliance,
        }
    }

    #[inline(always)]
    fn stiffness<R: Real>(&self, constants: &[R; 5], _: R) -> [R; 2] {
        [constants[0], constants[1]]
    }

    #[inline(always)]
    fn energy<R: Real>(&self, constants: &[R; 5], overlap: R, tangential_force: R) -> R {
        let [normal, _, compliance, adhesion, _] = *constants;
        let half = R::splat(0.5);
        // ((f_n)^2 - (k_n C)^2) / 2 k_n = h (k_n h / 2 - k_n C)
        let stored = (half * normal).mul_add(overlap, -adhesion) * overlap;
        (half * compliance * tangential_force).mul_add(tangential_force, stored)
    }

    #[inline(always)]
    fn opening_loss<R: Real>(&self, constants: &[R; 5], tangential_force: K::Axial<R>, _: &[R; 0]) -> R {
        tangential_force.dot(tangential_force) * (R::splat(0.5) * constants[2])
    }
}
