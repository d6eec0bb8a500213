//! The definition of an RVE as workers receive it: packing, contact table, solver options.

mod features;
mod frame;
mod listed_contact;
mod model;
mod narrow_cell;
mod operator_options;
mod options;
mod packing_checks;
pub mod packing_file;

pub use features::EngineFeature;
pub(crate) use frame::LARGEST_FRAME_TARGET;
pub use frame::{CellFrame, FrameConstraint, FrameControl};
pub use listed_contact::ListedContact;
pub use model::GrainModel;
pub use operator_options::OperatorOptions;
pub use options::{Accuracy, AtStepCap, Criterion, Damping, RveOptions, SolverName};
pub use packing_file::{Packing, PackingError, PackingFile};

use crate::contact::ContactTable;
use crate::error::DefinitionError;
use crate::space::{Discs, Space, Spheres, Tensor};
use protocol::Definition;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Most grains of a packing or a specimen: contacts name their grains by 32 bits, and a mistyped number should be refused before it takes all
/// memory.
pub const MOST_GRAINS: usize = 100_000_000;

/// All that this engine needs to build an RVE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct GrainDefinition<S: Space = Discs> {
    /// Packing, checked.
    pub packing: PackingFile<S>,
    /// Contact law.
    pub contact: ContactTable,
    /// Solver options.
    #[serde(default)]
    pub options: RveOptions,
}

/// Grains whose definitions travel as bytes. The methods are not generic, unlike what they call: readers and writers are compiled
/// in this crate, and not again in every program that builds a cell.
pub trait DefinedSpace: Space {
    /// A definition as MessagePack.
    fn definition_to_bytes(definition: &GrainDefinition<Self>) -> Vec<u8>;

    /// The definition in these bytes, unchecked.
    ///
    /// # Errors
    /// Bytes that are not a definition.
    fn definition_from_bytes(bytes: &[u8]) -> Result<GrainDefinition<Self>, DefinitionError>;
}

impl DefinedSpace for Discs {
    fn definition_to_bytes(definition: &GrainDefinition) -> Vec<u8> {
        to_bytes(definition)
    }

    fn definition_from_bytes(bytes: &[u8]) -> Result<GrainDefinition, DefinitionError> {
        from_bytes(bytes)
    }
}

impl DefinedSpace for Spheres {
    fn definition_to_bytes(definition: &GrainDefinition<Self>) -> Vec<u8> {
        to_bytes(definition)
    }

    fn definition_from_bytes(bytes: &[u8]) -> Result<GrainDefinition<Self>, DefinitionError> {
        from_bytes(bytes)
    }
}

fn to_bytes<S: Space>(definition: &GrainDefinition<S>) -> Vec<u8> {
    rmp_serde::to_vec_named(definition).expect("writing MessagePack to memory cannot fail")
}

fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DefinitionError> {
    rmp_serde::from_slice(bytes)
        .map_err(|error| DefinitionError(format!("these bytes are not a definition of grains: {error}")))
}

impl<S: Space> GrainDefinition<S> {
    /// Checks all three parts.
    ///
    /// # Errors
    /// The first defect with the remedy.
    pub fn validate(self) -> Result<Self, DefinitionError> {
        self.contact.validate()?;
        self.contact.validate_for(S::DIMENSION)?;
        self.options.validate()?;
        let packing = self.packing.checked().map_err(|error| DefinitionError(error.to_string()))?;
        let smallest = packing.grains.iter().map(S::radius).fold(f64::INFINITY, f64::min);
        if self.contact.cohesion >= smallest {
            return Err(DefinitionError(format!(
                "contact.cohesion = {:e} m is the overlap up to which grains attract each other, and the smallest grain has a radius of \
                 {smallest:e} m; give a small share of it",
                self.contact.cohesion
            )));
        }
        Ok(Self { packing, ..self })
    }

    /// Mass of the grains over the area or volume of the cell, kg/m3. Overlaps count twice, as is usual.
    pub fn bulk_density(&self) -> f64 {
        let solid: f64 = self.packing.grains.iter().map(|grain| S::grain_measure(S::radius(grain))).sum();
        self.contact.density * solid / self.packing.periodicity.determinant().abs()
    }
}

impl<S: DefinedSpace> GrainDefinition<S> {
    /// The bytes that travel to workers. Equal definitions give equal bytes; the packing's provenance is left out so
    /// that a comment cannot change an identity.
    pub fn to_protocol(&self) -> Definition {
        let bare = Self {
            packing: PackingFile { provenance: serde_json::Value::Null, ..self.packing.clone() },
            ..self.clone()
        };
        Definition { bytes: S::definition_to_bytes(&bare) }
    }

    /// Reads and checks a definition.
    ///
    /// # Errors
    /// Bytes that are not a definition, or the first defect in it.
    pub fn from_protocol(definition: &Definition) -> Result<Self, DefinitionError> {
        S::definition_from_bytes(&definition.bytes)?.validate()
    }
}

