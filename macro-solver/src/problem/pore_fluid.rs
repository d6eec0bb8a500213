//! Fluid in the pores that cannot drain.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fluid that fills the pores and moves with the grains: keys of `[pore_fluid]`. Every Gauss point carries, besides the stress of its
/// grains, the excess pressure `-K ln(V / V0)`, with the volume `V0` at the beginning of the stage it counts from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoreFluid {
    /// `K`: bulk modulus of the fluid over the porosity. Water has some 5e9; ten to a hundred times the stiffness of the grains' skeleton
    /// holds the volume well enough and is solved more easily.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0))]
    pub bulk_modulus: f64,
    /// Stage from whose beginning the fluid cannot drain, from 0.
    #[serde(skip)]
    pub from_stage: usize,
}
