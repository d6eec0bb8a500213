//! Programs over one cell or one body of grains, without finite elements.

pub mod frame;
pub mod rve_test;
pub mod specimen;
