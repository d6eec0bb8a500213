//! The engine: what it offers, and cells from definitions.

use super::listed_forces::ListedForces;
use super::rve::{GrainRve, refused};
use super::snapshot::ENGINE_NAME;
use super::version::ENGINE_VERSION;
use crate::contact::LawName;
use crate::definition::{AnyDefinition, EngineFeature};
use crate::solver;
use protocol::{Capabilities, Definition, OptionalResult, RveEngine, RveError, RveSolver, SnapshotKind, TangentKind};

/// Builds cells of discs and of spheres.
#[derive(Clone, Copy, Debug, Default)]
pub struct GrainEngine;

impl RveEngine for GrainEngine {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            engine: ENGINE_NAME.into(),
            version: ENGINE_VERSION.into(),
            dimensions: vec![2, 3],
            tangents: TangentKind::ALL.to_vec(),
            laws: LawName::ALL.map(|law| law.keyword().into()).to_vec(),
            snapshot: SnapshotKind::State,
            deterministic: true,
            side_by_side: solver::side_by_side(),
            reduces_friction: true,
            observables: OptionalResult::ALL.map(|result| result.keyword().into()).to_vec(),
            features: EngineFeature::ALL.map(|feature| feature.keyword().into()).to_vec(),
        }
    }

    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError> {
        let id = definition.id();
        let parsed = AnyDefinition::from_protocol(definition).map_err(refused)?;
        parsed.contact().refuse_inner_blocked().map_err(refused)?;
        if parsed.options().frame.is_some() {
            return Err(RveError::Definition(
                "rve.frame: frames of boundary grains are solved by engine = \"boundary-frame\"".into(),
            ));
        }
        Ok(match parsed {
            AnyDefinition::Discs(parsed) => Box::new(GrainRve::build(&parsed, id)?),
            AnyDefinition::Spheres(parsed) => Box::new(GrainRve::build(&parsed, id)?),
        })
    }
}

/// Tangential forces of a definition's packing that its cell does not take over.
///
/// # Errors
/// [`RveError::Definition`].
pub fn listed_forces(definition: &AnyDefinition) -> Result<ListedForces, RveError> {
    match definition {
        AnyDefinition::Discs(definition) => GrainRve::new(definition).map(|cell| cell.listed_forces()),
        AnyDefinition::Spheres(definition) => GrainRve::new(definition).map(|cell| cell.listed_forces()),
    }
}
