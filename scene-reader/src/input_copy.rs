//! Files that a scene names, as they go along with a run.

/// A packing or mesh file as it goes along with a run.
#[derive(Clone, Debug, PartialEq)]
pub struct InputCopy {
    /// Path to the key of the scene that names it, with dots.
    pub key: String,
    /// Where it lies in the output folder.
    pub name: String,
    /// Its text.
    pub text: String,
}
