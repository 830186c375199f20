//! The watchdog of one component, as a pure function of its counters and the time.
//!
//! A component has hung if it started no step for `hang_after` although one was due: its last step has not
//! ended, its release has passed, or a triggering publication has been waiting. A component with a silent
//! trigger has not hung. If a component waits for a descriptor, it is unknown whether a step is due. It has
//! hung if its thread has been stopped for that time.

use std::sync::atomic::Ordering::Relaxed;

use crate::os::process_state;
use crate::plan::{Activation, ClockKind, Plan};
use crate::region::Region;

/// Counters of a component that a watchdog reads.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counters {
    begun: u64,
    ended: u64,
    last_step_ns: u64,
    /// Number of publications of its trigger, and the time of the last one, ns.
    published: (u64, u64),
    /// `true` if a signal or a debugger has stopped it; checked only for components that wait for a
    /// descriptor.
    is_stopped: bool,
}

impl Counters {
    /// Reads the counters of a component.
    pub(super) fn read(plan: &Plan, region: &Region, index: usize) -> Self {
        let block = &region.components()[index];
        let published = match plan.components[index].activation {
            Activation::Triggered { topic, .. } => {
                let topic = &region.topics()[topic];
                let count = topic.published.load(Relaxed);
                (count, topic.last_publish_ns.load(Relaxed))
            }
            Activation::Periodic { .. } | Activation::Descriptor { .. } => (0, 0),
        };
        let by_descriptor = matches!(plan.components[index].activation, Activation::Descriptor { .. });
        let state = || process_state(block.pid.load(Relaxed), block.thread.load(Relaxed));
        let ended = block.steps.load(Relaxed);
        Self {
            begun: block.begun.load(Relaxed),
            ended,
            last_step_ns: block.last_step_ns.load(Relaxed),
            published,
            is_stopped: by_descriptor && matches!(state(), Some('T' | 't')),
        }
    }
}

/// Phase in which a component has been overdue for longer than allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Overdue {
    /// A step has not ended.
    InStep {
        /// Time since its beginning, ns.
        for_ns: u64,
    },
    /// A step has not begun.
    BetweenSteps {
        /// Time since the last step started, or since the publication that should trigger it, ns.
        for_ns: u64,
    },
}

/// The watchdog of one component.
#[derive(Debug, Clone)]
pub(super) struct Watchdog {
    hang_after_ns: u64,
    waits_for: WaitsFor,
    /// Start of the observation, ns.
    since_ns: u64,
    /// Time of the next check at the latest, ns.
    due_ns: u64,
}

/// The source of a component's releases.
#[derive(Debug, Clone)]
enum WaitsFor {
    /// The clock, or `stale_after` of an actuator: there is always a next release.
    Clock,
    /// The publications of a topic.
    Trigger(Waiting),
    /// A descriptor, with the time since which its thread has been stopped, ns.
    Descriptor { stopped_ns: Option<u64> },
}

/// Wait of a triggered component for its trigger.
#[derive(Debug, Clone)]
struct Waiting {
    period_ns: u64,
    /// Number of publications, and the time at which the component had last stepped on all of them.
    idle: (u64, u64),
    /// Start of the last step, and the time since which a publication has been waiting, ns.
    overdue: Option<(u64, u64)>,
}

impl Watchdog {
    /// Watches a component of a run from `now_ns` on.
    pub(super) fn new(plan: &Plan, region: &Region, index: usize, now_ns: u64) -> Self {
        let component = &plan.components[index];
        let is_played = region.components()[index].played.load(Relaxed) != 0;
        let hang_after_ns = match plan.clock {
            // A program that replaces a component publishes at any time; there are no steps.
            ClockKind::Realtime if is_played => u64::MAX,
            ClockKind::Realtime => component.liveness.hang_after_ns,
            // In lockstep a tick may take any time.
            ClockKind::Lockstep => u64::MAX,
        };
        let waiting = |period_ns| Waiting { period_ns, idle: (0, now_ns), overdue: None };
        Self {
            // An actuator also steps when its trigger or descriptor is silent for `stale_after`.
            hang_after_ns: match (&component.activation, component.actuator) {
                (Activation::Triggered { .. } | Activation::Descriptor { .. }, true) => {
                    hang_after_ns.saturating_add(plan.safety_of(component).stale_after_ns)
                }
                _ => hang_after_ns,
            },
            waits_for: match component.activation {
                _ if component.actuator => WaitsFor::Clock,
                Activation::Triggered { period_ns, .. } => WaitsFor::Trigger(waiting(period_ns)),
                Activation::Descriptor { .. } => WaitsFor::Descriptor { stopped_ns: None },
                Activation::Periodic { .. } => WaitsFor::Clock,
            },
            since_ns: now_ns,
            due_ns: now_ns,
        }
    }

