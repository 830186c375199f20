//! The source time that a step passes on from its input to its outputs.

use std::cell::Cell;

/// The source time that a step passes on from the input that causes it to its outputs, ns.
#[derive(Debug, Default)]
pub(crate) struct Causality {
    source_ns: Cell<Option<u64>>,
}

impl Causality {
    /// Takes over the source time of the input that causes this step's outputs.
    #[inline]
    pub(crate) fn propagate(&self, source_ns: u64) {
        self.source_ns.set(Some(source_ns));
    }

    /// The source time of an output of this step; `now_ns` for a step without a cause.
    #[inline]
    pub(crate) fn source_time_or(&self, now_ns: u64) -> u64 {
        self.source_ns.get().unwrap_or(now_ns)
    }

    #[inline]
    pub(super) fn enter_step(&self) {
        self.source_ns.set(None);
    }
}
