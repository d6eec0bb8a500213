//! Worker processes of a run: started, watched, replaced and dismissed.
//!
//! A worker is the program `grainspan` as `grainspan rve-server`, or the program of another engine. It cannot outlive the process
//! that started it: the kernel sends it SIGTERM when the thread that started it ends for any reason. That thread therefore has to
//! live as long as its workers are wanted.

mod engine;
mod launch;
mod message_length;
mod restart_backoff;
mod run_name;
mod stderr_tail;
mod worker_groups;
mod worker_processes;

pub use engine::{Engine, OWN_NAME, RUNNING_PROGRAM};
pub use run_name::run_name;
pub use worker_groups::WorkerGroups;
pub use worker_processes::{LaunchPlan, WorkerProcesses};

use protocol::Definition;
use protocol::transport::shared_memory::ChannelLimits;
use std::num::NonZeroUsize;

/// Workers per core beyond which a run has to be confirmed by the key `pool.most_workers`.
const MOST_PER_CORE: usize = 8;

/// Workers that any machine takes, whatever its cores; measured on one core.
const MOST_ANYWHERE: usize = 64;

/// Default limit of workers on this machine: thousands of processes leave no room even for the command that ends them.
pub fn most_workers() -> usize {
    usual_most(std::thread::available_parallelism().map_or(1, NonZeroUsize::get))
}

fn usual_most(cores: usize) -> usize {
    cores.saturating_mul(MOST_PER_CORE).max(MOST_ANYWHERE)
}

/// Channels for all workers, for as many that have ended and are not removed yet, and for 16 that join by hand. Messages have room for
/// several states of each definition; without any they have the usual length.
pub fn channel_limits(workers: usize, definitions: &[Definition]) -> ChannelLimits {
    let usual = ChannelLimits::default();
    let wanted = u32::try_from(workers.saturating_mul(2).saturating_add(16)).unwrap_or(u32::MAX);
    let message_bytes = message_length::message_bytes(definitions, workers);
    ChannelLimits { message_bytes, workers: usual.workers.max(wanted), ..usual }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_machines_take_64_workers_and_large_ones_8_per_core() {
        assert_eq!([1, 2, 8, 9, 128].map(usual_most), [64, 64, 64, 72, 1024]);
    }
}
