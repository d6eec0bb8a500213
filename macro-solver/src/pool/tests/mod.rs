//! The pool against scripted workers: every fault that a worker can commit, without any process.

mod faults;
mod handshake;
mod results;
mod scripted;
