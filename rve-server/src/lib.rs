//! The grain side: a periodic cell of discs or spheres, its quasi-static solver, homogenization, tangent operators, packings.

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
