//! Packings: the JSON file that any source may write, and the generator that prepares one.

pub mod file;
pub mod generate;
pub mod listed_contact;
pub mod recipe;

pub use file::{Packing, PackingError, PackingFile};
pub use generate::{PackingProgress, PackingReport, generate};
pub use listed_contact::ListedContact;
pub use recipe::{Grading, PackingRecipe};
