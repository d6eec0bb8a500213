//! `[mesh]` becomes a mesh.

use super::document::Document;
use super::input_error::InputError;
use super::schema::{ElementKeyword, Generator, MeshTable};
use macro_solver::mesh::block::Block;
use macro_solver::mesh::{ElementKind, Mesh};
use std::fmt::Display;
use toml::Spanned;

/// Generates the mesh of a scene.
///
/// # Errors
/// A number that is missing, superfluous or impossible.
pub(super) fn mesh(document: &Document, table: &Spanned<MeshTable>) -> Result<Mesh, InputError> {
    let keys = table.get_ref();
    let kind = keys.element.kind();
    match keys.generator {
        Generator::Block => block(document, keys, kind)?
            .mesh()
            .map_err(|error| document.error_at(table.span(), error).hint("docs/scene.md describes [mesh]")),
    }
}

fn block(document: &Document, keys: &MeshTable, kind: ElementKind) -> Result<Block, InputError> {
    let axes = kind.dimension().count();
    let size = exactly(document, &keys.size, "size", axes, kind)?;
    let elements = exactly(document, &keys.elements, "elements", axes, kind)?;
    let grading = match &keys.grading {
        None => vec![1.0; axes],
        Some(grading) => exactly(document, grading, "grading", axes, kind)?,
    };
    if !size.iter().all(|length| *length > 0.0) {
        return Err(document
            .error_at(keys.size.span(), format!("a block of {} m turns its elements inside out", join(&size)))
            .hint("give size = [width, height], in space also the depth, as positive lengths in m"));
    }
    if elements.contains(&0) {
        return Err(document
            .error_at(keys.elements.span(), format!("a block of {} elements is empty", join(&elements)))
            .hint("give elements = [along x, along y], in space also along z, at least one each way"));
    }
    if let Some(given) = &keys.grading
        && !grading.iter().all(|ratio| *ratio > 0.0)
    {
        return Err(document
            .error_at(given.span(), format!("a grading of {} is not possible", join(&grading)))
            .hint("give the length of the last element over that of the first along each axis, above 0"));
    }
    Ok(Block { size: padded(&size, 0.0), elements: padded(&elements, 0), grading: padded(&grading, 1.0), kind })
}

fn exactly<T: Clone>(
    document: &Document,
    values: &Spanned<Vec<T>>,
    key: &str,
    axes: usize,
    kind: ElementKind,
) -> Result<Vec<T>, InputError> {
    if values.get_ref().len() == axes {
        return Ok(values.get_ref().clone());
    }
    let found = values.get_ref().len();
    let keyword = kind.keyword();
    let problem = format!("`{key}` has {found} entries, but element = \"{keyword}\" needs {axes}");
    let places = if axes == 2 { "x and y" } else { "x, y and z" };
    Err(document.error_at(values.span(), problem).hint(format!("give one entry for each of {places}")))
}

fn padded<T: Copy>(values: &[T], filler: T) -> [T; 3] {
    std::array::from_fn(|axis| values.get(axis).copied().unwrap_or(filler))
}

fn join(values: &[impl Display]) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
}

impl ElementKeyword {
    /// The kind it names.
    fn kind(self) -> ElementKind {
        match self {
            Self::Q4 => ElementKind::Q4,
            Self::Q4Single => ElementKind::Q4Single,
            Self::Q8 => ElementKind::Q8,
            Self::Q8Full => ElementKind::Q8Full,
            Self::T3 => ElementKind::T3,
            Self::T6 => ElementKind::T6,
            Self::H8 => ElementKind::H8,
            Self::H8Single => ElementKind::H8Single,
            Self::H20 => ElementKind::H20,
            Self::H20Full => ElementKind::H20Full,
            Self::T4 => ElementKind::T4,
            Self::T10 => ElementKind::T10,
        }
    }
}
