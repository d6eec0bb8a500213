//! The extension module `grainspan._native`. It moves numbers and text between Python and the crate `grain-pool` and decides nothing;
//! what users see is the package in `python/grainspan/`.
//!
//! Arrays travel as their bytes: contiguous `float64` in, byte arrays out, which NumPy views without a copy. The interpreter is
//! released while grains are solved, and signals are looked at some 20 times a second.

// The macros of PyO3 expand to calls of the C interface of Python.
#![allow(unsafe_code)]

mod arrays;
mod cell;
mod error;
mod pool;
mod result;
mod signals;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::build;
    #[pymodule_export]
    use super::cell::{Rve, element_test};
    #[pymodule_export]
    use super::pool::Pool;
    #[pymodule_export]
    use super::result::{observable_names, tangent_names};
}

/// Version, compiler and code generation flags of this build; the executable of the same build says the same.
#[pyfunction]
fn build() -> [(&'static str, &'static str); 3] {
    use grainspan::build_info::{COMPILER, FLAGS, VERSION};
    [("version", VERSION), ("compiler", COMPILER), ("flags", FLAGS)]
}