/// A definition of either dimension.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyDefinition {
    /// Discs in a plane.
    Discs(GrainDefinition<Discs>),
    /// Spheres in space.
    Spheres(GrainDefinition<Spheres>),
}

impl AnyDefinition {
    /// A packing of either dimension with its law and options.
    pub fn new(packing: Packing, contact: ContactTable, options: RveOptions) -> Self {
        match packing {
            Packing::Discs(packing) => Self::Discs(GrainDefinition { packing, contact, options }),
            Packing::Spheres(packing) => Self::Spheres(GrainDefinition { packing, contact, options }),
        }
    }

    /// Checks all three parts.
    ///
    /// # Errors
    /// The first defect with the remedy.
    pub fn validate(self) -> Result<Self, DefinitionError> {
        Ok(match self {
            Self::Discs(definition) => Self::Discs(definition.validate()?),
            Self::Spheres(definition) => Self::Spheres(definition.validate()?),
        })
    }

    /// The bytes that travel to workers.
    pub fn to_protocol(&self) -> Definition {
        match self {
            Self::Discs(definition) => definition.to_protocol(),
            Self::Spheres(definition) => definition.to_protocol(),
        }
    }

    /// Reads and checks a definition.
    ///
    /// # Errors
    /// Bytes that are not a definition, or the first defect in it.
    pub fn from_protocol(definition: &Definition) -> Result<Self, DefinitionError> {
        #[derive(Deserialize)]
        struct PackingDimension {
            dimension: u32,
        }
        #[derive(Deserialize)]
        struct DimensionOnly {
            packing: PackingDimension,
        }
        let only: DimensionOnly = from_bytes(&definition.bytes)?;
        match only.packing.dimension {
            2 => GrainDefinition::from_protocol(definition).map(Self::Discs),
            3 => GrainDefinition::from_protocol(definition).map(Self::Spheres),
            other => Err(DefinitionError(format!("packing: {}", packing_file::no_dimension(other)))),
        }
    }

    /// 2 or 3.
    pub fn dimension(&self) -> u32 {
        match self {
            Self::Discs(_) => 2,
            Self::Spheres(_) => 3,
        }
    }

    /// Mass of the grains over the area or volume of the cell, kg/m3.
    pub fn bulk_density(&self) -> f64 {
        match self {
            Self::Discs(definition) => definition.bulk_density(),
            Self::Spheres(definition) => definition.bulk_density(),
        }
    }

    /// Number of grains.
    pub fn number(&self) -> usize {
        match self {
            Self::Discs(definition) => definition.packing.grains.len(),
            Self::Spheres(definition) => definition.packing.grains.len(),
        }
    }

    /// Version of the packing's file, which tells whether it holds rolling moments.
    pub fn packing_version(&self) -> u32 {
        match self {
            Self::Discs(definition) => definition.packing.version,
            Self::Spheres(definition) => definition.packing.version,
        }
    }

    /// The packing's file text.
    pub fn packing_json(&self) -> String {
        match self {
            Self::Discs(definition) => definition.packing.to_json(),
            Self::Spheres(definition) => definition.packing.to_json(),
        }
    }

    /// Contact law.
    pub fn contact(&self) -> &ContactTable {
        match self {
            Self::Discs(definition) => &definition.contact,
            Self::Spheres(definition) => &definition.contact,
        }
    }

    /// The same cell, solved to half the tolerance.
    pub fn with_half_tolerance(&self) -> Self {
        self.with_options(RveOptions::with_half_tolerance)
    }

    /// The same cell with other solver options.
    #[must_use]
    pub fn with_options(&self, change: impl FnOnce(&RveOptions) -> RveOptions) -> Self {
        let mut changed = self.clone();
        let options = match &mut changed {
            Self::Discs(definition) => &mut definition.options,
            Self::Spheres(definition) => &mut definition.options,
        };
        *options = change(options);
        changed
    }

    /// Solver options.
    pub fn options(&self) -> &RveOptions {
        match self {
            Self::Discs(definition) => &definition.options,
            Self::Spheres(definition) => &definition.options,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definition_survives_the_wire_and_forgets_provenance() {
        let packing = PackingFile::<Discs> {
            format: PackingFile::FORMAT.into(),
            version: 1,
            dimension: 2,
            thickness: 1.0,
            periodicity: [[1.0, 0.0], [0.0, 1.0]],
            grains: vec![[0.5, 0.5, 0.51]],
            contacts: vec![],
            rolling_moments: vec![],
            provenance: serde_json::json!({ "seed": 7 }),
        };
        let contact = ContactTable::linear(1.0, 0.5, 0.5);
        let named =
            GrainDefinition { packing: packing.clone(), contact: contact.clone(), options: RveOptions::default() };
        let bare = GrainDefinition {
            packing: PackingFile { provenance: serde_json::Value::Null, ..packing },
            ..named.clone()
        };
        assert_eq!(named.to_protocol(), bare.to_protocol());
        assert_eq!(GrainDefinition::<Discs>::from_protocol(&named.to_protocol()).unwrap(), bare);
    }
}
