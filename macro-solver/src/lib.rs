//! The finite-element side: mesh, elements, formulations, solution procedures, worker pool, outputs. It never sees a grain.

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
