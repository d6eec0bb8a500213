//! How an end of the channel passes the time until something comes.
//!
//! A wake-up through the kernel costs some 10 us and no processor time while waiting; looking at shared memory again and
//! again sees a message within a microsecond and burns a core. On a machine with fewer cores than busy processes a
//! waiting process that burns a core takes it from the one it is waiting for.

use serde::{Deserialize, Serialize};
use std::fs;
use std::hint::spin_loop;
use std::time::{Duration, Instant};

/// How long a hybrid wait looks before it blocks: a few wake-ups through the kernel, far less than a solve.
const GLANCE: Duration = Duration::from_micros(50);

/// Longest time between two looks at what only the kernel knows: ended processes and the waker.
const KERNEL: Duration = Duration::from_millis(1);

/// How long a count of busy processes is believed.
const BELIEVED: Duration = Duration::from_millis(20);

/// Looks between two looks at the clock.
const LOOKS: usize = 16;

/// What an end of the channel does while nothing has come. No policy changes a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Waiting {
    /// Blocks until a message comes.
    #[default]
    Block,
    /// Polls for 50 us if a core is free, then blocks.
    Hybrid,
    /// Polls all the time. For measurements, and for machines with more cores than processes.
    Spin,
}

crate::keywords! {
    pub Waiting {
        Block => "block",
        Hybrid => "hybrid",
        Spin => "spin",
    }
}

/// Carries out a policy for one end.
#[derive(Debug)]
pub(super) struct WaitState {
    waiting: Waiting,
    cores: usize,
    core_free: bool,
    counted: Option<Instant>,
    /// None: the next look must ask.
    last_kernel_look: Option<Instant>,
}

impl WaitState {
    pub(super) fn new(waiting: Waiting) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
        Self { waiting, cores, core_free: false, counted: None, last_kernel_look: None }
    }

    /// Whether this look must include what only the kernel knows. Such a look costs several system calls, as much as a
    /// wake-up, so an end that spins does not take it with each message.
    pub(super) fn asks_kernel(&mut self) -> bool {
        if self.waiting == Waiting::Block {
            return true;
        }
        if self.last_kernel_look.is_some_and(|time| time.elapsed() < KERNEL) {
            return false;
        }
        self.last_kernel_look = Some(Instant::now());
        true
    }

    /// The kernel has woken this end, so the next look must ask it why.
    pub(super) fn has_slept(&mut self) {
        self.last_kernel_look = None;
    }

    /// Looks until `come` says yes or the time that the policy allows is over. Returns whether to look at the messages
    /// now; otherwise the caller is to block.
    pub(super) fn look(&mut self, limit: Duration, come: impl Fn() -> bool) -> bool {
        let waiting = self.waiting;
        let allowed = match waiting {
            Waiting::Block => return false,
            Waiting::Hybrid if !self.core_is_free() => return false,
            Waiting::Hybrid => GLANCE.min(limit),
            Waiting::Spin => KERNEL.min(limit),
        };
        let begun = Instant::now();
        while begun.elapsed() < allowed {
            for _ in 0..LOOKS {
                if come() {
                    return true;
                }
                spin_loop();
            }
        }
        waiting == Waiting::Spin
    }

    /// Whether no more processes want to run than there are cores, this one included.
    fn core_is_free(&mut self) -> bool {
        if self.counted.is_none_or(|time| time.elapsed() > BELIEVED) {
            self.counted = Some(Instant::now());
            self.core_free = running().is_some_and(|running| running <= self.cores);
        }
        self.core_free
    }
}

/// Processes and threads that run or want to, on the whole machine; none if the system does not tell.
fn running() -> Option<usize> {
    // 0.20 0.18 0.12 1/80 11206: the fourth field begins with it.
    fs::read_to_string("/proc/loadavg").ok()?.split(' ').nth(3)?.split('/').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn who_blocks_does_not_look_and_who_spins_looks_until_it_comes() {
        let looks = Cell::new(0);
        let come = || {
            looks.set(looks.get() + 1);
            looks.get() == 100
        };
        assert!(!WaitState::new(Waiting::Block).look(Duration::from_secs(1), come));
        assert_eq!(looks.get(), 0);
        assert!(WaitState::new(Waiting::Spin).look(Duration::from_secs(10), come));
        assert_eq!(looks.get(), 100);
    }

    #[test]
    fn a_hybrid_wait_ends_by_blocking_and_needs_a_free_core() {
        let mut wait_state = WaitState::new(Waiting::Hybrid);
        assert!(!wait_state.look(Duration::from_secs(10), || false), "nothing came, so it has to block");
        wait_state.cores = 0;
        wait_state.counted = None;
        assert!(!wait_state.look(Duration::from_secs(10), || panic!("there is no core to look with")));
    }

    #[test]
    fn the_kernel_is_asked_now_and_then_by_those_who_spin_and_always_by_those_who_block() {
        let mut blocking = WaitState::new(Waiting::Block);
        assert!(blocking.asks_kernel() && blocking.asks_kernel());
        let mut spinning = WaitState::new(Waiting::Spin);
        assert!(spinning.asks_kernel());
        let begun = Instant::now();
        while !spinning.asks_kernel() {
            assert!(begun.elapsed() < Duration::from_secs(5), "the kernel is never asked");
        }
        assert!(begun.elapsed() >= KERNEL / 2);
        spinning.has_slept();
        assert!(spinning.asks_kernel());
    }

    #[test]
    fn this_thread_is_among_those_that_run() {
        assert!(running().is_some_and(|count| count >= 1));
    }
}
