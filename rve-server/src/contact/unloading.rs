//! Change of a tangential force with the tangential stiffness.

use crate::simd::Real;

/// How a tangential force answers to a contact that unloads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unloading {
    /// The force shrinks with its stiffness, as a spring of that stiffness and constant stretch would: no motion gains
    /// energy.
    Rescaled,
    /// The force stays. Erratum of the incremental law of [Liu2015] eqs. 53 and 54: slipping at a large overlap and back
    /// at a small one gains energy. Other programs do this, so it can be chosen for comparisons.
    Incremental,
}

/// Factor of the tangential force when its stiffness becomes `ratio` times what it was; 1 while the contact is loaded.
#[inline(always)]
pub(super) fn unloading_factor<R: Real>(unloading: Unloading, ratio: R) -> R {
    match unloading {
        Unloading::Rescaled => R::select(ratio.less(R::splat(1.0)), ratio, R::splat(1.0)),
        Unloading::Incremental => R::splat(1.0),
    }
}
