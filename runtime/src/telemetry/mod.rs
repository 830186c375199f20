//! Measurements: histograms in shared memory, and a count of heap allocations per thread.

mod allocation;
mod histogram;
mod snapshot;

pub(crate) use allocation::place_of_counts;
pub use allocation::{Allocations, CountingAllocator, allocations, counts_allocations, set_apart};
pub use histogram::Histogram;
pub use snapshot::{Percentiles, Snapshot};
