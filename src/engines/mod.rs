//! Engines outside this program: where they are listed, how one is started, and what it says it can do.

mod catalogue;
mod crew;
mod inquiry;
mod suitability;

pub(crate) use catalogue::{Catalogue, Engine};
pub(crate) use crew::Crew;
pub(crate) use inquiry::capabilities_of;
pub(crate) use suitability::{Suitability, suitability};

/// Keyword of the engine inside this program, as scenes write it.
pub(crate) use scene_reader::BUILT_IN_ENGINE as BUILT_IN;
