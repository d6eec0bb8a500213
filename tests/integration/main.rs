//! Tests of the whole program, in one binary: each further one would be linked against everything again.
//!
//! | folder | holds |
//! | --- | --- |
//! | `command_line/` | what the commands accept, write and say |
//! | `processes/` | workers that come, die and come back; checkpoints; equal bytes whatever happens |
//! | `physics/` | scenes against closed forms and independent engines |
//! | `engines_outside/` | conformance of engines outside this program |
//! | `repository/` | what the folders, documents and deployment files promise |
//!
//! `cargo test --release --test integration physics::` runs one folder.

mod command_line;
mod engines_outside;
#[path = "../harness/mod.rs"]
mod harness;
mod in_process;
mod physics;
mod processes;
mod repository;
