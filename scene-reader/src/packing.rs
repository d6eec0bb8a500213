//! Packings that a document names: read, or refused with the place of the key.

use super::document::{Document, Kind};
use super::input_error::InputError;
use rve_server::definition::{Packing, PackingError};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

/// Bytes of the largest packing file that is read: some 50 million grains, more than any process can relax.
const LARGEST_PACKING: u64 = 4 << 30;

/// Reads the packing that a document names in its key `packing`, and refuses it with the line of that key.
///
/// # Errors
/// The packing's own error.
pub fn read_packing(document: &Document, written: &Path) -> Result<Packing, InputError> {
    let path = document.resolve(written);
    packing_at(&path).map_err(|error| {
        let hint = if is_recipe(&path) {
            format!("this is a recipe: make the packing with `grainspan pack {} --out NAME.json`", path.display())
        } else if path.exists() {
            "correct the packing file, or make a new one with `grainspan pack`".to_owned()
        } else {
            "make one with `grainspan pack`, or correct the path; it is relative to this file's folder".to_owned()
        };
        document.error_at_key(&["packing"], error).hint(hint)
    })
}

/// Whether a file that is no packing is a recipe for one.
fn is_recipe(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "toml")
        && Document::read(path, &[]).is_ok_and(|document| document.kind() == Some(Kind::Recipe))
}

/// Reads a packing file. What cannot be a packing is refused before it is read whole: a device never ends, and a file of some
/// gigabytes takes the memory of the machine before the parser says that it is no JSON.
///
/// # Errors
/// The file cannot be read, or is no packing.
pub(super) fn packing_at(path: &Path) -> Result<Packing, PackingError> {
    let refuse = |reason: String| Err(PackingError::Content(format!("packing file {}: {reason}", path.display())));
    // What the system does not describe is read, and refused with the system's reason.
    if let Ok(metadata) = std::fs::metadata(path) {
        if metadata.file_type().is_char_device() || metadata.file_type().is_block_device() {
            return refuse("this is a device, not a file".to_owned());
        }
        if metadata.len() > LARGEST_PACKING {
            return refuse(format!(
                "it has {} bytes; the largest packing that is read has {LARGEST_PACKING}",
                metadata.len()
            ));
        }
    }
    Packing::read(path)
}
