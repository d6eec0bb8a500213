//! The grains of a stored state, for pictures.

use super::snapshot::opened;
use crate::definition::{DefinedSpace, GrainDefinition};
use crate::space::{Discs, Space};
use protocol::{Definition, RveError};

/// Grains of one state, for pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Grains<S: Space = Discs> {
    /// Periodicity vectors, each a row, m.
    pub cell: S::Tensor,
    /// Centres, m, wrapped into the cell.
    pub positions: Vec<S::Vector>,
    /// Radii, m.
    pub radii: Vec<f64>,
    /// Spin added up since the initial state, rad.
    pub rotations: Vec<S::Spin>,
}

/// Reads the grains of a snapshot without building a solver.
///
/// # Errors
/// [`RveError::Definition`] or [`RveError::Snapshot`].
pub fn grains_of_snapshot<S: DefinedSpace>(definition: &Definition, bytes: &[u8]) -> Result<Grains<S>, RveError> {
    let parsed =
        GrainDefinition::<S>::from_protocol(definition).map_err(|error| RveError::Definition(error.to_string()))?;
    grains(&parsed, definition, bytes)
}

fn grains<S: Space>(
    parsed: &GrainDefinition<S>,
    definition: &Definition,
    bytes: &[u8],
) -> Result<Grains<S>, RveError> {
    let radii: Vec<f64> = parsed.packing.grains.iter().map(S::radius).collect();
    let state = opened::<S>(bytes, definition.id(), radii.len())?;
    let positions = state.positions.iter().map(|position| state.cell.wrapped(*position).0).collect();
    Ok(Grains { cell: state.cell.rows, positions, radii, rotations: state.rotations })
}
