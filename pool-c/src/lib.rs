//! The pool of cells of grains for programs in C and whatever calls C. The header is `pool-c/grainspan_pool.h`; it is generated from
//! this crate, and a test fails when it is stale.
//!
//! # Why `unsafe` is allowed here, and what makes it sound
//!
//! Calls from C cannot be checked by the compiler. Every function checks its pointers for null and reads or writes exactly the lengths
//! that the header states; a pool comes from `grainspan_pool_open` and is given to `grainspan_pool_close` once. No function keeps a
//! pointer. What remains with the caller is that lengths are true. A panic does not cross the boundary: it becomes an error text.

mod ffi_boundary;
mod functions;
mod gather;
mod material;
mod measures;
mod mgis;
mod umat;

pub use functions::{
    GrainspanPool, grainspan_commit, grainspan_dimension, grainspan_last_error, grainspan_new_states,
    grainspan_pool_close, grainspan_pool_open, grainspan_restore, grainspan_rollback, grainspan_snapshot,
    grainspan_trial,
};
pub use mgis::{
    View, finite_axisymmetrical, finite_plane_strain, finite_tridimensional, small_axisymmetrical,
    small_plane_strain, small_tridimensional,
};
pub use umat::umat_;
