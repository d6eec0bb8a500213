//! The scene file: from TOML text to a problem, a definition of the grains, and what to write.

mod build;
mod changes;
mod conditions;
mod document;
mod engines;
mod initial;
mod input_error;
mod links;
mod materials;
mod mesh;
mod motion;
mod probes;
mod recording;
mod schema;
mod sets;
mod solving;
mod stages;
mod strategies;
mod supervision;

pub(crate) use build::{Scene, read_packing};
pub(crate) use changes::changes;
pub(crate) use document::Kind;
pub(crate) use materials::{Materials, PackingCopy};

pub use document::Document;
pub use input_error::InputError;
pub use materials::drawn;
pub use supervision::JOBS_A_MESSAGE;

/// The scene that unit tests change: one element, two kinds of cells. Errors as people see them.
#[cfg(test)]
fn weak_element(more: &[&str]) -> Result<Scene, String> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/biaxial-weak-element.toml");
    let overrides: Vec<String> = more.iter().map(|&text| text.to_owned()).collect();
    Scene::load(&path, &overrides).map_err(|error| error.to_string())
}
