//! What a step of an implicit stage prescribes: the load factor, or how far the body moves, with the load factor as an
//! unknown. The latter follows softening, snap-through and snap-back.

use super::axis::Axis;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is prescribed from step to step. All but [`PathControl::Load`] need loads and prescribed motions that grow with
/// the load factor; the factor then rises and falls as equilibrium wants it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum PathControl {
    /// The load factor goes from 0 to 1.
    #[default]
    Load,
    /// Cylindrical arc length: every full step moves the chosen components by as much, in the Euclidean norm, as the
    /// first one. The stage ends after its increments or with the first step that reaches load factor 1.
    ArcLength {
        /// Load factor of the first step, which sets the length of all.
        #[schemars(extend("x-unit" = "-", "x-nonzero" = true))]
        first_load: f64,
        /// Node set whose displacements are measured; all nodes if left out.
        set: Option<String>,
        /// The one component of the set that is measured; all if left out.
        component: Option<Axis>,
    },
    /// Indirect control: over the stage the difference of two mean displacements grows by a given amount, in proportion
    /// to the steps. The stage ends with it.
    Indirect {
        /// Node set whose mean displacement counts.
        #[serde(rename = "set")]
        nodes: String,
        /// Node set whose mean displacement is subtracted; nothing if left out.
        relative_to: Option<String>,
        /// Component of the displacement.
        #[serde(rename = "component")]
        axis: Axis,
        /// Growth over the stage.
        #[schemars(extend("x-unit" = "m", "x-nonzero" = true))]
        growth: f64,
    },
}

impl PathControl {
    /// Node sets that it measures (`None`: all nodes), each with the component if only one counts.
    pub fn measured(&self) -> Vec<(Option<&str>, Option<Axis>)> {
        match self {
            Self::Load => Vec::new(),
            Self::ArcLength { set, component, .. } => vec![(set.as_deref(), *component)],
            Self::Indirect { nodes, relative_to, axis, .. } => {
                std::iter::once(nodes).chain(relative_to).map(|set| (Some(set.as_str()), Some(*axis))).collect()
            }
        }
    }
}
