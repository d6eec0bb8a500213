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
    let test = checked_test(document)?;
    let packing = read_packing(document, &test.packing)?;
    Ok((test, packing))
}

/// Reads an element test without its packing.
///
/// # Errors
/// The first defect with its place and remedy.
pub(crate) fn checked_test(document: &Document) -> Result<ElementTest, InputError> {
    // The first reading gives the places of wrong keys and types, the second checks what the values mean together.
    let test: ElementTest = document.deserialize()?;
    if test.frame.is_some() && document.is_written(&["rve"]) {
        return Err(document
            .error_at_key(&["rve"], "[rve] has no effect where there is a [frame]")
            .hint("write strain_per_step, tolerance and damping into [frame]"));
    }
    test.validated().map_err(|error| document.table_error(error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// The table was read and did nothing, where it held defaults too.
    #[test]
    fn options_of_cells_are_refused_together_with_a_frame() {
        let read = |options: &str| {
            let text = format!(
                "packing = \"p.json\"\n[contact]\nlaw = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5\n\
                 {options}[frame]\nconstraint = \"periodic\"\n[[path]]\nincrements = 1\nstrain = {{ yy = -1e-4 }}\n"
            );
            checked_test(&Document::from_text(Path::new("test.toml"), text, &[]).unwrap())
        };
        for options in ["[rve]\naccuracy = \"tight\"\n", "[rve]\naccuracy = \"default\"\n"] {
            let error = read(options).unwrap_err().to_string();
            assert!(error.contains("[rve] has no effect where there is a [frame]"), "{error}");
        }
        read("").unwrap();
    }
}
