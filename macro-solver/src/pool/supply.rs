//! Where workers come from: the seam between the pool and whoever starts processes.

use std::time::Duration;

/// Whether workers may still join.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SupplyStatus {
    /// Workers are alive, starting or may join; ask again after this time.
    Expected {
        /// When the supply wants to be tended again.
        check_again: Duration,
    },
    /// No further worker will join; those that serve go on. The reason is for people.
    Exhausted(String),
}

/// Starts and replaces workers on the pool's behalf. All calls come from the pool's thread.
pub trait WorkerSupply {
    /// The worker with this process id was welcomed.
    fn joined(&mut self, pid: u32);

    /// The worker with this process id was refused; another of its kind would be refused as well.
    fn refused(&mut self, pid: u32, reason: &str);

    /// The worker with this process id is gone and should be replaced; `had_answered` tells whether it was of any use.
    fn lost(&mut self, pid: u32, had_answered: bool);

    /// The worker with this process id has said goodbye and closed its channel: its process is about to end by itself
    /// and should be replaced. `had_answered` as in [`lost`](Self::lost): of a worker that was of use the replacement does not count
    /// against any limit.
    fn left(&mut self, pid: u32, had_answered: bool) {
        self.lost(pid, had_answered);
    }

    /// Called regularly while the pool waits: starts replacements that are due.
    fn tend(&mut self) -> SupplyStatus;

    /// Workers started beyond the first set.
    fn restarts(&self) -> u64;

    /// Called once after every worker was told to leave: returns when no process of this supply is alive.
    fn finish(&mut self);
}

/// A supply that starts nobody: workers join from elsewhere (attached runs, threads of this process).
#[derive(Clone, Copy, Debug, Default)]
pub struct JoiningWorkers;

impl WorkerSupply for JoiningWorkers {
    fn joined(&mut self, _pid: u32) {}

    fn refused(&mut self, _pid: u32, _reason: &str) {}

    fn lost(&mut self, _pid: u32, _had_answered: bool) {}

    fn tend(&mut self) -> SupplyStatus {
        SupplyStatus::Expected { check_again: Duration::from_secs(1) }
    }

    fn restarts(&self) -> u64 {
        0
    }

    fn finish(&mut self) {}
}
