//! Whether an engine can solve the points of a scene, decided before anything is started.

use protocol::{Capabilities, SnapshotKind, TangentKind};
use rve_server::contact::Rotations;
use rve_server::definition::AnyDefinition;
use rve_server::programs::frame::FRAME_ENGINE_NAME;

/// Why an engine cannot solve a scene, with the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Incompatibility {
    /// The packing has another space dimension.
    #[error(
        "engine `{engine}` serves {served:?} dimensions, the packing has {dimension}; choose another engine or packing"
    )]
    Dimension {
        /// Name of the engine.
        engine: String,
        /// Space dimensions that it serves.
        served: Vec<u32>,
        /// Space dimension of the packing.
        dimension: u32,
    },
    /// The scene has another contact law.
    #[error(
        "engine `{engine}` serves the contact laws {served:?}, not \"{law}\"; choose another engine or contact.law"
    )]
    ContactLaw {
        /// Name of the engine.
        engine: String,
        /// Keywords of the contact laws that it serves.
        served: Vec<String>,
        /// Keyword of the scene's contact law.
        law: &'static str,
    },
    /// The scene has frames of boundary grains, or grains inside them that do not turn.
    #[error(
        "engine `{engine}` solves no frames of boundary grains; use engine = \"boundary-frame\", or leave out {key}"
    )]
    Frame {
        /// Name of the engine.
        engine: String,
        /// What asks for frames.
        key: &'static str,
    },
    /// The scene changes the friction between the grains.
    #[error(
        "engine `{engine}` cannot change the friction between grains during a run; choose another engine or leave [[friction]] out"
    )]
    Friction {
        /// Name of the engine.
        engine: String,
    },
}

/// How an engine that can solve a scene will do so.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Compatibility {
    /// Whether tangents have to be found by finite differences.
    pub(crate) needs_differences: bool,
    /// Remarks for the user, one line each.
    pub(crate) remarks: Vec<String>,
}

/// Checks an engine against the definitions of a scene and the tangents that the solver requests.
///
/// # Errors
/// See [`Incompatibility`].
pub(crate) fn compatibility(
    capabilities: &Capabilities,
    definitions: &[AnyDefinition],
    tangents: &[TangentKind],
    changes_friction: bool,
) -> Result<Compatibility, Incompatibility> {
    let engine = &capabilities.engine;
    if changes_friction && !capabilities.reduces_friction {
        return Err(Incompatibility::Friction { engine: engine.clone() });
    }
    for definition in definitions {
        let dimension = definition.dimension();
        if !capabilities.dimensions.contains(&dimension) {
            return Err(Incompatibility::Dimension {
                engine: engine.clone(),
                served: capabilities.dimensions.clone(),
                dimension,
            });
        }
        let asks = [
            (definition.options().frame.is_some(), "rve.frame"),
            (definition.contact().rotations == Rotations::InnerBlocked, "contact.rotations = \"inner_blocked\""),
        ];
        if let Some((_, key)) = asks.into_iter().find(|(asks, _)| *asks && engine != FRAME_ENGINE_NAME) {
            return Err(Incompatibility::Frame { engine: engine.clone(), key });
        }
        let law = definition.contact().law.keyword();
        if !capabilities.laws.iter().any(|served| served == law) {
            return Err(Incompatibility::ContactLaw {
                engine: engine.clone(),
                served: capabilities.laws.clone(),
                law,
            });
        }
    }
    let mut remarks = Vec::new();
    let lacking = |tangent: &&TangentKind| **tangent != TangentKind::None && !capabilities.tangents.contains(tangent);
    let lacks = tangents.iter().find(lacking);
    if let Some(tangent) = lacks {
        remarks.push(format!(
            "engine `{engine}` has no tangent `{}`: tangents are found by finite differences of its stresses",
            tangent.keyword()
        ));
    }
    if capabilities.snapshot == SnapshotKind::Path {
        remarks.push(format!(
            "engine `{engine}` has no snapshots: a point that changes workers is solved again from the start"
        ));
    }
    if !capabilities.deterministic {
        remarks.push(format!(
            "engine `{engine}` is not deterministic: equal trials may give different results, and reruns may differ"
        ));
    }
    Ok(Compatibility { needs_differences: lacks.is_some(), remarks })
}
