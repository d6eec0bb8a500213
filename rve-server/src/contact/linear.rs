//! Linear springs, [Argilaga2018] appendix A.

use super::springs::Springs;
use crate::simd::Real;

/// How k_n follows from the radii.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NormalStiffness {
    /// The same for all contacts, N/m.
    Constant(f64),
    /// From a modulus, Pa, and both radii.
    Modulus(f64),
}

impl NormalStiffness {
    /// k_n of a contact between grains of two radii, N/m.
    pub fn of(self, first: f64, second: f64) -> f64 {
        match self {
            Self::Constant(stiffness) => stiffness,
            Self::Modulus(modulus) => 2.0 * modulus * first * second / (first + second),
        }
    }
}

/// `-f_n = k_n delta` with the overlap `delta`, m; `k_t` is constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearSprings {
    /// How k_n follows from the radii.
    pub normal: NormalStiffness,
    /// k_t / k_n.
    pub stiffness_ratio: f64,
}

impl Springs for LinearSprings {
    const TANGENT_VARIES: bool = false;

    fn coefficients(&self, [first, second]: [f64; 2]) -> [f64; 2] {
        let normal = self.normal.of(first, second);
        [normal, self.stiffness_ratio * normal]
    }

    #[inline(always)]
    fn force<R: Real>(coefficient: R, overlap: R) -> R {
        coefficient * overlap
    }

    #[inline(always)]
    fn normal_stiffness<R: Real>(coefficient: R, _: R) -> R {
        coefficient
    }

    #[inline(always)]
    fn normal_energy<R: Real>(coefficient: R, overlap: R) -> R {
        R::splat(0.5) * coefficient * overlap * overlap
    }

    #[inline(always)]
    fn contact_size<R: Real>(overlap: R) -> R {
        overlap
    }

    #[inline(always)]
    fn stiffness_of_size<R: Real>(coefficient: R, _: R) -> R {
        coefficient
    }
}
