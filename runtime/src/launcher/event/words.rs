//! Texts of events.

use core::fmt;

use super::Event;
use crate::launcher::Exit;
use crate::launcher::lost_steps::LostShare;
use crate::plan::ClockKind;
use crate::region::{Latch, Misses, Refusal};
use crate::units::TimeSpan;

/// Formats the event as one line of text, without its kind. A status has no text.
impl fmt::Display for Event<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let milliseconds = |ns: &u64| *ns as f64 * 1e-6;
        match self {
            Self::Created { run, plan } => {
                let clock = match plan.clock {
                    ClockKind::Realtime => "in real time",
                    ClockKind::Lockstep => "in lockstep",
                };
                write!(f, "{}: {} components {clock} (run {run})", plan.name, plan.components.len())
            }
            Self::Lost(what) | Self::Warning(what) => f.write_str(what),
            Self::Started => f.write_str("all ports connected, running"),
            Self::Output { line, .. } => f.write_str(line),
            Self::Failed { component, tick, reason, consequence, .. } => {
                write!(f, "`{component}` at tick {tick}: {reason}; {consequence}")
            }
            Self::Restarted { component, after_ns } => {
                write!(f, "`{component}` steps again after {:.1} ms", milliseconds(after_ns))
            }
            Self::Reset { episode, seed } => write!(f, "reset for episode {episode}, seed {seed}"),
            Self::EpisodeBegan { episode, seed } => write!(f, "episode {episode} began, seed {seed}"),
            Self::Missed { component, misses } => {
                let steps = count_of(misses.missed(), "step");
                write!(f, "`{component}` missed the deadline of {steps}: {}", causes(misses))
            }
            Self::LatencyMissed { from, to, count, max_ns, longest_ns } => {
                let (budget, longest) = (TimeSpan { ns: *max_ns }, TimeSpan { ns: *longest_ns });
                let times = count_of(*count, "time");
                write!(f, "the latency from `{from}` to `{to}` was above its budget of {budget} {times}, ")?;
                write!(f, "at most {longest} so far")
            }
            Self::Refused { component, refused } => {
                let total = refused.iter().map(|(_, count)| *count).sum();
                let reasons: Vec<String> = refused
                    .iter()
                    .map(|(reason, count)| format!("{count} {}", reason.description()))
                    .collect();
                let commands = count_of(total, "command");
                write!(f, "`{component}` refused {commands}: {}", reasons.join(", "))
            }
            Self::EnteredSafeState { component, times, cause, .. } => {
                write!(f, "`{component}` entered its safe state")?;
                if *times > 1 {
                    write!(f, " {times} times")?;
                }
                write!(f, ": {cause}")
            }
            Self::LeftSafeState { component, before_ns: Some(_), .. } => {
                write!(f, "`{component}` left its safe state")
            }
            Self::LeftSafeState { component, resuming: true, .. } => {
                write!(f, "`{component}` is resuming: it moves from the held pose to its command ")?;
                f.write_str("at limited rates")
            }
            Self::LeftSafeState { component, .. } => write!(f, "`{component}` follows its commands"),
            Self::SafeStop { reason } => f.write_str(reason),
            Self::Safe { after_ns } => {
                write!(f, "all actuators in their safe state after {:.2} ms", milliseconds(after_ns))
            }
            Self::NotSafe { dead, late, moving, safe } => {
                let parts = [
                    (dead, "dead"),
                    (late, "not in its safe state"),
                    (moving, "in its safe state, but not at rest"),
                    (safe, "in its safe state"),
                ];
                let parts = parts.iter().filter(|(those, _)| !those.is_empty());
                let parts: Vec<String> =
                    parts.map(|(those, what)| format!("{} {what}", names(those))).collect();
                write!(f, "not all actuators are in their safe state: {}", parts.join("; "))
            }
            Self::Stopped { latch, cause } => {
                let first = match latch {
                    Latch::EmergencyStop => "release the emergency stop, then ",
                    Latch::Stop | Latch::SafeState => "",
                };
                write!(f, "the robot stays in its safe state, {cause}; to continue: {first}`motorium resume`")
            }
            Self::Resumed => f.write_str("resumed: the robot returns to its commands"),
            Self::LosesSteps { component, share } => {
                write!(f, "`{component}` lost {} of its steps in the last second", LostShare(*share))
            }
            Self::Waiting { component, tick, for_ns } => write!(
                f,
                "`{component}` has been in tick {tick} for {:.1} s; simulated time does not advance until the tick \
                 ends (Ctrl-C stops the run)",
                *for_ns as f64 * 1e-9
            ),
            Self::Ending(Exit::Finished) => f.write_str("the run ends: its duration has elapsed"),
            Self::Ending(Exit::Interrupted) => f.write_str("the run ends: requested by a signal"),
            Self::Ending(Exit::SafeStop { .. }) => f.write_str("the run ends after a safe stop"),
            Self::LauncherSilent { run } => {
                write!(f, "the launcher of {run} does not respond (stopped?); the guard monitors the graph")
            }
            Self::LauncherBack { run } => write!(f, "the launcher of {run} responds again"),
            Self::LauncherEnded { run, cause } => {
                write!(f, "the launcher of {run} {cause}; the guard ends the run in its place")
            }
            Self::GuardActed { actuators, .. } => f.write_str(actuators),
            Self::Status(_) => Ok(()),
        }
    }
}