    /// Ignores the time before `now_ns`, after the component started or the supervisor itself was delayed.
    pub(super) fn watch_from(&mut self, now_ns: u64) {
        self.since_ns = now_ns;
        self.due_ns = now_ns;
    }

    /// Returns the time without a step after which the component counts as hung, ns.
    pub(super) fn hang_after_ns(&self) -> u64 {
        self.hang_after_ns
    }

    /// Returns the latest time of the next check, ns.
    pub(super) fn due_ns(&self) -> u64 {
        self.due_ns
    }

    /// Returns `true` if the watched component may stay silent, because it steps only on publications or
    /// events.
    pub(super) fn may_stay_silent(&self) -> bool {
        !matches!(self.waits_for, WaitsFor::Clock)
    }

    /// Returns the watchdog with half of its `hang_after`.
    pub(super) fn with_half_the_timeout(mut self) -> Self {
        self.hang_after_ns /= 2;
        self
    }

    /// Checks the component. Returns the phase in which it is overdue, or `None`.
    pub(super) fn check(&mut self, counters: &Counters, now_ns: u64) -> Option<Overdue> {
        match self.evaluate(counters, now_ns) {
            Ok(hang) => Some(hang),
            Err(due_ns) => {
                self.due_ns = due_ns;
                None
            }
        }
    }

    /// Returns the phase in which the component is overdue. Otherwise returns, as `Err`, the earliest time at
    /// which it could count as hung, ns.
    fn evaluate(&mut self, counters: &Counters, now_ns: u64) -> Result<Overdue, u64> {
        let in_step = counters.begun > counters.ended;
        let last_ns = counters.last_step_ns.max(self.since_ns);
        let waits_since = match &mut self.waits_for {
            WaitsFor::Trigger(trigger) if !in_step => trigger.waits_since(counters, now_ns),
            WaitsFor::Descriptor { stopped_ns } if !in_step => {
                *stopped_ns = counters.is_stopped.then(|| stopped_ns.unwrap_or(now_ns));
                *stopped_ns
            }
            _ => Some(last_ns),
        };
        let Some(waits_since) = waits_since else { return Err(now_ns.saturating_add(self.hang_after_ns)) };
        let waits_since = waits_since.max(self.since_ns);
        let for_ns = now_ns.saturating_sub(waits_since);
        match for_ns > self.hang_after_ns {
            false => Err(waits_since.saturating_add(self.hang_after_ns).saturating_add(1)),
            true if in_step => Ok(Overdue::InStep { for_ns }),
            true => Ok(Overdue::BetweenSteps { for_ns }),
        }
    }
}

