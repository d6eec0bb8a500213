//! `[nonlocal]`.

use macro_solver::nonlocal::NonlocalSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[nonlocal]`: the averages, and whether there are any.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct NonlocalTable {
    /// Whether strain increments are averaged. A table that is written switches averages on unless it says otherwise; a stage can
    /// switch them off that are on at the top of the scene.
    #[schemars(extend("x-default" = "true"))]
    pub(crate) enabled: bool,
    #[serde(flatten)]
    pub(crate) settings: NonlocalSettings,
}
