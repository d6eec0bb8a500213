//! Whether an engine can solve the points of a scene, decided before anything is started.

use protocol::{Capabilities, Observables, OptionalResult, SnapshotKind, TangentKind};
use rve_server::contact::Rotations;
use rve_server::definition::{AnyDefinition, EngineFeature};
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
    /// The scene uses a part of definitions that the engine does not follow: it would solve another material.
    #[error("engine `{engine}` does not follow {key}; choose another engine, or {remedy}")]
    Feature {
        /// Name of the engine.
        engine: String,
        /// Key of the part.
        key: &'static str,
        /// How to do without.
        remedy: &'static str,
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

/// What a scene asks of the engines of its points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Requirements<'a> {
    /// Definitions of its cells.
    pub(crate) definitions: &'a [AnyDefinition],
    /// Tangents that the solver requests.
    pub(crate) tangents: &'a [TangentKind],
    /// Optional results that are written or measured.
    pub(crate) observables: Observables,
    /// Whether the friction between grains changes.
    pub(crate) changes_friction: bool,
}

/// Checks an engine against what a scene asks of it.
///
/// # Errors
/// See [`Incompatibility`].
pub(crate) fn compatibility(
    capabilities: &Capabilities,
    requirements: &Requirements<'_>,
) -> Result<Compatibility, Incompatibility> {
    let engine = &capabilities.engine;
    if requirements.changes_friction && !capabilities.reduces_friction {
        return Err(Incompatibility::Friction { engine: engine.clone() });
    }
    for definition in requirements.definitions {
        check_definition(capabilities, definition)?;
    }
    let mut remarks = Vec::new();
    let lacking = |tangent: &&TangentKind| **tangent != TangentKind::None && !capabilities.tangents.contains(tangent);
    let lacks = requirements.tangents.iter().find(lacking);
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
    let is_requested = |result: &OptionalResult| requirements.observables.contains(result.requested_by());
    let missing = capabilities.lacking().into_iter().filter(is_requested).map(OptionalResult::keyword);
    let missing = missing.collect::<Vec<_>>().join(", ");
    if !missing.is_empty() {
        remarks.push(format!("engine `{engine}` does not deliver {missing}: they are NaN at its points"));
    }
    let without_effect = unfollowed(capabilities, requirements.definitions);
    remarks.extend(without_effect.filter(|feature| !feature.is_part_of_the_problem()).map(|feature| {
        format!("engine `{engine}` has its own way to equilibrium: {} has no effect on it", feature.keyword())
    }));
    Ok(Compatibility { needs_differences: lacks.is_some(), remarks })
}

/// Whether an engine can solve the cells of one definition.
fn check_definition(capabilities: &Capabilities, definition: &AnyDefinition) -> Result<(), Incompatibility> {
    let engine = &capabilities.engine;
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
        return Err(Incompatibility::ContactLaw { engine: engine.clone(), served: capabilities.laws.clone(), law });
    }
    let mut ignored = unfollowed(capabilities, std::slice::from_ref(definition));
    match ignored.find(|feature| feature.is_part_of_the_problem()) {
        Some(feature) => Err(Incompatibility::Feature {
            engine: engine.clone(),
            key: feature.keyword(),
            remedy: do_without(feature),
        }),
        None => Ok(()),
    }
}

/// What definitions use and an engine does not follow.
fn unfollowed(capabilities: &Capabilities, definitions: &[AnyDefinition]) -> impl Iterator<Item = EngineFeature> {
    EngineFeature::ALL.into_iter().filter(move |feature| {
        definitions.iter().any(|definition| feature.is_used_by(definition))
            && !capabilities.features.iter().any(|word| word == feature.keyword())
    })
}

