//! Input files of Grainspan: from TOML text to a checked problem, the definition of the grains behind it, and what to
//! record. Every error names its file and line, or the `--set` argument that caused it, and the remedy.

mod accuracy;
mod build;
mod cell;
mod changes;
mod conditions;
mod document;
mod engines;
mod initial;
mod input_copy;
mod input_error;
mod materials;
mod mesh;
mod motion;
mod multi_point_constraints;
mod packing;
mod path_reach;
mod place;
mod preparation;
mod probes;
mod problem_error;
mod recording;
mod reference;
mod remarks;
mod sets;
mod solving;
mod stages;
mod study;
mod supervision;
mod tables;

pub use build::Scene;
pub use cell::{read_cell, read_element_test};
pub use changes::changes;
pub use document::{Document, Kind};
pub use engines::EnginePlan;
pub use input_copy::InputCopy;
pub use input_error::InputError;
pub use keys::Table;
pub use materials::{Densities, Materials, drawn};
pub use packing::read_packing;
pub use preparation::CellPreparation;
pub use reference::{completions, explained, mentioned, nearest_key, overview};
pub use study::{
    ChosenRows, Ensemble, EnsembleStatistic, Expectation, Expected, PathStrain, RowMeasure, SAMPLE_COLUMNS, Study,
    StudyQuantity, StudyRecipe, StudyTest, read_study,
};
pub use supervision::{JOBS_A_MESSAGE, PoolPlan};

/// Keyword of the engine inside this program.
pub const BUILT_IN_ENGINE: &str = "grains";

/// Engine of scenes with `[rve] frame` that name no other.
pub(crate) const FRAME_ENGINE: &str = "boundary-frame";

/// The scene that unit tests change: one element, two kinds of cells. Errors as people see them.
#[cfg(test)]
fn weak_element(more: &[&str]) -> Result<Scene, String> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/biaxial-weak-element.toml");
    let overrides: Vec<String> = more.iter().map(|&text| text.to_owned()).collect();
    Scene::load(&path, &overrides).map_err(|error| error.to_string())
}
