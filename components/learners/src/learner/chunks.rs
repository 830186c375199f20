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
    let mut results = Vec::new();
    results.resize_with(items.len(), T::default);
    let threads = threads.min(items.len()).max(1);
    let mut memories = vec![(); threads];
    let run = |work: &(dyn Fn(usize) + Sync)| {
        std::thread::scope(|scope| {
            (1..threads).for_each(|thread| {
                scope.spawn(move || work(thread));
            });
            work(0);
        });
    };
    for_chunks(run, &mut memories, items, &mut results, |item, result, ()| *result = work(item));
    results
}

/// Calls `work` for each item, its slot and the memory of a thread. `run` calls its argument once on each
/// thread with the number of the thread, from 0; threads without a memory do nothing. Whichever thread is
/// free takes the next item.
pub(crate) fn for_chunks<I: Sync, T: Send, M: Send>(
    run: impl FnOnce(&(dyn Fn(usize) + Sync)),
    memories: &mut [M],
    items: &[I],
    slots: &mut [T],
    work: impl Fn(&I, &mut T, &mut M) + Sync,
) {
    let pairs: Vec<_> = items.iter().zip(slots).map(|(item, slot)| (item, Mutex::new(slot))).collect();
    let memories: Vec<_> = memories.iter_mut().map(Mutex::new).collect();
    let next = AtomicUsize::new(0);
    run(&|thread| {
        let Some(memory) = memories.get(thread) else { return };
        let mut memory = memory.lock().unwrap_or_else(PoisonError::into_inner);
        while let Some((item, slot)) = pairs.get(next.fetch_add(1, Ordering::Relaxed)) {
            work(item, &mut slot.lock().unwrap_or_else(PoisonError::into_inner), &mut memory);
        }
    });
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
