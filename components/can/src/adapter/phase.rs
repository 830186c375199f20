//! Phases of a drive, with transitions as a pure function of the drive's report.

use super::HomingFault;
use crate::drive::State;

/// Phase of a drive, from the check of its settings to following commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The settings are being read; the value is the index of the next setting.
    Checking(u8),
    /// The drive is disabled and its settings are correct.
    Disabled,
    /// The joint moves to the mark that determines its position.
    Homing,
    /// The drive has been ordered to enable.
    Enabling,
    /// The drive follows commands.
    Enabled,
    /// The drive disabled itself because of a fault.
    Fault,
}

/// Report of a drive about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Report {
    /// Its state.
    State(State),
    /// The drive has restarted and lost its configuration.
    Restarted,
}

/// Inputs to the decision about one drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Facts {
    /// `true` if the drive is only observed, never enabled.
    pub(super) is_observed: bool,
    /// `true` if the drive is disabled for the rest of the run.
    pub(super) is_released: bool,
    /// `true` if the adapter moves the joint to its stop.
    pub(super) is_led: bool,
}

/// Consequence of a report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Change {
    /// Nothing changes.
    Keep,
    /// The drive follows commands.
    Follow,
    /// The drive is enabled, and its homing starts.
    Lead,
    /// An observed drive has recovered.
    Recover,
    /// The drive disabled itself. A new failure trips the adapter.
    Fail {
        /// Failure of a running homing.
        homing: HomingFault,
        is_new: bool,
    },
}

/// Decides on the consequence of a drive's report.
pub(super) fn decide(phase: Phase, report: Report, facts: Facts) -> Change {
    let let_go = Change::Fail { homing: HomingFault::LetGo, is_new: true };
    match (report, phase) {
        (Report::State(State::Fault(_)), phase) => {
            Change::Fail { homing: HomingFault::Drive, is_new: phase != Phase::Fault }
        }
        (Report::Restarted, Phase::Homing | Phase::Enabling | Phase::Enabled) => let_go,
        // Nobody resumes an adapter that only listens.
        (Report::State(_), Phase::Fault) if facts.is_observed => Change::Recover,
        (Report::State(State::Enabled | State::Unknown), Phase::Enabling) => Change::Follow,
        (Report::State(State::Enabled | State::Unknown), Phase::Homing) => Change::Lead,
        (Report::State(State::Disabled), Phase::Homing) if facts.is_led && !facts.is_released => let_go,
        // The drive disabled itself: its power was cut, or its watchdog tripped unnoticed.
        (Report::State(State::Disabled), Phase::Enabled) if !facts.is_released => let_go,
        _ => Change::Keep,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Fault;

    const PHASES: [Phase; 6] =
        [Phase::Checking(1), Phase::Disabled, Phase::Homing, Phase::Enabling, Phase::Enabled, Phase::Fault];
    const FREE: Facts = Facts { is_observed: false, is_released: false, is_led: false };
    const LED: Facts = Facts { is_led: true, ..FREE };
    const OBSERVED: Facts = Facts { is_observed: true, ..FREE };
    const RELEASED: Facts = Facts { is_released: true, is_led: true, ..FREE };

    #[test]
    fn reports_change_phases_by_the_table() {
        use Change::{Follow, Keep, Lead, Recover};
        let gone = Change::Fail { homing: HomingFault::LetGo, is_new: true };
        let failed = Change::Fail { homing: HomingFault::Drive, is_new: true };
        let still_failed = Change::Fail { homing: HomingFault::Drive, is_new: false };
        let fault = Report::State(State::Fault(Fault::Overload));
        let enabled = Report::State(State::Enabled);
        let unknown = Report::State(State::Unknown);
        let disabled = Report::State(State::Disabled);
        for (report, facts, changes) in [
            (enabled, FREE, [Keep, Keep, Lead, Follow, Keep, Keep]),
            (unknown, LED, [Keep, Keep, Lead, Follow, Keep, Keep]),
            (disabled, FREE, [Keep, Keep, Keep, Keep, gone, Keep]),
            (disabled, LED, [Keep, Keep, gone, Keep, gone, Keep]),
            (disabled, RELEASED, [Keep; 6]),
            (disabled, OBSERVED, [Keep, Keep, Keep, Keep, gone, Recover]),
            (enabled, OBSERVED, [Keep, Keep, Lead, Follow, Keep, Recover]),
            (fault, FREE, [failed, failed, failed, failed, failed, still_failed]),
            (fault, OBSERVED, [failed, failed, failed, failed, failed, still_failed]),
            (fault, RELEASED, [failed, failed, failed, failed, failed, still_failed]),
            (Report::Restarted, FREE, [Keep, Keep, gone, gone, gone, Keep]),
            (Report::Restarted, RELEASED, [Keep, Keep, gone, gone, gone, Keep]),
        ] {
            let found = PHASES.map(|phase| decide(phase, report, facts));
            assert_eq!(found, changes, "{report:?} {facts:?}");
        }
    }
}
