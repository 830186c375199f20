//! The loop of a component that steps when its descriptor is readable.
//!
//! One system call waits for all events: the descriptor, a command of the launcher and, in an actuator, the
//! time at which its command becomes stale. The command is a signal, which is blocked except during the wait.
//! Events within `min_interval` of the last release are deferred until that time has passed, and all events
//! until then cause one release.

use super::Failure;
use super::rest::Rest;
use super::stepper::Stepper;
use super::timing::Timing;
use crate::os::{Readiness, monotonic_ns};
use crate::region::add;

/// Longest duration of a wait that finds the descriptor readable and does not sleep, ns.
const AT_ONCE_NS: u64 = 5_000;

/// Releases of a sporadic task, as a pure function of its events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Releases {
    min_interval_ns: u64,
    last_ns: Option<u64>,
}

impl Releases {
    /// Returns the release of an event detected at `now_ns`. An event before the wait arrived at an unknown
    /// time during the last step, so the earliest possible time counts.
    fn release_of_event(&self, now_ns: u64, waited_for: bool) -> u64 {
        match self.last_ns {
            None => now_ns,
            Some(last_ns) => {
                let earliest = last_ns.saturating_add(self.min_interval_ns);
                if waited_for { earliest.max(now_ns) } else { earliest }
            }
        }
    }
}

/// Steps whenever the descriptor is readable, until the run ends. With `longest_wait_ns`, as in an actuator,
/// a step also begins after that time without an event, and immediately when the run is stopping.
pub(super) fn run(
    stepper: &mut Stepper,
    readiness: &Readiness,
    longest_wait_ns: Option<u64>,
    mut rest: Rest,
) -> Result<(), Failure> {
    let min_interval_ns = stepper.period_ns();
    let mut releases = Releases { min_interval_ns, last_ns: None };
    // Deferred release of an event that came too early.
    let mut deferred_to: Option<u64> = None;
    let mut last_end = 0;
    let mut until_ns = longest_wait_ns.map(|longest| monotonic_ns() + longest);
    stepper.open_accounts();
    loop {
        stepper.look_for_episode();
        let began_ns = monotonic_ns();
        let is_readable = match deferred_to {
            Some(at_ns) => {
                readiness.sleep_until(until_ns.map_or(at_ns, |until| until.min(at_ns)));
                false
            }
            None => readiness.wait(until_ns),
        };
        stepper.context().first_lines().fetch();
        let woken_ns = monotonic_ns();
        let slept = woken_ns - began_ns > AT_ONCE_NS;
        let wake_ns = stepper.woke(woken_ns, slept, &mut rest);
        if stepper.context().must_leave() {
            return Ok(());
        }
        let overdue = until_ns.is_some_and(|until| wake_ns >= until || stepper.context().must_turn_safe());
        let release_ns = match deferred_to {
            // Without an event the step is due now: its command has become stale, or the run is stopping.
            _ if overdue => wake_ns,
            Some(at_ns) if wake_ns >= at_ns => at_ns,
            Some(_) => continue,
            None if !is_readable => continue,
            None => {
                let at_ns = releases.release_of_event(wake_ns, slept);
                if at_ns > wake_ns {
                    add(&stepper.context().block().deferred, 1);
                    deferred_to = Some(at_ns);
                    continue;
                }
                at_ns
            }
        };
        deferred_to = None;
        releases.last_ns = Some(release_ns);
        let behind = last_end > release_ns;
        let timing = Timing { release_ns, wake_ns, deadline_ns: release_ns + min_interval_ns, behind };
        let end = stepper.step(timing)?;
        last_end = end;
        until_ns = longest_wait_ns.map(|longest| wake_ns + longest);
        stepper.account(timing, end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RELEASES: Releases = Releases { min_interval_ns: 100, last_ns: Some(1_000) };

    #[test]
    fn first_event_is_released_when_it_is_detected() {
        assert_eq!(Releases { last_ns: None, ..RELEASES }.release_of_event(5, true), 5);
        assert_eq!(Releases { last_ns: None, ..RELEASES }.release_of_event(5, false), 5);
    }

    #[test]
    fn no_two_releases_are_closer_than_the_interval() {
        for (now, waited_for) in [(1_001, true), (1_001, false), (1_099, true), (1_100, true)] {
            assert_eq!(RELEASES.release_of_event(now, waited_for), 1_100);
        }
        assert_eq!(RELEASES.release_of_event(1_500, true), 1_500);
    }

    #[test]
    fn event_during_a_step_counts_from_its_earliest_time() {
        assert_eq!(RELEASES.release_of_event(1_500, false), 1_100);
    }
}
