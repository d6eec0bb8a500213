//! Cells of grains (RVEs) for programs that bring their own finite elements, or none.
//!
//! | type | role |
//! | --- | --- |
//! | [`RvePool`] | worker processes that answer trials of many points at once; every point is a [`State`] |
//! | [`Rve`] | one cell in this process |
//! | [`element_test`] | one cell along a path of strains and stresses, as `grainspan element` |
//! | [`processes`] | starting and replacing worker processes; the program `grainspan` uses it too |
//!
//! A trial starts from the committed state of its point and leaves it alone. It has the same bits in any worker, in this process and
//! in a run of the program `grainspan`.
//!
//! # Conventions
//!
//! SI units. Stress is tension positive. A deformation is the displacement gradient `H = F - I` from the committed configuration of the
//! point. Plane cells use the upper left 2x2 block of 3x3 tensors. The tangent is `C_ijkl = d sigma_ij / d F_kl` with `F` relative to
//! the end of the trial.

mod element_test;
mod error;
mod pool;
pub mod processes;
mod rve;
mod snapshot;

pub use element_test::{ElementOutcome, element_test};
pub use error::PoolError;
pub use pool::{PoolOptions, RvePool, State, Trial};
pub use rve::Rve;
pub use snapshot::{Snapshot, SnapshotError};