impl Refusal {
    /// Describes the reason in a few words that follow the number of refused commands, such as "stamped in
    /// the future".
    pub fn description(self) -> &'static str {
        match self {
            Self::Content => "not finite",
            Self::Count => "for a different number of joints",
            Self::NegativeGain => "with a negative gain",
            Self::Limits => "beyond a limit",
            Self::Future => "stamped in the future",
            Self::Sequence => "out of order",
            Self::StaleSource => "from an old measurement",
        }
    }
}

/// Formats a number and its noun.
fn count_of(count: u64, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

fn names(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Formats missed steps by cause.
fn causes(misses: &Misses) -> String {
    let causes = [
        (misses.long_step, "too long"),
        (misses.late_wake, "delayed by others"),
        (misses.stolen, "delayed by the host"),
        (misses.late_input, "without a fresh command"),
    ];
    let causes = causes.iter().filter(|(count, _)| *count > 0);
    causes.map(|(count, cause)| format!("{count} {cause}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::{EventKind, EventSeverity};

    #[test]
    fn misses_are_reported_with_their_causes() {
        let misses = Misses { long_step: 2, stolen: 1, ..Misses::default() };
        let event = Event::Missed { component: "controller", misses };
        assert_eq!(
            event.to_string(),
            "`controller` missed the deadline of 3 steps: 2 too long, 1 delayed by the host"
        );
        assert_eq!((event.kind(), event.value()), (Some(EventKind::Missed), 3.0));
    }

    #[test]
    fn refused_commands_are_reported_with_reasons() {
        let refused = [(Refusal::Limits, 4), (Refusal::Future, 1)];
        let event = Event::Refused { component: "physics", refused: &refused };
        assert_eq!(
            event.to_string(),
            "`physics` refused 5 commands: 4 beyond a limit, 1 stamped in the future"
        );
    }

    #[test]
    fn safe_state_at_the_end_of_a_run_is_not_a_warning() {
        let entered = |is_end| {
            let cause = "its commands are stale";
            Event::EnteredSafeState { component: "physics", times: 1, cause, is_end, since_ns: 0 }
        };
        assert_eq!(entered(true).severity(), EventSeverity::Information);
        assert_eq!(entered(false).severity(), EventSeverity::Warning);
        assert_eq!(entered(false).to_string(), "`physics` entered its safe state: its commands are stale");
    }

    #[test]
    fn resuming_actuator_does_not_follow_its_commands() {
        let left = |before_ns, resuming| {
            Event::LeftSafeState { component: "physics", before_ns, resuming }.to_string()
        };
        assert_eq!(left(None, false), "`physics` follows its commands");
        for text in [left(None, true), left(Some(7), false)] {
            assert!(!text.contains("follows"), "{text}");
        }
    }

    #[test]
    fn moving_actuator_is_not_in_its_safe_state() {
        let event = Event::NotSafe { dead: &[], late: &[], moving: &["physics"], safe: &[] };
        let expected =
            "not all actuators are in their safe state: `physics` in its safe state, but not at rest";
        assert_eq!(event.to_string(), expected);
    }

    #[test]
    fn latencies_are_reported_with_their_budget() {
        let (max_ns, longest_ns) = (300_000, 412_000);
        let event = Event::LatencyMissed { from: "a", to: "b", count: 1, max_ns, longest_ns };
        assert_eq!(
            event.to_string(),
            "the latency from `a` to `b` was above its budget of 300 us 1 time, at most 412 us so far"
        );
    }
}
