//! Inputs of a single cell: its definition alone, or an element test.

use super::document::Document;
use super::input_error::InputError;
use super::packing::read_packing;
use rve_server::contact::ContactTable;
use rve_server::definition::{AnyDefinition, Packing, RveOptions};
use rve_server::programs::rve_test::ElementTest;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// What a cell is made of: the keys of a scene that describe the grains of its Gauss points.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CellFile {
    /// Packing file (JSON).
    packing: PathBuf,
    /// The contact law between grains.
    contact: ContactTable,
    /// Accuracy of the grain solver.
    #[serde(default)]
    rve: RveOptions,
}

/// Reads packing, contact law and accuracy of one cell, with the checks of a scene.
///
/// # Errors
/// The first defect with its place and remedy.
pub fn read_cell(document: &Document) -> Result<AnyDefinition, InputError> {
    let file: CellFile = document.deserialize()?;
    let packing = read_packing(document, &file.packing)?;
    AnyDefinition::new(packing, file.contact, file.rve).validate().map_err(|error| document.table_error(error))
}

/// Reads an element test and its packing, with every key checked.
///
/// # Errors
/// The first defect with its place and remedy.
pub fn read_element_test(document: &Document) -> Result<(ElementTest, Packing), InputError> {
    // The first reading gives the places of wrong keys and types, the second checks what the values mean together.
    let test: ElementTest = document.deserialize()?;
    let test = test.validated().map_err(|error| document.table_error(error))?;
    let packing = read_packing(document, &test.packing)?;
    Ok((test, packing))
}
