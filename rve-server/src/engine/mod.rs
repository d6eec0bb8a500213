//! The grain engine behind the protocol: definitions in, trials out.

mod grain_engine;
mod listed_forces;
mod rve;
mod snapshot;
mod version;

pub use grain_engine::{GrainEngine, listed_forces};
pub use listed_forces::ListedForces;
pub use rve::GrainRve;
pub use snapshot::ENGINE_NAME;
pub use version::ENGINE_VERSION;
