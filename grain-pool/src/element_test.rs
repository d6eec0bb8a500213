//! One cell along a path of strains and stresses, from text to rows.

use crate::error::PoolError;
use protocol::TangentKind;
use rve_server::programs::rve_test::{ElementError, ElementSummary, element_table};
use scene_reader::{Document, read_element_test};
use std::path::Path;

/// What a test has left.
#[derive(Debug)]
pub struct ElementOutcome {
    /// The rows as CSV, equal to the output of `grainspan element` to the byte.
    pub csv: Vec<u8>,
    /// Cost and counts; of a test that stopped before its end those of its rows.
    pub summary: ElementSummary,
    /// Why the test stopped before its end; the rows before are sound.
    pub stopped: Option<ElementError>,
}

/// Runs the element test `text` (TOML, see `grainspan element`), whose paths are relative to `folder`. `keep_going` is called after
/// every row; `false` ends the test.
///
/// # Errors
/// [`PoolError::Input`] or [`PoolError::Element`] for a test that is not sound, [`PoolError::Interrupted`].
pub fn element_test(
    text: String,
    folder: &Path,
    tangent: TangentKind,
    keep_going: &mut dyn FnMut() -> bool,
) -> Result<ElementOutcome, PoolError> {
    let document = Document::from_text(&folder.join("test.toml"), text, &[])?;
    let (test, packing) = read_element_test(&document)?;
    let table = element_table(&test, packing, tangent, false, keep_going).map_err(unwritable)?;
    let (csv, summary) = (table.csv, table.end.summary);
    match table.end.result {
        _ if table.is_interrupted => Err(PoolError::Interrupted),
        Ok(()) => Ok(ElementOutcome { csv, summary, stopped: None }),
        Err(error) if error.is_bad_input() => Err(document.table_error(error).into()),
        Err(error) => Ok(ElementOutcome { csv, summary, stopped: Some(error) }),
    }
}

fn unwritable(error: csv::Error) -> PoolError {
    PoolError::Start { action: "encode a row", reason: error.to_string() }
}
