//! The outcome of a fault in a run.

use std::sync::atomic::Ordering::Relaxed;

use super::{Before, Trial};
use crate::kill::consequence::Consequence;
use crate::kill::fault::{Fault, Victim};
use crate::kill::outcome::{After, Outcome, Robot};

impl Trial {
    /// Determines the outcome of a fault.
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
