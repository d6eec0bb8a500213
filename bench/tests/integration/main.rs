//! Tests of the whole program of the benchmarks, in one binary.

mod program;
mod shortcuts;
mod stability;
mod studies;
