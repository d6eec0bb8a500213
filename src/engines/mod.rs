//! Engines of a run: the built-in one and programs of other origin. Where they are listed, how they are started, what they can do,
//! and which Gauss points each of them solves.

mod assignment;
mod capabilities;
mod catalogue;
mod compatibility;

pub(crate) use assignment::{EngineAssignment, PoolDefinitions};
pub(crate) use capabilities::capabilities_of;
pub(crate) use catalogue::Catalogue;
pub(crate) use compatibility::{Compatibility, Requirements, compatibility};
pub(crate) use grain_pool::processes::Engine;

/// Keyword of the engine inside this program, as scenes write it.
pub(crate) use scene_reader::BUILT_IN_ENGINE as BUILT_IN;
