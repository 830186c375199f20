//! The emergency-stop topic as an actuator reads it: pressed, released, or silent.

use std::rc::Rc;

use crate::component::{ConfigureError, Setup};
use crate::context::Context;
use crate::plan::EMERGENCY_STOP_PORT;
use crate::state::EmergencyStop;
use crate::transport::Input;

/// The emergency stop at one step of an actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StopSignal {
    /// The newest value is fresh and does not stop the robot.
    Released,
    /// No value has been published yet, and the first one is not overdue. Nothing may move.
    Awaited,
    /// The newest value stops the robot, or is older than `emergency_stop_max_age`.
    Pressed,
}

/// The emergency-stop topic of a graph.
#[derive(Debug)]
pub(super) struct StopInput {
    input: Input<EmergencyStop>,
    silence: Silence,
}

/// Age limit for the newest value of the topic.
#[derive(Debug, Clone, Copy)]
struct Silence {
    /// Maximum age of the newest value, ns; 0 disables the limit.
    max_age_ns: u64,
    /// Time of the first step, ns; 0 before. The age of a missing first value counts from this time.
    since_ns: u64,
}

impl StopInput {
    /// Opens the emergency-stop topic named by `[safety] emergency_stop`, as an input of the actuator.
    /// Returns `None` if the graph names no such topic.
    pub(super) fn open(setup: &mut Setup) -> Result<Option<Self>, ConfigureError> {
        if !setup.has_input(EMERGENCY_STOP_PORT) {
            return Ok(None);
        }
        let input = setup.input(EMERGENCY_STOP_PORT)?;
        let max_age_ns = setup.plan().safety.emergency_stop_max_age_ns;
        Ok(Some(Self { input, silence: Silence { max_age_ns, since_ns: 0 } }))
    }

    /// Restarts the wait for the first value, for a new episode.
    pub(super) fn reset(&mut self) {
        self.silence.since_ns = 0;
    }

    /// Reads the topic in the current step of the actuator.
    #[inline]
    pub(super) fn read(&mut self, context: &Rc<Context>) -> StopSignal {
        let newest = self.input.latest().map(|value| (value.is_pressed(), value.stamp().publish_time));
        self.silence.judge(newest, context.clock().step_ns())
    }
}

impl Silence {
    /// Evaluates the newest value, given as a flag (`true` to stop) and its publication time, ns.
    #[inline]
    fn judge(&mut self, newest: Option<(bool, u64)>, now_ns: u64) -> StopSignal {
        if self.since_ns == 0 {
            self.since_ns = now_ns.max(1);
        }
        // The age of a value from before the first step, such as before a restart of the actuator, counts
        // from that step.
        let heard_ns = newest.map_or(0, |(_, published_ns)| published_ns).max(self.since_ns);
        let is_silent = self.max_age_ns != 0 && now_ns.saturating_sub(heard_ns) > self.max_age_ns;
        match newest {
            _ if is_silent => StopSignal::Pressed,
            Some((true, _)) => StopSignal::Pressed,
            Some((false, _)) => StopSignal::Released,
            None => StopSignal::Awaited,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn silence() -> Silence {
        Silence { max_age_ns: 100 * MS, since_ns: 0 }
    }

    #[test]
    fn silent_publisher_counts_as_pressed_after_max_age() {
        let mut silence = silence();
        assert_eq!(silence.judge(Some((false, 1_000 * MS)), 1_001 * MS), StopSignal::Released);
        assert_eq!(silence.judge(Some((false, 1_050 * MS)), 1_150 * MS), StopSignal::Released);
        assert_eq!(silence.judge(Some((false, 1_050 * MS)), 1_151 * MS), StopSignal::Pressed);
        assert_eq!(silence.judge(Some((false, 1_151 * MS)), 1_152 * MS), StopSignal::Released);
        assert_eq!(silence.judge(Some((true, 1_152 * MS)), 1_153 * MS), StopSignal::Pressed);
    }

    #[test]
    fn nothing_moves_before_the_first_value() {
        let mut silence = silence();
        assert_eq!(silence.judge(None, 5 * MS), StopSignal::Awaited);
        assert_eq!(silence.judge(None, 105 * MS), StopSignal::Awaited);
        assert_eq!(silence.judge(None, 106 * MS), StopSignal::Pressed);
    }

    #[test]
    fn restarted_actuator_restarts_the_age_of_the_value() {
        let mut silence = silence();
        assert_eq!(silence.judge(Some((false, 1)), 900 * MS), StopSignal::Released);
        assert_eq!(silence.judge(Some((false, 1)), 1_001 * MS), StopSignal::Pressed);
    }

    #[test]
    fn without_max_age_any_value_is_fresh() {
        let mut silence = Silence { max_age_ns: 0, since_ns: 0 };
        assert_eq!(silence.judge(Some((false, 1)), u64::MAX), StopSignal::Released);
    }
}
