//! Consequences of a fault.

use std::time::Duration;

use super::fault::Fault;
use super::outcome::Outcome;

/// Pauses whose outcome is evaluated: long compared with a command, and short compared with a watchdog of 200
/// ms on a busy machine.
const PAUSES: core::ops::RangeInclusive<Duration> = Duration::from_millis(20)..=Duration::from_millis(100);

/// The consequences of one fault.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Consequence {
    /// Time from the fault to its detection by the launcher, ns.
    pub(super) detected_ns: Option<u64>,
    /// Time from the fault until the last actuator entered its safe state, ns.
    pub(super) safe_ns: Option<u64>,
    /// Time from the fault to the first value published by the restarted component, ns.
    pub(super) restarted_ns: Option<u64>,
    /// The component did not recover in time.
    pub(super) hung: bool,
    /// Commands stopped for too long while an actuator was not in its safe state.
    pub(super) unsafe_outage: bool,
    /// Outcome; `None` if nothing happened in time.
    pub(super) outcome: Option<Outcome>,
    /// Length of a pause.
    pub(super) pause: Duration,
}

/// Returns the most frequent outcome of these faults of one kind.
pub(super) fn most_frequent_outcome(fault: Fault, consequences: &[Consequence]) -> Option<Outcome> {
    let counts = |one: &&Consequence| !fault.passes() || PAUSES.contains(&one.pause);
    let mut outcomes: Vec<Outcome> =
        consequences.iter().filter(counts).filter_map(|one| one.outcome).collect();
    outcomes.sort();
    let times = |outcome: &Outcome| outcomes.iter().filter(|other| *other == outcome).count();
    outcomes.iter().max_by_key(|outcome| times(outcome)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kill::outcome::{After, Robot};

    fn consequence(robot: Robot, after: After, pause_ms: u64) -> Consequence {
        let outcome = Some(Outcome { robot, after });
        Consequence { outcome, pause: Duration::from_millis(pause_ms), ..Consequence::default() }
    }

    #[test]
    fn most_frequent_outcome_counts_and_hangs_are_excluded() {
        let goes_on = consequence(Robot::Safe, After::GoesOn, 50);
        let replaced = consequence(Robot::Safe, After::Replaced, 250);
        let short = consequence(Robot::GoesOn, After::GoesOn, 2);
        let seen = [replaced, replaced, replaced, goes_on, short, short];
        let outcome = |fault| most_frequent_outcome(fault, &seen).map(|outcome| outcome.to_string());
        assert_eq!(outcome(Fault::Pause).as_deref(), Some("safe state"));
        assert_eq!(outcome(Fault::Kill).as_deref(), Some("safe state; new process"));
        assert_eq!(most_frequent_outcome(Fault::Pause, &[short]), None);
    }
}
