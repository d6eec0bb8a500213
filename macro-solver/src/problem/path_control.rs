//! What a step of an implicit stage prescribes: the load factor, or how far the body moves, with the load factor as an
//! unknown. The latter follows softening, snap-through and snap-back.

use super::Axis;

/// What is prescribed from step to step. All but [`PathControl::Load`] need loads and prescribed motions that grow with
/// the load factor; the factor then rises and falls as equilibrium wants it.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum PathControl {
    /// The load factor goes from 0 to 1.
    #[default]
    Load,
    /// Cylindrical arc length: every full step moves the chosen components by as much, in the Euclidean norm, as the
    /// first one. The stage ends after its increments or with the first step that reaches load factor 1.
    ArcLength {
        /// Load factor of the first step, which sets the length of all.
        first_load: f64,
        /// Node set and, if given, the one component of it that counts; `None`: all components of all nodes.
        measured: Option<(String, Option<Axis>)>,
    },
    /// Indirect control: over the stage the difference of two mean displacements grows by a given amount, in proportion
    /// to the steps. The stage ends with it.
    Indirect {
        /// Node set whose mean counts.
        nodes: String,
        /// Node set whose mean is taken off; `None`: nothing is.
        relative_to: Option<String>,
        /// Component.
        axis: Axis,
        /// Growth over the stage, m.
        growth: f64,
    },
}

impl PathControl {
    /// Node sets that it measures, each with the component if only one counts.
    pub fn measured(&self) -> Vec<(&str, Option<Axis>)> {
        match self {
            Self::Load => Vec::new(),
            Self::ArcLength { measured, .. } => measured.iter().map(|(set, axis)| (set.as_str(), *axis)).collect(),
            Self::Indirect { nodes, relative_to, axis, .. } => {
                std::iter::once(nodes).chain(relative_to).map(|set| (set.as_str(), Some(*axis))).collect()
            }
        }
    }
}
