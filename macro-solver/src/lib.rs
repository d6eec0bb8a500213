//! The finite-element side: mesh, elements, implicit solver, worker pool, outputs. It never sees a grain.

pub mod material;
pub mod mesh;
pub mod observer;
pub mod output;
pub mod problem;
pub mod pool;
