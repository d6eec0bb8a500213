//! Normal and tangential springs of a contact, without friction or history.

use crate::simd::Real;
use std::fmt::Debug;

/// A pair of springs. The normal force is `coefficient x shape(overlap)`, so that a friction limit, which is
/// proportional to it, can be computed from a coefficient of its own.
pub trait Springs: Copy + Debug + PartialEq + Send + Sync + 'static {
    /// Whether the tangential stiffness depends on the overlap.
    const TANGENT_VARIES: bool;

    /// Coefficients of the normal force and of the tangential stiffness for grains of these radii, m.
    fn coefficients(&self, radii: [f64; 2]) -> [f64; 2];

    /// Elastic normal force, N, compression positive.
    fn force<R: Real>(coefficient: R, overlap: R) -> R;

    /// Slope of [`force`](Self::force), N/m.
    fn normal_stiffness<R: Real>(coefficient: R, overlap: R) -> R;

    /// Energy of the normal spring, J.
    fn normal_energy<R: Real>(coefficient: R, overlap: R) -> R;

    /// Tangential stiffness, N/m.
    #[inline(always)]
    fn tangential_stiffness<R: Real>(coefficient: R, overlap: R) -> R {
        Self::stiffness_of_size(coefficient, Self::contact_size(overlap))
    }

    /// Quantity to which a varying tangential stiffness is proportional; a contact stores it in place of its overlap, since
    /// finding it again would take another root.
    fn contact_size<R: Real>(overlap: R) -> R;

    /// Tangential stiffness, N/m, of a contact of this size.
    fn stiffness_of_size<R: Real>(coefficient: R, size: R) -> R;
}
