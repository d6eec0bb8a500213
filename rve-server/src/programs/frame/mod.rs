//! The boundary-particle frame of [Liu2018]: a packing whose border is a chain of grains, driven through these grains.

pub mod cell;
mod constraint;
mod contacts;
pub mod geometry;
mod motion;
pub mod options;
mod relaxation;
#[cfg(test)]
mod tests;

pub use crate::definition::{FrameConstraint, FrameControl};
pub use cell::{FRAME_ENGINE_NAME, FrameDefinition, FrameEngine, FrameRve};
pub use options::{FrameDamping, FrameOptions};
