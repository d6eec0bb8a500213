//! One binary that plays every role: macro solver, worker, and the tools around them.

mod scene;

fn main() {}
