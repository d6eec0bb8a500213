//! The grains of a stored state, for pictures.

use crate::definition::GrainDefinition;
use crate::engine::opened;
use crate::plane::Plane;
use crate::space::{Discs, Space};
use protocol::{Definition, RveError};

/// Grains of one state, for pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Grains {
    /// Periodicity vectors Y1, Y2, each a row, m.
    pub cell: Plane,
    /// Centres, m, wrapped into the cell.
    pub positions: Vec<[f64; 2]>,
    /// Radii, m.
    pub radii: Vec<f64>,
    /// Rotations since the initial state, rad, counter-clockwise.
    pub rotations: Vec<f64>,
}

/// Reads the grains of a snapshot without building a solver.
///
/// # Errors
/// [`RveError::Definition`] or [`RveError::Snapshot`].
pub fn grains_of_snapshot(definition: &Definition, bytes: &[u8]) -> Result<Grains, RveError> {
    let parsed = GrainDefinition::<Discs>::from_protocol(definition)
        .map_err(|error| RveError::Definition(error.to_string()))?;
    let radii: Vec<f64> = parsed.packing.grains.iter().map(Discs::radius).collect();
    let state = opened(bytes, definition.id(), radii.len())?;
    let positions = state.positions.iter().map(|position| state.cell.wrapped(*position).0).collect();
    Ok(Grains { cell: state.cell.rows, positions, radii, rotations: state.rotations })
}
