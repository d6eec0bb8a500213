//! Memory of messages that have been sent or handled, for the next ones.
//!
//! Long messages live for a millisecond. In fresh memory each 4 kB of them cost a page fault, a quarter of an agent's time.

use crate::lock;
use std::sync::{Arc, Mutex};

/// Most buffers that wait for use.
const MOST: usize = 16;

/// Shorter messages are made in memory that the allocator has at hand.
const SHORTEST: usize = 16 << 10;

/// Longer ones are rare, and their memory is given back to the system.
const LONGEST: usize = 2 << 20;

/// Buffers that wait for use; what is in them is left over from an earlier message.
#[derive(Clone, Debug)]
pub(crate) struct Buffers {
    waiting: Arc<Mutex<Vec<Vec<u8>>>>,
    most: usize,
}

impl Buffers {
    /// An empty store.
    pub(crate) fn new() -> Self {
        Self { waiting: Arc::default(), most: MOST }
    }

    /// A store that keeps nothing.
    pub(crate) fn none() -> Self {
        Self { waiting: Arc::default(), most: 0 }
    }

    /// A buffer with room for `length` bytes, if one waits.
    pub(crate) fn take(&self, length: usize) -> Option<Vec<u8>> {
        if length < SHORTEST {
            return None;
        }
        let mut waiting = lock(&self.waiting);
        let place = waiting.iter().rposition(|buffer| buffer.capacity() >= length)?;
        Some(waiting.swap_remove(place))
    }

    /// Takes back the memory of a message.
    pub(crate) fn give(&self, buffer: Vec<u8>) {
        if !(SHORTEST..=LONGEST).contains(&buffer.capacity()) || self.most == 0 {
            return;
        }
        let mut waiting = lock(&self.waiting);
        if waiting.len() >= self.most {
            // Room for longer messages is worth more.
            let shortest = (0..waiting.len()).min_by_key(|&place| waiting[place].capacity());
            match shortest {
                Some(place) if waiting[place].capacity() < buffer.capacity() => waiting.swap_remove(place),
                _ => return,
            };
        }
        waiting.push(buffer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_used_again_and_bounded() {
        let buffers = Buffers::new();
        assert_eq!(buffers.take(SHORTEST), None);
        buffers.give(Vec::with_capacity(SHORTEST - 1));
        buffers.give(Vec::with_capacity(LONGEST + 1));
        assert_eq!(buffers.take(SHORTEST), None, "neither is worth it");
        for place in 0..2 * MOST {
            buffers.give(Vec::with_capacity(SHORTEST + place));
        }
        assert_eq!(lock(&buffers.waiting).len(), MOST);
        assert_eq!(buffers.take(SHORTEST + 2 * MOST), None, "too short, all of them");
        let found = buffers.take(SHORTEST + 2 * MOST - 1).unwrap();
        assert!(found.capacity() >= SHORTEST + 2 * MOST - 1, "the longest are kept");
        assert_eq!(buffers.take(100), None, "not for short messages");
        let none = Buffers::none();
        none.give(Vec::with_capacity(SHORTEST));
        assert_eq!(none.take(SHORTEST), None);
    }
}
