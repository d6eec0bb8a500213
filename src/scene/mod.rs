//! The scene file: from TOML text to a problem, a definition of the grains, and what to write.

pub(crate) mod document;
pub(crate) mod input_error;
