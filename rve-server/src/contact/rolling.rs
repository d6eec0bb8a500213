//! Rolling resistance: an elastic, perfectly plastic spring between the rotations of two grains.

use crate::simd::{Real, Tuple};
use crate::space::{KernelSpace, Shortened};

/// Coefficients of the rolling spring. `k_r = stiffness k_t R1 R2`, and the moment is cut to `friction min(R1, R2)` times
/// the elastic normal force, as in Yade's law of cohesive frictional grains (there `alphaKr`, `etaRoll`). The spring
/// sees the relative rotation without its part along the normal: there is no resistance to twisting.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RollingSpring {
    /// k_r / (k_t R1 R2), dimensionless.
    pub stiffness: f64,
    /// Largest moment over min(R1, R2) times the normal force, dimensionless.
    pub friction: f64,
}

impl RollingSpring {
    /// `k_r / k_t`, m2, for grains of these radii.
    pub(super) fn arm_square(&self, [first, second]: [f64; 2]) -> f64 {
        self.stiffness * first * second
    }

    /// Largest moment over normal force, m.
    pub(super) fn limit_arm(&self, [first, second]: [f64; 2]) -> f64 {
        self.friction * first.min(second)
    }
}

/// Moment on the origin grain after a relative rotation, N m, and the work lost to the limit, J.
#[inline(always)]
pub(super) fn rolled<K: KernelSpace, R: Real>(
    moment: K::Axial<R>,
    stiffness: R,
    rolling: K::Axial<R>,
    limit: R,
) -> (K::Axial<R>, R) {
    let attempt = moment.minus(rolling.scaled(stiffness));
    let Shortened { kept, lost, .. } = K::shortened(attempt, limit, 1.0);
    let works = R::default().less(stiffness);
    (kept, R::select(works, lost / stiffness, R::default()))
}
