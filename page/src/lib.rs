//! The page of a run: everything that an output folder tells, in a browser.
//!
//! The same page is served while a run goes on ([`serve`], `grainspan watch`) and written as one file afterwards ([`report`],
//! `grainspan report`); only the way in which it gets its data differs. The data are JSON, made here from the files of the
//! folder and nothing else ([`data`]); drawing is done in the browser (`assets/`). Files may be half written at any moment: whatever
//! cannot be understood yet is left out, and shown as missing.

pub mod cell;
mod controls;
pub mod data;
mod error;
mod folder;
mod numbers;
mod program;
mod report;
mod server;
mod stamp;

pub use controls::{Action, Controls, NO_CHECKPOINTS, NOT_SAVED, PAUSED};
pub use error::PageError;
pub use folder::RunFolder;
pub use program::Program;
pub use report::report;
pub use server::{Server, ServerSettings};
