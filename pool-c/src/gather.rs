//! Calls of several threads, answered in batches.
//!
//! A host calls a material point by point. Where it does so from several threads, what comes in while a batch is being answered makes up the
//! next batch, so that as many workers are busy as threads call.

use std::collections::BTreeMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// What waits, and what has been answered.
#[derive(Debug)]
struct Queue<T, R> {
    tickets: u64,
    waiting: Vec<(u64, T)>,
    answered: BTreeMap<u64, R>,
    is_served: bool,
}

/// Where threads bring their calls; one of them answers for all.
#[derive(Debug)]
pub(crate) struct Gather<T, R> {
    queue: Mutex<Queue<T, R>>,
    changed: Condvar,
}

impl<T, R> Gather<T, R> {
    /// No call yet.
    pub(crate) fn new() -> Self {
        let queue = Queue { tickets: 0, waiting: Vec::new(), answered: BTreeMap::new(), is_served: false };
        Self { queue: Mutex::new(queue), changed: Condvar::new() }
    }

    /// The answer to a call. `serve` answers a batch, one answer for each call in order; it must not panic. `None` if it has given too few.
    pub(crate) fn call(&self, call: T, serve: impl Fn(&[T]) -> Vec<R>) -> Option<R> {
        let mut queue = self.lock();
        let ticket = queue.tickets;
        queue.tickets += 1;
        queue.waiting.push((ticket, call));
        loop {
            if let Some(answer) = queue.answered.remove(&ticket) {
                return Some(answer);
            }
            if queue.is_served {
                queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            // Also the case after a batch that has answered too little.
            if !queue.waiting.iter().any(|(waiting, _)| *waiting == ticket) {
                return None;
            }
            queue.is_served = true;
            let (tickets, calls): (Vec<u64>, Vec<T>) = std::mem::take(&mut queue.waiting).into_iter().unzip();
            drop(queue);
            let answers = serve(&calls);
            queue = self.lock();
            queue.answered.extend(tickets.into_iter().zip(answers));
            queue.is_served = false;
            self.changed.notify_all();
        }
    }

    fn lock(&self) -> MutexGuard<'_, Queue<T, R>> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    #[test]
    fn every_thread_gets_its_own_answer_and_batches_form() {
        let gather = Gather::new();
        let largest = AtomicUsize::new(0);
        let serve = |calls: &[usize]| {
            largest.fetch_max(calls.len(), Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(5));
            calls.iter().map(|call| call * call).collect::<Vec<_>>()
        };
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let (gather, serve) = (&gather, &serve);
                scope.spawn(move || {
                    for call in 0..10 {
                        let call = 10 * thread + call;
                        assert_eq!(gather.call(call, serve), Some(call * call));
                    }
                });
            }
        });
        assert!(largest.load(Ordering::Relaxed) > 1);
    }

    #[test]
    fn too_few_answers_end_a_call() {
        let gather = Gather::<u8, u8>::new();
        assert_eq!(gather.call(1, |_| Vec::new()), None);
        assert_eq!(gather.call(1, <[u8]>::to_vec), Some(1));
    }
}
