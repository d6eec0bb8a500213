//! Packings: the JSON file that any source may write, and the generator that prepares one.

mod bed;
#[cfg(test)]
mod bed_tests;
pub mod file;
mod friction_search;
pub mod generate;
pub mod grading;
mod journal;
pub mod listed_contact;
mod preshear;
pub mod recipe;
mod removal;
pub mod report;
mod rotation;
mod scatter;
mod servo;
mod stress_target;

pub use file::{Packing, PackingError, PackingFile};
pub use friction_search::FrictionAttempt;
pub use generate::{Searches, generate, generate_any};
pub use grading::Grading;
pub use journal::PackingProgress;
pub use listed_contact::ListedContact;
pub use preshear::ShearAttempt;
pub use recipe::{AnisotropyTarget, PackingRecipe, Removal, StateTarget};
pub(crate) use report::anisotropy_of_fabric;
pub use report::{PackingReport, Requirement};
pub use stress_target::StressTarget;
