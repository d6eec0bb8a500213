//! How long the messages between the macro process and its workers may be.
//!
//! A message holds trials with their states. Where the states are large, the usual length has room for a few alone: fewer than a worker
//! solves side by side, so that its lanes run half empty and the messages cost more than they save.

use crate::cli::estimate::state_bytes;
use protocol::transport::shared_memory::{ChannelLimits, RunDirectory};
use scene_reader::Scene;

/// Trials of the largest cell that a message has room for: two rounds through the lanes of a worker.
const TRIALS: f64 = 16.0;

/// Longest message whatever the cells, bytes.
const LONGEST: u64 = 64 << 20;

/// Messages of one worker that may be under way at the same time, both directions together, and as many bytes for others.
const UNDER_WAY: u64 = 8;

/// Length of the longest message of a run, bytes. Results do not depend on it.
pub(super) fn message_bytes(scene: &Scene, workers: usize) -> u64 {
    let largest = scene.materials.definitions.iter().map(state_bytes).fold(0.0, f64::max);
    longest(largest, workers, RunDirectory::free_room())
}

/// The same for states of this size and this much free shared memory.
fn longest(state_bytes: f64, workers: usize, room: Option<u64>) -> u64 {
    let usual = ChannelLimits::default().message_bytes;
    let share = room.map_or(LONGEST, |bytes| bytes / (UNDER_WAY * workers.max(1) as u64));
    ((TRIALS * state_bytes) as u64).min(LONGEST).min(share).max(usual)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_have_room_for_full_lanes_of_large_cells_as_far_as_shared_memory_goes() {
        let usual = ChannelLimits::default().message_bytes;
        let plenty = Some(24 << 30);
        assert_eq!(longest(6e4, 2, plenty), usual, "cells of 400 discs");
        assert_eq!(longest(1.25e6, 2, plenty), 20_000_000, "cells of 4096 spheres");
        assert_eq!(longest(1.25e6, 2, None), 20_000_000, "shared memory without a limit");
        assert_eq!(longest(1e9, 2, plenty), LONGEST);
        assert_eq!(longest(1.25e6, 2, Some(64 << 20)), usual, "a container with 64 MB");
        assert_eq!(longest(1.25e6, 200, plenty), (24 << 30) / 1600);
    }
}
