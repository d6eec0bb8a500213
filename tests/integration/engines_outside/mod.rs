//! Engines outside this program: the conformance claims for every engine and transport, agreement with the built-in
//! engine, and whole runs.
//!
//! Needs a Python with the dependencies of `adapters/python`: the one that `GRAINSPAN_TEST_PYTHON` names, else
//! `target/adapters-venv/bin/python` (made by `adapters/make-venv`), else `python3`. What cannot be tested for want of it
//! is printed; `GRAINSPAN_REQUIRE_ENGINES=reference,yade,lammps` makes a missing engine an error.

mod agreement;
mod claims;
mod conversation;
mod defaults;
mod foreign;
mod native;
mod pipe;
mod runs;
mod worker_endings;
