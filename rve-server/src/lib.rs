//! The grain side: a periodic cell of discs, its quasi-static solver, homogenization, tangent operators, packings.

pub mod network;
pub mod tangent;
