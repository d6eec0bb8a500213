//! Axes of a specimen by name.

/// Names of the axes.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// Number of the axis of this name.
pub(super) fn axis_of(name: &str) -> Option<usize> {
    AXES.iter().position(|axis| *axis == name)
}
