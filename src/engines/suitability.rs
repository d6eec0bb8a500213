//! Whether an engine can solve the points of a scene, judged before anything is started.

use protocol::{Capabilities, SnapshotKind, TangentKind};
use rve_server::definition::AnyDefinition;

/// What an engine means for a scene that it can run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Suitability {
    /// Whether the run has to find tangents by finite differences.
    pub(crate) differences: bool,
    /// What a person should know, one line each.
    pub(crate) remarks: Vec<String>,
}

/// Judges an engine for what points are made of and the tangents that the solver wants.
///
/// # Errors
/// Why the engine cannot run the scene, with the remedy.
pub(crate) fn suitability(
    capabilities: &Capabilities,
    definitions: &[AnyDefinition],
    tangents: &[TangentKind],
) -> Result<Suitability, String> {
    let engine = &capabilities.engine;
    for definition in definitions {
        let dimension = definition.dimension();
        if !capabilities.dimensions.contains(&dimension) {
            return Err(format!(
                "engine `{engine}` serves {:?} dimensions, the packing has {dimension}; choose another engine or packing",
                capabilities.dimensions
            ));
        }
        let law = definition.contact().law.keyword();
        if !capabilities.laws.iter().any(|served| served == law) {
            return Err(format!(
                "engine `{engine}` serves the contact laws {:?}, not \"{law}\"; choose another engine or contact.law",
                capabilities.laws
            ));
        }
    }
    let mut remarks = Vec::new();
    let lacking = |tangent: &&TangentKind| **tangent != TangentKind::None && !capabilities.tangents.contains(tangent);
    let lacks = tangents.iter().find(lacking);
    if let Some(tangent) = lacks {
        remarks.push(format!(
            "engine `{engine}` has no tangent `{}`: tangents are found by finite differences of its answers",
            tangent.keyword()
        ));
    }
    if capabilities.snapshot == SnapshotKind::Path {
        remarks.push(format!(
            "engine `{engine}` has no snapshots: a point that changes workers is solved again from the start"
        ));
    }
    if !capabilities.deterministic {
        remarks
            .push(format!("engine `{engine}` does not promise equal answers to equal questions: reruns may differ"));
    }
    Ok(Suitability { differences: lacks.is_some(), remarks })
}
