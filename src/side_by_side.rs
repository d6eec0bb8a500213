//! Pieces of work on several threads, with the results in the order of the pieces.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// As many threads as there are cores.
pub(crate) fn cores() -> NonZeroUsize {
    std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN)
}

/// Does `work` for every piece of `order`, at most `jobs` at a time, begun in this order; `None` of those that were not begun since
/// `keep_going` said no. The results stand by the numbers of the pieces, which are those from 0 on, each once.
pub(crate) fn side_by_side<T: Send>(
    order: &[usize],
    jobs: NonZeroUsize,
    keep_going: &(dyn Fn() -> bool + Sync),
    work: &(dyn Fn(usize) -> T + Sync),
) -> Vec<Option<T>> {
    let next = AtomicUsize::new(0);
    let results: Mutex<Vec<Option<T>>> = Mutex::new(order.iter().map(|_| None).collect());
    std::thread::scope(|scope| {
        for _ in 0..jobs.get().min(order.len()) {
            scope.spawn(|| {
                while keep_going()
                    && let Some(&piece) = order.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    let result = work(piece);
                    // A panic of another thread is passed on by the scope.
                    results.lock().unwrap_or_else(PoisonError::into_inner)[piece] = Some(result);
                }
            });
        }
    });
    results.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_by_their_pieces_whatever_the_order_and_the_number_of_threads() {
        for jobs in [1, 3, 20] {
            let found = side_by_side(&[2, 0, 3, 1], NonZeroUsize::new(jobs).unwrap(), &|| true, &|piece| 10 * piece);
            assert_eq!(found, [Some(0), Some(10), Some(20), Some(30)]);
        }
        assert_eq!(side_by_side(&[], NonZeroUsize::MIN, &|| true, &|piece| piece), []);
    }

    #[test]
    fn nothing_begins_after_a_stop() {
        let begun = AtomicUsize::new(0);
        let keep_going = || begun.load(Ordering::Relaxed) < 2;
        let work = |piece| {
            begun.fetch_add(1, Ordering::Relaxed);
            piece
        };
        assert_eq!(
            side_by_side(&[3, 1, 0, 2], NonZeroUsize::MIN, &keep_going, &work),
            [None, Some(1), None, Some(3)]
        );
    }
}