impl Waiting {
    /// Returns the time since which a publication has been waiting for the component; `None` if it has
    /// stepped on all of them.
    fn waits_since(&mut self, counters: &Counters, now_ns: u64) -> Option<u64> {
        let (count, published_ns) = counters.published;
        let last_ns = counters.last_step_ns;
        if count == 0 || published_ns <= last_ns {
            self.idle = (count, now_ns);
            self.overdue = None;
            return None;
        }
        if let Some((_, since_ns)) = self.overdue.filter(|(last, _)| *last == last_ns) {
            return Some(since_ns);
        }
        // The first publication since it was idle, estimated from count and period.
        let before = count.saturating_sub(self.idle.0).saturating_sub(1);
        let first_ns = published_ns.saturating_sub(before.saturating_mul(self.period_ns));
        let since_ns = first_ns.max(last_ns).max(self.idle.1).min(now_ns);
        self.overdue = Some((last_ns, since_ns));
        Some(since_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn watchdog(triggered: bool) -> Watchdog {
        let waiting = Waiting { period_ns: MS, idle: (0, 0), overdue: None };
        let waits_for = if triggered { WaitsFor::Trigger(waiting) } else { WaitsFor::Clock };
        Watchdog { hang_after_ns: 20 * MS, waits_for, since_ns: 0, due_ns: 0 }
    }

    fn stepped(steps: u64, last_ms: u64) -> Counters {
        Counters { begun: steps, ended: steps, last_step_ns: last_ms * MS, ..Counters::default() }
    }

    #[test]
    fn periodic_component_without_a_step_has_hung() {
        let mut watched = watchdog(false);
        assert_eq!(watched.evaluate(&stepped(100, 100), 101 * MS), Err(120 * MS + 1));
        assert_eq!(watched.evaluate(&stepped(100, 100), 120 * MS), Err(120 * MS + 1));
        assert_eq!(
            watched.evaluate(&stepped(100, 100), 120 * MS + 1),
            Ok(Overdue::BetweenSteps { for_ns: 20 * MS + 1 })
        );
        assert_eq!(watched.evaluate(&stepped(101, 121), 122 * MS), Err(141 * MS + 1));
    }

    #[test]
    fn endless_step_counts_as_a_hang() {
        for triggered in [false, true] {
            let last_step_ns = 8 * MS;
            let published = (8, 8 * MS);
            let inside = Counters { begun: 8, ended: 7, last_step_ns, published, is_stopped: false };
            let mut watched = watchdog(triggered);
            assert_eq!(watched.evaluate(&inside, 28 * MS), Err(28 * MS + 1));
            assert_eq!(watched.evaluate(&inside, 30 * MS), Ok(Overdue::InStep { for_ns: 22 * MS }));
        }
    }

    #[test]
    fn component_with_a_silent_trigger_has_not_hung() {
        let mut watched = watchdog(true);
        let idle = Counters { published: (50, 50 * MS), ..stepped(50, 50) };
        assert_eq!(watched.evaluate(&idle, 10_000 * MS), Err(10_020 * MS));
        // the first publication after ten seconds is its first chance to step
        let woken = Counters { published: (51, 10_015 * MS), ..idle };
        assert_eq!(watched.evaluate(&woken, 10_016 * MS), Err(10_035 * MS + 1));
        assert_eq!(watched.evaluate(&woken, 10_036 * MS), Ok(Overdue::BetweenSteps { for_ns: 21 * MS }));
    }

    #[test]
    fn wait_starts_at_the_first_missed_publication() {
        let mut watched = watchdog(true);
        let idle = Counters { published: (50, 50 * MS), ..stepped(50, 50) };
        assert!(watched.evaluate(&idle, 50 * MS + 1).is_err());
        // stopped since; its source continues at 1 kHz
        let later = Counters { published: (60, 60 * MS), ..idle };
        assert_eq!(watched.evaluate(&later, 60 * MS), Err(71 * MS + 1));
        let last = Counters { published: (71, 71 * MS), ..idle };
        assert_eq!(watched.evaluate(&last, 71 * MS + 1), Ok(Overdue::BetweenSteps { for_ns: 20 * MS + 1 }));
    }

    #[test]
    fn descriptor_component_hangs_only_if_stopped() {
        let mut watched =
            Watchdog { waits_for: WaitsFor::Descriptor { stopped_ns: None }, ..watchdog(false) };
        let silent = stepped(50, 50);
        assert_eq!(watched.evaluate(&silent, 10_000 * MS), Err(10_020 * MS));
        let stopped = Counters { is_stopped: true, ..silent };
        assert_eq!(watched.evaluate(&stopped, 10_010 * MS), Err(10_030 * MS + 1));
        assert_eq!(watched.evaluate(&silent, 10_020 * MS), Err(10_040 * MS), "not stopped");
        assert_eq!(watched.evaluate(&stopped, 10_030 * MS), Err(10_050 * MS + 1));
        assert_eq!(watched.evaluate(&stopped, 10_051 * MS), Ok(Overdue::BetweenSteps { for_ns: 21 * MS }));
        let in_step = Counters { begun: 51, last_step_ns: 11_000 * MS, ..silent };
        assert_eq!(watched.evaluate(&in_step, 11_021 * MS), Ok(Overdue::InStep { for_ns: 21 * MS }));
    }

    #[test]
    fn each_step_restarts_the_hang_time() {
        let mut watched = watchdog(true);
        for ms in 1..200 {
            let behind = Counters { published: (ms + 1, ms * MS + 1), ..stepped(ms, ms) };
            assert!(watched.evaluate(&behind, ms * MS + 2).is_err(), "at {ms} ms");
        }
    }

    #[test]
    fn time_before_a_restart_or_stall_is_ignored() {
        let mut watched = watchdog(false);
        watched.watch_from(500 * MS);
        assert_eq!(watched.evaluate(&stepped(100, 100), 510 * MS), Err(520 * MS + 1));
        assert!(watched.evaluate(&stepped(100, 100), 521 * MS).is_ok());
    }
}
