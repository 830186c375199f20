//! Parallel work on chunks of samples.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Number of samples in a chunk. One thread computes the gradient of a chunk.
pub(crate) const CHUNK: usize = 64;

/// Returns the results of `work` for all items, in order. The next free thread processes the next item.
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

/// Calls `work` for each item with its slot and the memory of a thread. `run` calls its argument once on each
/// thread with the index of the thread; threads without a memory do nothing. The next free thread processes
/// the next item.
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
