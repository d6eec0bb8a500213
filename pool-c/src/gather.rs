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

/// A batch that is being answered. Its end is told to the threads that wait, also where answering it panicked: they go on then, and those
/// of the batch have no answer.
#[derive(Debug)]
struct Batch<'a, T, R> {
    gather: &'a Gather<T, R>,
    tickets: Vec<u64>,
    answers: Vec<R>,
}

impl<T, R> Drop for Batch<'_, T, R> {
    fn drop(&mut self) {
        let mut queue = self.gather.lock();
        queue.answered.extend(self.tickets.drain(..).zip(self.answers.drain(..)));
        queue.is_served = false;
        self.gather.changed.notify_all();
    }
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

    /// The answer to a call. `serve` answers a batch, one answer for each call in order. `None` if it has given too few. Where it panics, so
    /// does the thread that it answers for, and the others of the batch have no answer.
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
            let mut batch = Batch { gather: self, tickets, answers: Vec::new() };
            batch.answers = serve(&calls);
            drop(batch);
            queue = self.lock();
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

    /// What answers a batch may panic, which hosts catch: calls after it waited for its end without end.
    #[test]
    fn a_batch_that_panics_ends_and_others_go_on() {
        let gather = Gather::<u8, u8>::new();
        let (sender, answers) = std::sync::mpsc::channel();
        std::thread::scope(|scope| {
            let (gather, first) = (&gather, sender.clone());
            scope.spawn(move || {
                let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                    gather.call(1, |_| {
                        std::thread::sleep(Duration::from_millis(20));
                        panic!("a defect")
                    })
                }));
                first.send(panicked.is_err()).unwrap();
            });
            scope.spawn(move || {
                std::thread::sleep(Duration::from_millis(5));
                sender.send(gather.call(2, <[u8]>::to_vec) == Some(2)).unwrap();
            });
            for _ in 0..2 {
                assert_eq!(answers.recv_timeout(Duration::from_secs(10)), Ok(true));
            }
        });
    }

    #[test]
    fn too_few_answers_end_a_call() {
        let gather = Gather::<u8, u8>::new();
        assert_eq!(gather.call(1, |_| Vec::new()), None);
        assert_eq!(gather.call(1, <[u8]>::to_vec), Some(1));
    }
}
