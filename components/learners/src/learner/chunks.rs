//! Work on chunks of samples by several threads.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Samples in a chunk, whose gradient one thread computes.
pub(crate) const CHUNK: usize = 64;

/// The results of `work` for each item, in the order of the items. Whichever thread is free takes the next.
pub(crate) fn map_chunks<I: Sync, T: Default + Send>(
    threads: usize,
    items: &[I],
    work: impl Fn(&I) -> T + Sync,
) -> Vec<T> {
    if threads <= 1 || items.len() <= 1 {
        return items.iter().map(work).collect();
    }
    let slots: Vec<Mutex<T>> = items.iter().map(|_| Mutex::default()).collect();
    let next = AtomicUsize::new(0);
    let run = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let (Some(item), Some(slot)) = (items.get(index), slots.get(index)) else { break };
            *slot.lock().unwrap_or_else(PoisonError::into_inner) = work(item);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads.min(items.len()) {
            scope.spawn(run);
        }
        run();
    });
    slots.into_iter().map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_have_the_order_of_their_items() {
        let items: Vec<u32> = (0..100).collect();
        let expected: Vec<u32> = items.iter().map(|item| item * item).collect();
        for threads in [1, 2, 5] {
            assert_eq!(map_chunks(threads, &items, |item| item * item), expected);
        }
    }
}
