//! What a macro process and its RVE workers say to each other.
//!
//! This crate knows neither grains nor finite elements. It fixes
//!
//! * the **contract** of an RVE engine ([`engine`]): trial, commit, rollback, snapshot, restore; what a [`trial`] is asked for, tangent operators
//!   ([`tangent_kind`]) among them, and returns; why engines refuse ([`rve_error`]); what they can do ([`capabilities`]);
//! * which **targets** no engine can follow ([`target`]);
//! * its **optional results** ([`observed`]): requested, declared, delivered;
//! * the **wire types** ([`wire`]): fixed-layout jobs and replies that are loaned in shared memory;
//! * the **control messages** ([`control`]): hello, welcome, define, drain, bye, encoded as MessagePack;
//! * the **snapshot envelope** ([`snapshot`]) and the content identity of states and definitions ([`identity`]);
//! * the **words** of enums that people choose from ([`keyword`]);
//! * the **transports** ([`transport`]): iceoryx2 shared memory between processes, channels inside one process.
//!
//! # Conventions
//!
//! SI units and `f64` throughout. Stress is **tension positive**. Tensors are 3x3, row-major; a plane problem uses
//! the upper left 2x2 block and leaves the rest zero. `F` maps reference to current positions and a deformation is
//! always sent as the displacement gradient `H = F - I` because forming `F` first loses digits at small strain.

pub mod capabilities;
mod clock;
pub mod control;
pub mod engine;
pub mod identity;
pub mod keyword;
pub mod layout;
pub mod observed;
pub mod process;
pub mod rve_error;
pub mod snapshot;
pub mod tangent_kind;
pub mod target;
pub mod tensor;
pub mod transport;
pub mod trial;
pub mod wire;

pub use capabilities::{Capabilities, SnapshotKind};
pub use clock::nanoseconds_since;
pub use engine::{Definition, RveEngine, RveSolver, TrialRequest, solve_alone};
pub use identity::{ContentId, DefinitionId, StateId};
pub use observed::{Observables, Observed, OptionalResult};
pub use rve_error::RveError;
pub use tangent_kind::TangentKind;
pub use tensor::{Tensor2, Tensor4};
pub use trial::{Cost, MOST_RAMP_STEPS, Scalars, TrialFlags, TrialOptions, TrialResult};

/// Version of the conversation. A worker and a macro that differ refuse each other with a clear message.
pub const PROTOCOL_VERSION: u32 = 5;
