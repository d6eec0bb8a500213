//! The boundary-particle frame of [Liu2018]: a packing whose border is a chain of grains, driven through these grains.

pub mod cell;
pub mod constraint;
pub(crate) mod element;
pub mod geometry;
pub mod options;
mod relaxation;
#[cfg(test)]
mod tests;

pub use cell::{FRAME_ENGINE_NAME, FrameDefinition, FrameEngine, FrameRve};
pub use constraint::FrameConstraint;
pub use geometry::FrameGeometry;
pub use options::{FrameControl, FrameDamping, FrameOptions};
