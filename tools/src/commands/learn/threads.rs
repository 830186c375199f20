//! Threads of training.

/// Returns the number of threads of a run; by default, all cores.
pub(crate) fn threads(given: Option<u32>) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    given.map_or_else(cores, |threads| threads as usize)
}
