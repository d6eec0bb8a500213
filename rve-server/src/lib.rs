//! The grain side: a periodic cell of discs or spheres, its quasi-static solver, homogenization, tangent operators, packings.

/// Tests that the release suite shares name the crate as it does.
#[cfg(test)]
extern crate self as rve_server;

pub mod cell;
mod cell_reduction;
pub mod definition;
pub mod element;
pub mod engine;
pub mod frame;
pub mod grains;
pub mod homogenization;
pub mod lanes;
pub mod law;
pub mod model;
pub mod network;
pub mod packing;
pub mod pairs;
pub mod plane;
pub mod probing;
mod relaxation;
pub mod server;
pub mod space;
pub mod specimen;
pub mod state;
pub mod tangent;
pub mod two_body;
