//! Counters in a control block, which is the shared memory for the state and statistics of a run.

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

/// Adds to a counter that has one writer.
#[inline]
pub(crate) fn add(cell: &AtomicU64, value: u64) {
    cell.store(cell.load(Relaxed).wrapping_add(value), Relaxed);
}
