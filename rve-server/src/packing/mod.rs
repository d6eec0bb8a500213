//! Packings: the JSON file that any source may write, and the generator that prepares one.

pub mod file;
pub mod generate;
pub mod recipe;

pub use file::{ListedContact, PackingError, PackingFile};
pub use generate::{PackingProgress, PackingReport, generate};
pub use recipe::{Grading, PackingRecipe};
