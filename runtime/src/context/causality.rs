//! Propagation of times from the input of a step to its outputs.

use std::cell::Cell;

use crate::state::Stamp;

/// Times propagated from the input that causes a step to its outputs, ns.
#[derive(Debug)]
pub(crate) struct Causality {
    /// True if another component's publication triggers the steps; outputs are then for the time of that
    /// sample.
    triggered: bool,
    source_ns: Cell<Option<u64>>,
    state_ns: Cell<Option<u64>>,
}

impl Causality {
    pub(super) fn new(triggered: bool) -> Self {
        Self { triggered, source_ns: Cell::new(None), state_ns: Cell::new(None) }
    }

    /// Returns `true` if another component's publication triggers the steps.
    #[inline]
    pub(crate) fn is_triggered(&self) -> bool {
        self.triggered
    }

    /// Stores the times of the input that causes this step's outputs.
    #[inline]
    pub(crate) fn propagate(&self, stamp: &Stamp) {
        self.source_ns.set(Some(stamp.source_time));
        if self.triggered {
            self.state_ns.set(Some(stamp.state_time));
        }
    }

    /// Returns the source time of an output of this step, or `now_ns` for a step without a cause.
    #[inline]
    pub(crate) fn source_time_or(&self, now_ns: u64) -> u64 {
        self.source_ns.get().unwrap_or(now_ns)
    }

    /// Returns the state time of an output of this step: the state time of the trigger's sample, or `step_ns`
    /// if no trigger set one.
    #[inline]
    pub(crate) fn state_time_or(&self, step_ns: u64) -> u64 {
        self.state_ns.get().unwrap_or(step_ns)
    }

    #[inline]
    pub(super) fn enter_step(&self) {
        self.source_ns.set(None);
        self.state_ns.set(None);
    }
}
