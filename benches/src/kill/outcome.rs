//! Outcome of a fault: behaviour of the robot and recovery of the process.

use core::fmt;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fault::{Fault, Victim};
use super::trial::{Consequence, Trial};

/// The pauses whose outcome counts: long for a command, and short for a watchdog of 200 ms on a machine that
/// is busy.
const PAUSES: core::ops::RangeInclusive<Duration> = Duration::from_millis(20)..=Duration::from_millis(100);

/// The robot after a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Robot {
    /// It follows its commands without interruption.
    GoesOn,
    /// Its actuators enter their safe state, and follow commands again if the run continues.
    Safe,
    /// Its only actuator is the victim: nothing is applied until it is back.
    WithoutActuator,
}

/// The process that was hit, or the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum After {
    /// The process continues, or is not needed.
    GoesOn,
    /// A new process has replaced it.
    Replaced,
    /// The run has ended.
    RunEnds,
}

/// The outcome of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Outcome {
    /// The robot.
    pub robot: Robot,
    /// The process that was hit, or the run.
    pub after: After,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.robot {
            Robot::GoesOn => "goes on",
            Robot::Safe => "safe state",
            Robot::WithoutActuator => "no actuator",
        })?;
        f.write_str(match self.after {
            After::GoesOn => "",
            After::Replaced => "; new process",
            After::RunEnds => "; run ends",
        })
    }
}

impl Outcome {
    /// Most frequent outcome of these faults of one kind.
    pub(super) fn most_frequent(fault: Fault, consequences: &[Consequence]) -> Option<Self> {
        let counts = |one: &&Consequence| !fault.passes() || PAUSES.contains(&one.pause);
        let mut outcomes: Vec<Self> =
            consequences.iter().filter(counts).filter_map(|one| one.outcome).collect();
        outcomes.sort();
        let times = |outcome: &Self| outcomes.iter().filter(|other| *other == outcome).count();
        outcomes.iter().max_by_key(|outcome| times(outcome)).copied()
    }
}

impl Trial {
    /// The outcome of a fault in words.
    pub(super) fn outcome(
        &self,
        victim: &Victim,
        fault: Fault,
        before: &Before,
        seen: &Consequence,
    ) -> Outcome {
        let index = match victim {
            Victim::Component(name) => self.index(name),
            _ => None,
        };
        let mut others = self.plan.components.iter().enumerate().filter(|(other, _)| Some(*other) != index);
        let is_only_actuator = index.is_some_and(|index| self.plan.components[index].actuator)
            && others.all(|(_, component)| !component.actuator);
        let robot = match seen.safe_ns {
            _ if is_only_actuator => Robot::WithoutActuator,
            Some(_) => Robot::Safe,
            None => Robot::GoesOn,
        };
        let after = match (victim, index) {
            (Victim::Launcher, _) if fault.ends(victim) => After::RunEnds,
            (Victim::Guard, _) if seen.detected_ns.is_some() => After::Replaced,
            (Victim::Component(_), Some(index))
                if self.region.components()[index].restarts.load(Relaxed) > before.restarts =>
            {
                After::Replaced
            }
            _ => After::GoesOn,
        };
        Outcome { robot, after }
    }
}

/// Counters of a run just before a fault.
pub(super) struct Before {
    pub(super) restarts: u32,
    pub(super) steps: u64,
    pub(super) guard: u32,
}

impl Before {
    pub(super) fn capture(trial: &Trial, victim: &Victim) -> Self {
        let guard = trial.region.header().guard.load(Relaxed);
        let index = match victim {
            Victim::Component(name) => trial.index(name),
            _ => None,
        };
        let (restarts, steps) = index.map_or((0, 0), |index| {
            let block = &trial.region.components()[index];
            (block.restarts.load(Relaxed), block.steps.load(Relaxed))
        });
        Self { restarts, steps, guard }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let outcome = |fault| Outcome::most_frequent(fault, &seen).map(|outcome| outcome.to_string());
        assert_eq!(outcome(Fault::Pause).as_deref(), Some("safe state"));
        assert_eq!(outcome(Fault::Kill).as_deref(), Some("safe state; new process"));
        assert_eq!(Outcome::most_frequent(Fault::Pause, &[short]), None);
    }
}
