//! The clock of a run, as seen by a component.

use std::rc::Rc;

use super::Tick;
use crate::context::Context;
use crate::declare::ClockKind;
use crate::region::Command;

/// The clock of a run. Reads the current time on the clock of [`Tick::time_ns`], and converts times from this
/// clock to the clock of [`Stamp`](crate::state::Stamp)s.
///
/// An anytime algorithm reads the clock between iterations. In lockstep, time does not advance within a step.
/// The number of iterations therefore needs a separate bound, which also makes the result reproducible:
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

    /// Returns the kind of the clock: real time or lockstep.
    pub fn kind(&self) -> ClockKind {
        if self.context.clock().is_lockstep() { ClockKind::Lockstep } else { ClockKind::Realtime }
    }

    /// Returns the current time, ns since the start of the run or episode, on the clock of [`Tick::time_ns`].
    /// In lockstep this is the time of the step.
    #[inline]
    pub fn now_ns(&self) -> u64 {
        let clock = self.context.clock();
        clock.now_ns().saturating_sub(clock.start_ns())
    }

    /// Returns the nominal time for which a step computes, ns on the clock of [`Tick::time_ns`]. This time
    /// does not depend on how late the step runs. For a component triggered by a publication, it is
    /// `state_ns`: the time of the state that the component read, as returned by
    /// [`Reading::time_ns`](crate::transport::Reading::time_ns). For all other components, it is the time of
    /// the tick.
    #[inline]
    pub fn grid_ns(&self, tick: &Tick, state_ns: u64) -> u64 {
        if self.context.causality().is_triggered() { state_ns } else { tick.time_ns }
    }

    /// Returns the time remaining until the deadline of a step, ns; 0 after the deadline.
    #[inline]
    pub fn left_ns(&self, tick: &Tick) -> u64 {
        tick.deadline_ns.saturating_sub(self.now_ns())
    }

    /// Converts a time on the clock of [`Tick::time_ns`] to the clock of [`Stamp`](crate::state::Stamp)s, ns.
    /// Use it for [`Loan::publish_from`](crate::transport::Loan::publish_from).
    #[inline]
    pub fn stamp_ns(&self, time_ns: u64) -> u64 {
        self.context.clock().start_ns().saturating_add(time_ns)
    }

    /// Returns `true` while the run is latched by `motorium stop --now` or an emergency stop. Motions that
    /// bypass the command gate, such as the homing of a drive, must then stop.
    #[inline]
    pub fn is_latched(&self) -> bool {
        self.context.region().header().latched().is_some()
    }

    /// Returns `true` if the run has ended and actuators enter their safe state. The result can change during
    /// a step that waits for other components, whereas [`Tick::settling`] keeps its value from the start of
    /// the step.
    #[inline]
    pub fn is_settling(&self) -> bool {
        self.context.region().header().command() != Command::Run
    }
}
