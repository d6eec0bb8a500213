//! `[pore_fluid]`.

use keys::Located;
use macro_solver::problem::PoreFluid;
use schemars::JsonSchema;
use serde::Deserialize;

/// `[pore_fluid]`. Fluid that fills the pores and moves with the grains. Every Gauss point carries, besides the stress of its grains, the
/// excess pressure `-K ln(V / V0)` with the volume `V0` at the beginning of the stage. Stresses in outputs are those of the grains.
#[derive(Debug, Deserialize, JsonSchema)]
pub(crate) struct PoreFluidTable {
    #[serde(flatten)]
    pub(crate) fluid: PoreFluid,
    /// Stage from whose beginning the fluid cannot drain.
    #[schemars(extend("x-default" = "the first stage"))]
    pub(crate) stage: Option<Located<String>>,
}
