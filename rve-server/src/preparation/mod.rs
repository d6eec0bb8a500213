//! Preparation of packings: from a recipe to a packing in equilibrium at its stress.

mod at_stress;
mod compaction;
mod first_vectors;
mod friction_search;
pub mod generate;
pub mod grading;
mod preshear;
mod progress;
mod random_placement;
pub mod recipe;
mod removal;
pub mod report;
mod rotation;
mod servo;
mod soft_grains;
mod stress_target;

pub use at_stress::PreparedCell;
pub use friction_search::FrictionAttempt;
pub use generate::{generate, generate_any};
pub use grading::Grading;
pub use preshear::ShearAttempt;
pub use progress::PackingProgress;
pub(crate) use random_placement::chosen;
pub use recipe::{AnisotropyTarget, PackingRecipe, Removal, StateTarget};
pub use removal::WeakenedPacking;
pub(crate) use report::anisotropy_of_fabric;
pub use report::{PackingReport, Requirement, Searches};
pub use soft_grains::{SoftGrains, doubtful_lengths, soft_grains, stiffness_hint};
pub use stress_target::StressTarget;
