//! Springs of elastic spheres: Hertz along the normal, Mindlin without slip across it.

use super::springs::Springs;
use crate::simd::Real;

/// Two spheres of one isotropic material.
///
/// With `R* = R1 R2 / (R1 + R2)`, `E' = G / (1 - nu)` and `G* = G / (2 (2 - nu))`: `-f_n = 4/3 E' sqrt(R*) delta^(3/2)`, hence
/// `k_n = 2 E' sqrt(R* delta)`, and `k_t = 8 G* sqrt(R* delta)`. Erratum: the text version of [Liu2015] eq. 54 seems to give `k_n`
/// a leading 2 in place of a square root of 2; that would be stiffer by the square root of 2 and would not go with its
/// own `k_t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HertzSprings {
    /// Shear modulus of the grains, Pa.
    pub shear_modulus: f64,
    /// Poisson ratio of the grains.
    pub poisson_ratio: f64,
}

impl Springs for HertzSprings {
    const TANGENT_VARIES: bool = true;

    fn coefficients(&self, [first, second]: [f64; 2]) -> [f64; 2] {
        let root = (first * second / (first + second)).sqrt();
        let plane_strain = self.shear_modulus / (1.0 - self.poisson_ratio);
        let shear = self.shear_modulus / (2.0 * (2.0 - self.poisson_ratio));
        [4.0 / 3.0 * plane_strain * root, 8.0 * shear * root]
    }

    #[inline(always)]
    fn force<R: Real>(coefficient: R, overlap: R) -> R {
        coefficient * (overlap * overlap.sqrt())
    }

    #[inline(always)]
    fn normal_stiffness<R: Real>(coefficient: R, overlap: R) -> R {
        R::splat(1.5) * coefficient * overlap.sqrt()
    }

    #[inline(always)]
    fn normal_energy<R: Real>(coefficient: R, overlap: R) -> R {
        R::splat(0.4) * coefficient * (overlap * overlap * overlap.sqrt())
    }

    #[inline(always)]
    fn contact_size<R: Real>(overlap: R) -> R {
        overlap.sqrt()
    }

    #[inline(always)]
    fn stiffness_of_size<R: Real>(coefficient: R, size: R) -> R {
        coefficient * size
    }
}
