//! The finite-element side: mesh, elements, formulations, implicit solver, worker pool, outputs. It never sees a grain.

mod body;
pub mod checkpoint;
pub mod damage;
pub mod difference;
pub mod dynamics;
pub mod elastic;
pub mod element;
pub mod formulation;
pub mod implicit;
pub mod material;
pub mod mesh;
pub mod nonlocal;
pub mod observer;
pub mod output;
pub mod pool;
pub mod problem;
pub mod trial_costs;
