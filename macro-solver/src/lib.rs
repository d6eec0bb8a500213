//! The finite-element side: mesh, elements, formulations, solution procedures, worker pool, outputs. It never sees a grain.
//!
//! Folders, lowest first; each imports only from those above it:
//!
//! * [`formulation`]: strain measures and conversions of stresses and moduli;
//! * [`element`]: shape functions, quadrature, masses, hourglass control;
//! * [`mesh`]: nodes, elements, sets; generators; Gmsh;
//! * [`nonlocal`]: averages over neighbouring Gauss points;
//! * [`problem`]: what is to be solved, as plain data: conditions, histories, stages, strategies; its validation;
//! * [`checkpoint`]: sections of state, files, failure cases;
//! * [`material`]: the trait [`material::PointMaterial`], from which elements get their stresses; closed-form materials; estimated error;
//! * [`observer`]: what a run reports to its outputs;
//! * [`output`]: history, fields, grains, probes, summary;
//! * `model`: shared by all procedures: Gauss points, loads, constraints, assembly of the elements;
//! * [`solve`]: the driver of stages and steps; Newton's method, explicit dynamics, dynamic relaxation, viscous stabilisation;
//! * [`pool`]: the worker pool, a [`material::PointMaterial`] whose points are solved by other processes.
//!
//! # Conventions
//!
//! SI units and `f64`. Stress and strain components are **positive in tension**; pressures, and quantities named compression, deviator, `p`
//! or `q`, are positive in compression. Positions have three coordinates; a plane body is 1 m thick, and its forces are per metre. A
//! material receives `H = F - I` relative to the committed state of the point and returns the Cauchy stress.
//!
//! `ARCHITECTURE.md` is the map of all crates; section 10 of `docs/concepts/theory.md` says which file holds which equation.

pub mod checkpoint;
pub mod element;
pub mod formulation;
pub mod material;
pub mod mesh;
mod model;
pub mod nonlocal;
pub mod observer;
pub mod output;
pub mod pool;
pub mod problem;
pub mod solve;
