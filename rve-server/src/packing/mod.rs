//! Packings: the JSON file that any source may write, and the generator that prepares one.

pub mod file;

pub use file::{PackingError, PackingFile};
