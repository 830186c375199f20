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
    let mut memories = vec![(); threads.max(1)];
    for_chunks(&mut memories, items, &mut results, |item, result, ()| *result = work(item));
    results
}

/// Calls `work` for each item, its slot and the memory of a thread, one thread for each memory. Whichever
/// thread is free takes the next item.
pub(crate) fn for_chunks<I: Sync, T: Send, M: Send>(
    memories: &mut [M],
    items: &[I],
    slots: &mut [T],
    work: impl Fn(&I, &mut T, &mut M) + Sync,
) {
    let Some((own, others)) = memories.split_first_mut() else { return };
    let pairs = items.iter().zip(slots);
    if others.is_empty() || items.len() <= 1 {
        return pairs.for_each(|(item, slot)| work(item, slot, own));
    }
    let pairs: Vec<_> = pairs.map(|(item, slot)| (item, Mutex::new(slot))).collect();
    let next = AtomicUsize::new(0);
    let run = |memory: &mut M| {
        while let Some((item, slot)) = pairs.get(next.fetch_add(1, Ordering::Relaxed)) {
            work(item, *slot.lock().unwrap_or_else(PoisonError::into_inner), memory);
        }
    };
    let run = &run;
    std::thread::scope(|scope| {
        for memory in others.iter_mut().take(items.len() - 1) {
            scope.spawn(move || run(memory));
        }
        run(own);
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
