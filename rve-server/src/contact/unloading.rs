//! Change of a tangential force with the tangential stiffness.

use crate::simd::Real;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Effect of unloading on the tangential force of Hertz-Mindlin contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TangentialUnloading {
    /// The force shrinks with the tangential stiffness, as `mindlin_rescale/force` of LAMMPS: no cycle gains energy.
    // As a spring of that stiffness and constant stretch would.
    #[default]
    Rescaled,
    /// The purely incremental law, as `mindlin/force` of LAMMPS and Yade's law of Mindlin; cycles can gain energy.
    // Erratum of [Liu2015] eqs. 53 and 54: slipping at a large overlap and back at a small one gains energy. Kept for comparisons.
    Incremental,
}

/// Factor of the tangential force when its stiffness becomes `ratio` times what it was; 1 while the contact is loaded.
#[inline(always)]
pub(super) fn unloading_factor<R: Real>(unloading: TangentialUnloading, ratio: R) -> R {
    match unloading {
        TangentialUnloading::Rescaled => R::select(ratio.less(R::splat(1.0)), ratio, R::splat(1.0)),
        TangentialUnloading::Incremental => R::splat(1.0),
    }
}
