//! A periodic cell of grains: its periodicity, its state, its neighbours, and its contacts as a frozen network.

mod event_memory;
mod neighbours;
pub mod network;
mod operator_memory;
mod periodic;
mod reduction;
pub mod state;

pub use event_memory::{EventMemory, StoredResponse};
pub use neighbours::{PairFinder, PairKey};
pub use network::{ContactNetwork, NetworkContact};
pub use operator_memory::{Calibration, OperatorMemory};
pub use periodic::Cell;
pub(crate) use periodic::translation;
pub(crate) use reduction::{reduced, renamed, shortened};
pub use state::{ContactRecord, GrainState};
