//! How long the messages between the macro process and its workers may be.
//!
//! A message holds trials with their states. Where the states are large, the usual length has room for a few alone: fewer than a worker
//! solves side by side, so that its lanes run half empty and the messages cost more than they save.

use protocol::Definition;
use protocol::transport::shared_memory::{ChannelLimits, RunDirectory};

/// Definitions of the largest cell that a message has room for. States are somewhat longer: of 4096 spheres 20 fit, two rounds through the
/// lanes of a worker.
const DEFINITIONS: u64 = 32;

/// Longest message whatever the cells, bytes.
const LONGEST: u64 = 64 << 20;

/// Messages of one worker that may be under way at the same time, both directions together, and as many bytes for others.
const UNDER_WAY: u64 = 8;

/// Length of the longest message to or from workers that serve these definitions, bytes. Results do not depend on it.
///
/// Nobody but its engine knows how long a state is. A definition lists grains and contacts as a state does, so its length is the measure.
pub(super) fn message_bytes(definitions: &[Definition], workers: usize) -> u64 {
    let largest = definitions.iter().map(|definition| definition.bytes.len()).max().unwrap_or(0);
    longest(largest as u64, workers, RunDirectory::free_room())
}

/// The same for definitions of this length and this much free shared memory.
fn longest(definition_bytes: u64, workers: usize, room: Option<u64>) -> u64 {
    let usual = ChannelLimits::default().message_bytes;
    let share = room.map_or(LONGEST, |bytes| bytes / (UNDER_WAY * workers.max(1) as u64));
    DEFINITIONS.saturating_mul(definition_bytes).min(LONGEST).min(share).max(usual)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_have_room_for_full_lanes_of_large_cells_as_far_as_shared_memory_goes() {
        let usual = ChannelLimits::default().message_bytes;
        let plenty = Some(24 << 30);
        assert_eq!(longest(20_000, 2, plenty), usual, "cells of 400 discs");
        assert_eq!(longest(600_000, 2, plenty), 19_200_000, "cells of 4096 spheres");
        assert_eq!(longest(600_000, 2, None), 19_200_000, "shared memory without a limit");
        assert_eq!(longest(u64::MAX, 2, plenty), LONGEST);
        assert_eq!(longest(600_000, 2, Some(64 << 20)), usual, "a container with 64 MB");
        assert_eq!(longest(600_000, 200, plenty), (24 << 30) / 1600);
        let definition = |length: usize| Definition { bytes: vec![0; length] };
        assert_eq!(message_bytes(&[], 2), usual);
        assert!(message_bytes(&[definition(100), definition(1_000_000)], 1) >= usual);
    }
}
