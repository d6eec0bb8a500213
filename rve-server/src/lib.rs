//! The grain side: a periodic cell of discs or spheres, its quasi-static solver, homogenization, tangent operators, packings.
//!
//! Folders, lowest first; each imports only from those above it:
//!
//! * [`simd`]: real numbers and arrays of them behind one trait, so that one source serves scalar and vector code;
//! * [`space`]: the dimension: vectors, tensors, spins and slip of discs and spheres;
//! * [`cell`]: state of a periodic cell, neighbours, contact network, reduction of skewed cells;
//! * [`contact`]: contact laws, composed of springs, friction, adhesion, rolling resistance and viscosity; the table `[contact]`;
//! * [`definition`]: what defines a cell: packing file, contact table, options;
//! * [`solver`]: from a strained cell to equilibrium: relaxation, event-driven solver, force kernels;
//! * [`homogenization`]: stress, fabric, coordination number, rattlers, observables;
//! * [`tangent`]: tangent operators `d sigma / d F`;
//! * [`engine`]: trial, commit, rollback, snapshot, restore behind `protocol::RveEngine`;
//! * [`preparation`]: packings from a recipe;
//! * [`programs`]: element tests, whole specimens and frames, without finite elements;
//! * [`server`]: the loop of a worker process.
//!
//! # Conventions
//!
//! SI units and `f64`. Stress and the normal force of a contact are **positive in tension**; overlaps are positive where grains touch.
//! `F` maps reference to current positions; deformations are passed as `H = F - I` relative to the committed state. The conventions of
//! one contact are those of `cell/network.rs`. A trial is a pure function of committed state, target and
//! options, bit for bit.
//!
//! `ARCHITECTURE.md` is the map of all crates; section 10 of `docs/concepts/theory.md` says which file holds which equation.

/// Tests that the release suite shares name the crate as it does.
#[cfg(test)]
extern crate self as rve_server;

pub mod cell;
pub mod contact;
pub mod definition;
pub mod engine;
pub mod error;
pub mod homogenization;
pub mod preparation;
pub mod programs;
pub mod server;
pub mod simd;
pub mod solver;
pub mod space;
pub mod tangent;
