//! Meshes of Gmsh: ASCII files of format 2.2 and 4.1 with physical groups.
//!
//! Elements of the highest dimension become the elements of the mesh. A physical group of them becomes an element
//! set, one of the next lower dimension a side set, and every group becomes a node set, all under the group's name
//! (`group_TAG` where it has none; no node set then if groups of several dimensions have this number). Nothing is repaired
//! silently: what cannot be taken over is an error that names the line and the remedy.

mod assemble;
mod parse;

use super::{ElementKind, Mesh};
use thiserror::Error;

/// Why a file was refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("line {line}: {problem}; {remedy}")]
pub struct GmshError {
    /// Line of the file, from 1; the last one where something is missing at the end.
    pub line: usize,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub remedy: String,
}

impl GmshError {
    fn new(line: usize, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { line, problem: problem.into(), remedy: remedy.into() }
    }
}

/// Reads the text of a mesh file. Elements with the nodes of `preferred` become of that kind, which chooses their
/// quadrature; others get the kind with the most usual one.
///
/// # Errors
/// [`GmshError`], also where the mesh is not valid.
pub fn read(text: &str, preferred: Option<ElementKind>) -> Result<Mesh, GmshError> {
    assemble::mesh(parse::parse(text)?, preferred)
}

#[cfg(test)]
mod tests;
