//! The clock of a run, as a component reads it.

use std::rc::Rc;

use super::Tick;
use crate::context::Context;
use crate::declare::ClockKind;
use crate::region::Command;

/// The clock of a run: the present on the clock of [`Tick::time_ns`], and that of stamps.
///
/// An algorithm that improves its result for as long as it has time reads it between two iterations. In lockstep time
/// stands still within a step, so the number of iterations needs a bound of its own, and is the same in every run:
///
/// ```
/// use motorium::component::RunClock;
/// use motorium::prelude::*;
///
/// const ITERATIONS: usize = 50;
/// const RESERVE_NS: u64 = 100_000; // for publishing
///
/// fn improve(estimate: &mut f64, of: f64, tick: &Tick, clock: &RunClock) {
///     for _ in 0..ITERATIONS {
///         if clock.left_ns(tick) < RESERVE_NS {
///             break;
///         }
///         *estimate = 0.5 * (*estimate + of / *estimate);
///     }
/// }
/// ```
#[derive(Debug, Clone)]
pub struct RunClock {
    context: Rc<Context>,
}

impl RunClock {
    pub(super) fn new(context: Rc<Context>) -> Self {
        Self { context }
    }

    /// Real time or lockstep.
    pub fn kind(&self) -> ClockKind {
        if self.context.clock().is_lockstep() { ClockKind::Lockstep } else { ClockKind::Realtime }
    }

    /// The present, ns since the run, or its present episode, began: on the clock of [`Tick::time_ns`]. In lockstep it is
    /// the time of the step.
    #[inline]
    pub fn now_ns(&self) -> u64 {
        let clock = self.context.clock();
        clock.now_ns().saturating_sub(clock.start_ns())
    }

    /// The time that a step computes for, ns on the clock of [`Tick::time_ns`], on the grid of the rate: that of the state it
    /// has read, from [`Reading::time_ns`](crate::transport::Reading::time_ns), where a publication triggers the component,
    /// else that of the tick. Between two steps it tells how far the robot has moved on, however late they were.
    #[inline]
    pub fn grid_ns(&self, tick: &Tick, state_ns: u64) -> u64 {
        if self.context.causality().is_triggered() { state_ns } else { tick.time_ns }
    }

    /// Time left until the deadline of a step, ns; 0 after it.
    #[inline]
    pub fn left_ns(&self, tick: &Tick) -> u64 {
        tick.deadline_ns.saturating_sub(self.now_ns())
    }

    /// A time on the clock of [`Tick::time_ns`] as one on the clock of [`Stamp`](crate::state::Stamp)s, ns: that of
    /// [`Loan::publish_from`](crate::transport::Loan::publish_from).
    #[inline]
    pub fn stamp_ns(&self, time_ns: u64) -> u64 {
        self.context.clock().start_ns().saturating_add(time_ns)
    }

    /// True while the run is latched, by `motorium stop --now` or an emergency stop: a motion that no command gate judges, such as
    /// the homing of a drive, stops then.
    #[inline]
    pub fn is_latched(&self) -> bool {
        self.context.region().header().latched().is_some()
    }

    /// True if the run has ended by now, and actuators take their safe state: [`Tick::settling`] tells it as of the
    /// beginning of the step, which matters where a step waits for what others do.
    #[inline]
    pub fn is_settling(&self) -> bool {
        self.context.region().header().command() != Command::Run
    }
}