/// How a scene does without a part of its definitions, for messages.
fn do_without(feature: EngineFeature) -> &'static str {
    match feature {
        EngineFeature::RollingMoments => "take a packing file without rolling_moments, of version 1",
        EngineFeature::RollingResistance => "leave it and contact.rolling_friction out",
        _ => "leave it out",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::RveEngine;
    use rve_server::contact::{ContactTable, LawName};
    use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
    use rve_server::engine::GrainEngine;
    use rve_server::space::{Discs, Spheres};

    /// An engine outside this program that says no more than it must.
    fn outside(features: &[&str]) -> Capabilities {
        Capabilities {
            engine: "mine".into(),
            version: "1".into(),
            dimensions: vec![2, 3],
            laws: LawName::ALL.map(|law| law.keyword().into()).to_vec(),
            deterministic: true,
            observables: OptionalResult::ALL.map(|result| result.keyword().into()).to_vec(),
            features: features.iter().map(|&feature| feature.to_owned()).collect(),
            ..Capabilities::default()
        }
    }

    /// A disc with what the tables say besides the least that they have to.
    fn discs(contact: &str, options: &str) -> AnyDefinition {
        let packing = PackingFile::<Discs> {
            format: PackingFile::FORMAT.into(),
            version: PackingFile::VERSION,
            dimension: 2,
            thickness: 1.0,
            periodicity: [[1.0, 0.0], [0.0, 1.0]],
            grains: vec![[0.5, 0.5, 0.51]],
            contacts: Vec::new(),
            rolling_moments: Vec::new(),
            provenance: serde_json::Value::Null,
        };
        let contact = format!("normal_stiffness = 1e7\nstiffness_ratio = 0.5\nfriction = 0.5\n{contact}");
        let (contact, options) = (toml::from_str(&contact).unwrap(), toml::from_str(options).unwrap());
        AnyDefinition::Discs(GrainDefinition { packing, contact, options })
    }

    fn judged(capabilities: &Capabilities, definition: AnyDefinition) -> Result<Vec<String>, String> {
        let requirements = Requirements {
            definitions: &[discs("", ""), definition],
            tangents: &[],
            observables: Observables::ALL,
            changes_friction: false,
        };
        let found = compatibility(capabilities, &requirements);
        found.map(|compatibility| compatibility.remarks).map_err(|error| error.to_string())
    }

    /// Refused with its key, unless the engine says that it follows it; the engine inside this program follows all.
    fn needs(key: &str, definition: &AnyDefinition) {
        let refused = judged(&outside(&[]), definition.clone()).unwrap_err();
        assert!(refused.contains(&format!("engine `mine` does not follow {key};")), "{refused}");
        assert_eq!(judged(&outside(&[key]), definition.clone()), Ok(Vec::new()));
        assert_eq!(judged(&GrainEngine.capabilities(), definition.clone()), Ok(Vec::new()));
    }

    #[test]
    fn what_every_engine_has_to_follow_is_accepted() {
        let ordinary = discs("cohesion = 1e-9\ndensity = 2000", "accuracy = \"draft\"\nmax_steps = 100");
        assert_eq!(judged(&outside(&[]), ordinary), Ok(Vec::new()));
    }

    #[test]
    fn rolling_resistance_is_not_left_out_silently() {
        needs("contact.rolling_stiffness", &discs("rolling_stiffness = 1\nrolling_friction = 0.1", ""));
    }

    #[test]
    fn rolling_moments_of_a_packing_are_not_left_out_silently() {
        let AnyDefinition::Discs(mut definition) = discs("", "") else { unreachable!() };
        definition.packing.version = PackingFile::VERSION_WITH_MOMENTS;
        needs("packing.rolling_moments", &AnyDefinition::Discs(definition));
    }

    #[test]
    fn viscosity_of_contacts_is_not_left_out_silently() {
        needs("contact.damping", &discs("damping = 0.5", ""));
    }

    #[test]
    fn another_unloading_is_not_left_out_silently() {
        let packing = PackingFile::<Spheres> {
            format: PackingFile::FORMAT.into(),
            version: PackingFile::VERSION,
            dimension: 3,
            thickness: 1.0,
            periodicity: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            grains: vec![[0.5, 0.5, 0.5, 0.51]],
            contacts: Vec::new(),
            rolling_moments: Vec::new(),
            provenance: serde_json::Value::Null,
        };
        let with = |unloading: &str| {
            let contact = ContactTable {
                unloading: Some(serde_json::from_value(unloading.into()).unwrap()),
                ..ContactTable::hertz_mindlin(1e9, 0.2, 0.5)
            };
            let options = RveOptions::default();
            AnyDefinition::Spheres(GrainDefinition { packing: packing.clone(), contact, options })
        };
        needs("contact.unloading", &with("incremental"));
        assert_eq!(judged(&outside(&[]), with("rescaled")), Ok(Vec::new()));
    }

    #[test]
    fn blocked_rotations_are_not_left_out_silently() {
        needs("contact.rotations", &discs("rotations = \"blocked\"", ""));
    }

    #[test]
    fn another_criterion_is_not_left_out_silently() {
        needs("rve.criterion", &discs("", "criterion = \"energy\""));
    }

    #[test]
    fn refusal_at_the_step_cap_is_not_left_out_silently() {
        needs("rve.at_step_cap", &discs("", "at_step_cap = \"refuse\""));
    }

    #[test]
    fn a_bound_on_evaluations_is_not_left_out_silently() {
        needs("rve.max_evaluations", &discs("", "max_evaluations = 100000"));
    }

    /// They lead to the same equilibrium.
    #[test]
    fn other_ways_to_equilibrium_are_remarks() {
        let cases = [
            ("rve.solver", "solver = \"event_driven\""),
            ("rve.damping", "damping = \"viscous\""),
            ("economy.zero_increments", "relax_zero_increments = true"),
        ];
        for (key, options) in cases {
            let remarks = judged(&outside(&[]), discs("", options)).unwrap();
            assert!(remarks.len() == 1 && remarks[0].contains(&format!("{key} has no effect")), "{remarks:?}");
            assert_eq!(judged(&outside(&[key]), discs("", options)), Ok(Vec::new()));
            assert_eq!(judged(&GrainEngine.capabilities(), discs("", options)), Ok(Vec::new()));
        }
    }

    /// Zeros in the place of results that an engine does not deliver looked like results.
    #[test]
    fn missing_results_are_named_where_they_are_requested() {
        let bare = Capabilities { observables: vec!["fabric".into(), "elastic_energy".into()], ..outside(&[]) };
        let definitions = [discs("", "")];
        let remarks = |observables| {
            let requirements =
                Requirements { definitions: &definitions, tangents: &[], observables, changes_friction: false };
            compatibility(&bare, &requirements).unwrap().remarks
        };
        let text = remarks(Observables::FABRIC.union(Observables::ENERGY)).join("; ");
        assert!(
            text.contains("does not deliver fabric_anisotropy, frictional_dissipation, damping_work: they are NaN")
        );
        assert_eq!(remarks(Observables::NONE), Vec::<String>::new());
    }
}
