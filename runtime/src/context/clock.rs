//! The clock of a component's stamps.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::atomic::Ordering::Acquire;

use crate::os::monotonic_ns;
use crate::plan::ClockKind;
use crate::region::Region;

/// The clock of a component's stamps, ns (`CLOCK_MONOTONIC` in real time, simulated time in lockstep), and
/// the times of the current step on it.
#[derive(Debug)]
pub(crate) struct Clock {
    region: Rc<Region>,
    lockstep: bool,
    /// Time for which the step computes.
    time_ns: Cell<u64>,
    /// Start of the step.
    woken_ns: Cell<u64>,
    deadline_ns: Cell<u64>,
}

impl Clock {
    pub(super) fn new(kind: ClockKind, region: Rc<Region>) -> Self {
        Self {
            region,
            lockstep: kind == ClockKind::Lockstep,
            time_ns: Cell::new(0),
            woken_ns: Cell::new(0),
            deadline_ns: Cell::new(u64::MAX),
        }
    }

    #[inline]
    pub(crate) fn is_lockstep(&self) -> bool {
        self.lockstep
    }

    /// Returns the current time, ns.
    #[inline]
    pub(crate) fn now_ns(&self) -> u64 {
        if self.lockstep { self.time_ns.get() } else { monotonic_ns() }
    }

    /// Returns the time for which the current step computes, ns: its scheduled release, or the publication
    /// that triggered it. Returns the current time outside a worker's steps.
    #[inline]
    pub(crate) fn step_ns(&self) -> u64 {
        self.step_ns_or(|| self.now_ns())
    }

    /// Returns the same time as [`step_ns`](Self::step_ns). Outside a worker's steps, reads the current time
    /// by calling `now_ns`.
    #[inline]
    pub(crate) fn step_ns_or(&self, now_ns: impl FnOnce() -> u64) -> u64 {
        match self.time_ns.get() {
            0 => now_ns(),
            time_ns => time_ns,
        }
    }

    /// Returns the start of the run, ns.
    #[inline]
    pub(crate) fn start_ns(&self) -> u64 {
        if self.lockstep { 0 } else { self.region.header().start_ns.load(Acquire) }
    }

    /// Resets the lockstep clock to the start of the run.
    pub(crate) fn begin(&self) {
        self.time_ns.set(self.start_ns());
    }

    #[inline]
    pub(super) fn enter_step(&self, time_ns: u64, woken_ns: u64, deadline_ns: u64) {
        self.time_ns.set(time_ns);
        self.woken_ns.set(if self.lockstep { time_ns } else { woken_ns });
        self.deadline_ns.set(deadline_ns);
    }

    #[inline]
    pub(super) fn woken_ns(&self) -> u64 {
        self.woken_ns.get()
    }

    #[inline]
    pub(super) fn deadline_ns(&self) -> u64 {
        self.deadline_ns.get()
    }
}
