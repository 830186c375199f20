//! Supervision of one component: its state, and the next action as a pure function of state and facts.

use super::lost_steps::LostSteps;
use super::restart::History;
use super::watchdog::{Overdue, Watchdog};
use crate::plan::{OnFailure, Plan};
use crate::region::{End, Region};

/// Consecutive restarts that crash before the first step after which the run's shared memory counts as
/// damaged.
const CRASHES: u32 = 2;

/// Supervision of one component.
pub(super) struct Supervision {
    pub(super) watchdog: Watchdog,
    pub(super) lost_steps: LostSteps,
    pub(super) history: History,
    pub(super) state: State,
    /// True if its first tolerated error was reported.
    pub(super) reported_tolerated: bool,
}

/// The state of a component between its first step and its permanent end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum State {
    /// The component steps.
    Stepping {
        /// Time of its start, ns.
        since_ns: u64,
    },
    /// The component hung and was killed; its process has not ended yet.
    Hung {
        /// Time of its start, ns.
        since_ns: u64,
        /// Time of the detection, ns.
        noticed_ns: u64,
    },
    /// The component ended and will be restarted; its old process still has memory and slots in topics.
    Clearing(Down),
    /// Its old process is gone. The new one starts at [`Down::start_ns`].
    Due(Down),
    /// Its new process has not stepped yet.
    Starting(Down),
    /// Its new process did not step in time and was killed, unless it is a thread.
    Late(Down),
    /// The graph continues without it.
    Lost {
        /// Text of its end.
        reason: String,
    },
    /// The component ended as requested, or with the run.
    Gone,
}

/// A component between its end and its next step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Down {
    /// Time of the component's first end since it last stepped, ns.
    pub(super) since_ns: u64,
    /// Step count of the component at its last end.
    pub(super) steps: u64,
    /// Start of the new process, ns: immediately, or later after failures in a row.
    pub(super) start_ns: u64,
    /// Consecutive restarts that crashed before the component stepped.
    pub(super) crashes: u32,
}

/// Facts for a decision about one component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Facts {
    pub(super) now_ns: u64,
    /// The watchdog's finding.
    pub(super) overdue: Option<Overdue>,
    /// True if the memory of the component's old process is released.
    pub(super) is_cleared: bool,
    /// True if the component steps after a restart.
    pub(super) steps_again: bool,
    /// Time within which a restarted component must step again, ns.
    pub(super) within_ns: u64,
    /// End of the component's process; `None` while the process runs.
    pub(super) ended: Option<Ended>,
}

/// The end of a component, and its treatment by the component's policies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Ended {
    /// Cause of the end.
    pub(super) end: End,
    /// True if the component did not end in an orderly way.
    pub(super) is_failure: bool,
    /// True if a signal requested the end of the run.
    pub(super) is_requested: bool,
    /// Delay of the restart that the component's policy grants, ns; `None` if the policy grants no restart.
    pub(super) delay_ns: Option<u64>,
    pub(super) on_failure: OnFailure,
}

/// The next action for one component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Action {
    /// Nothing to do yet.
    Wait,
    /// Kill the process of a hung component.
    KillHung(Overdue),
    /// Free the slots of the ended process in the topics.
    Clear,
    /// Start its new process.
    Start,
    /// Report the restart of a component that steps again.
    Recover,
    /// Kill the process of a component that does not step in time after a restart.
    KillLate,
    /// Leave a component that ended as requested.
    Leave,
    /// Restart it.
    Restart {
        /// Delay of the start, ns.
        delay_ns: u64,
        /// Consecutive restarts that crashed, including this one.
        crashes: u32,
    },
    /// The graph continues without it.
    Abandon(Loss),
    /// The graph cannot continue.
    Stop(Loss),
}

/// The reason why a component is not restarted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loss {
    /// Its policy grants no restart after this failure.
    Failed,
    /// The component crashes after each restart, because the shared memory of the run is damaged.
    Damaged,
    /// The component ended in an orderly way, but the graph still runs.
    Early,
}

impl Supervision {
    /// Supervises a component from `now_ns` on.
    pub(super) fn new(plan: &Plan, region: &Region, index: usize, now_ns: u64) -> Self {
        Self {
            watchdog: Watchdog::new(plan, region, index, now_ns),
            lost_steps: LostSteps::new(plan.components[index].liveness.lost_steps, now_ns),
            history: History::default(),
            state: State::Stepping { since_ns: now_ns },
            reported_tolerated: false,
        }
    }

    /// Returns `true` if the component has ended permanently.
    pub(super) fn is_gone(&self) -> bool {
        matches!(self.state, State::Lost { .. } | State::Gone)
    }

    /// Returns the text of the component's end, if the graph continues without the component.
    pub(super) fn lost(&self) -> Option<&str> {
        match &self.state {
            State::Lost { reason } => Some(reason),
            _ => None,
        }
    }

    /// Returns `true` if the component is down: it has ended and not stepped since. `steps` is its step
    /// count.
    pub(super) fn is_down(&self, steps: u64) -> bool {
        self.state.down().is_some_and(|down| steps <= down.steps)
    }
}

impl State {
    /// Returns the component's state between its end and its next step; `None` unless the component is down.
    pub(super) fn down(&self) -> Option<Down> {
        match self {
            Self::Clearing(down) | Self::Due(down) | Self::Starting(down) | Self::Late(down) => Some(*down),
            Self::Stepping { .. } | Self::Hung { .. } | Self::Lost { .. } | Self::Gone => None,
        }
    }

    /// Returns the time since which the component has stepped, ns, if it stepped until its end.
    pub(super) fn stepping_since_ns(&self) -> Option<u64> {
        match self {
            Self::Stepping { since_ns } | Self::Hung { since_ns, .. } => Some(*since_ns),
            _ => None,
        }
    }

    /// Returns `true` while the component has a separate process whose end matters.
    pub(super) fn has_process(&self) -> bool {
        matches!(self, Self::Stepping { .. } | Self::Hung { .. } | Self::Starting(_) | Self::Late(_))
    }
}

/// Decides on the next action for a component.
pub(super) fn decide(state: &State, facts: &Facts) -> Action {
    if let Some(ended) = facts.ended.filter(|_| state.has_process()) {
        return after_end(state, &ended);
    }
    match state {
        State::Stepping { .. } => facts.overdue.map_or(Action::Wait, Action::KillHung),
        State::Clearing(_) if facts.is_cleared => Action::Clear,
        State::Due(down) if facts.now_ns >= down.start_ns => Action::Start,
        // A late thread cannot be killed and may still step.
        State::Starting(_) | State::Late(_) if facts.steps_again => Action::Recover,
        State::Starting(down) if facts.now_ns.saturating_sub(down.start_ns) > facts.within_ns => {
            Action::KillLate
        }
        State::Hung { .. }
        | State::Clearing(_)
        | State::Due(_)
        | State::Starting(_)
        | State::Late(_)
        | State::Lost { .. }
        | State::Gone => Action::Wait,
    }
}

fn after_end(state: &State, ended: &Ended) -> Action {
    if ended.is_requested && !ended.is_failure {
        return Action::Leave;
    }
    let crashes = match state.down() {
        Some(down) if ended.end.suggests_damage() => down.crashes + 1,
        _ => 0,
    };
    let is_damaged = crashes >= CRASHES;
    if let Some(delay_ns) = ended.delay_ns.filter(|_| !is_damaged) {
        return Action::Restart { delay_ns, crashes };
    }
    let loss = match ended.is_failure {
        true if is_damaged => Loss::Damaged,
        true => Loss::Failed,
        // No stop was requested, so even a component that ended in an orderly way is missing.
        false => Loss::Early,
    };
    match ended.on_failure {
        OnFailure::Ignore => Action::Abandon(loss),
        OnFailure::SafeStop => Action::Stop(loss),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::PanicOrigin;

    const MS: u64 = 1_000_000;
    const DOWN: Down = Down { since_ns: 0, steps: 7, start_ns: 50 * MS, crashes: 0 };
    const FACTS: Facts = Facts {
        now_ns: 100 * MS,
        overdue: None,
        is_cleared: false,
        steps_again: false,
        within_ns: 60 * MS,
        ended: None,
    };
    const FAILED: Ended = Ended {
        end: End::Failed,
        is_failure: true,
        is_requested: false,
        delay_ns: None,
        on_failure: OnFailure::SafeStop,
    };
    const STEPPING: State = State::Stepping { since_ns: 0 };
    const HUNG: State = State::Hung { since_ns: 0, noticed_ns: 90 * MS };

    fn after(ended: Ended) -> Facts {
        Facts { ended: Some(ended), ..FACTS }
    }

    #[test]
    fn running_component_follows_the_table() {
        let overdue = Overdue::InStep { for_ns: 21 * MS };
        let late = Facts { now_ns: 111 * MS, ..FACTS };
        let lost = State::Lost { reason: String::new() };
        for (state, facts, action) in [
            (STEPPING, FACTS, Action::Wait),
            (STEPPING, Facts { overdue: Some(overdue), ..FACTS }, Action::KillHung(overdue)),
            (HUNG, Facts { overdue: Some(overdue), ..FACTS }, Action::Wait),
            (State::Clearing(DOWN), FACTS, Action::Wait),
            (State::Clearing(DOWN), Facts { is_cleared: true, ..FACTS }, Action::Clear),
            (State::Due(DOWN), Facts { now_ns: 50 * MS - 1, ..FACTS }, Action::Wait),
            (State::Due(DOWN), Facts { now_ns: 50 * MS, ..FACTS }, Action::Start),
            (State::Starting(DOWN), FACTS, Action::Wait),
            (State::Starting(DOWN), Facts { steps_again: true, ..FACTS }, Action::Recover),
            (State::Starting(DOWN), Facts { now_ns: 110 * MS, ..FACTS }, Action::Wait),
            (State::Starting(DOWN), late, Action::KillLate),
            (State::Starting(DOWN), Facts { steps_again: true, ..late }, Action::Recover),
            (State::Late(DOWN), late, Action::Wait),
            (State::Late(DOWN), Facts { steps_again: true, ..late }, Action::Recover),
            (lost, after(FAILED), Action::Wait),
            (State::Gone, after(FAILED), Action::Wait),
        ] {
            assert_eq!(decide(&state, &facts), action, "{state:?} {facts:?}");
        }
    }

    #[test]
    fn policies_decide_about_an_end() {
        let ignored = Ended { on_failure: OnFailure::Ignore, ..FAILED };
        let in_order = Ended { end: End::Exited(0), is_failure: false, ..FAILED };
        let granted = Ended { delay_ns: Some(20 * MS), ..FAILED };
        let restart = Action::Restart { delay_ns: 20 * MS, crashes: 0 };
        for (ended, action) in [
            (FAILED, Action::Stop(Loss::Failed)),
            (ignored, Action::Abandon(Loss::Failed)),
            (in_order, Action::Stop(Loss::Early)),
            (Ended { on_failure: OnFailure::Ignore, ..in_order }, Action::Abandon(Loss::Early)),
            (Ended { is_requested: true, ..in_order }, Action::Leave),
            (Ended { is_requested: true, ..FAILED }, Action::Stop(Loss::Failed)),
            (granted, restart),
            (Ended { delay_ns: Some(20 * MS), ..in_order }, restart),
            (Ended { delay_ns: Some(20 * MS), is_requested: true, ..in_order }, Action::Leave),
        ] {
            for state in [STEPPING, HUNG, State::Starting(DOWN), State::Late(DOWN)] {
                assert_eq!(decide(&state, &after(ended)), action, "{state:?} {ended:?}");
            }
            for state in [State::Clearing(DOWN), State::Due(Down { start_ns: u64::MAX, ..DOWN })] {
                assert_eq!(decide(&state, &after(ended)), Action::Wait, "the old end is known: {state:?}");
            }
        }
    }

    #[test]
    fn repeated_crashes_mean_damaged_memory() {
        let crash = Ended { end: End::Killed(libc::SIGSEGV), delay_ns: Some(0), ..FAILED };
        let panic = Ended { end: End::Panicked(PanicOrigin::SharedMemory), ..crash };
        let own_panic = Ended { end: End::Panicked(PanicOrigin::Component), ..crash };
        let again = |crashes| State::Starting(Down { crashes, ..DOWN });
        let restart = |crashes| Action::Restart { delay_ns: 0, crashes };
        for (state, ended, action) in [
            (STEPPING, crash, restart(0)),
            (again(0), crash, restart(1)),
            (again(1), crash, Action::Stop(Loss::Damaged)),
            (again(1), panic, Action::Stop(Loss::Damaged)),
            (again(1), Ended { on_failure: OnFailure::Ignore, ..panic }, Action::Abandon(Loss::Damaged)),
            (again(1), own_panic, restart(0)),
            (again(1), Ended { end: End::Killed(libc::SIGKILL), ..crash }, restart(0)),
        ] {
            assert_eq!(decide(&state, &after(ended)), action, "{state:?} {ended:?}");
        }
    }

    #[test]
    fn hung_component_counts_as_stepping_until_its_end() {
        assert_eq!(HUNG.stepping_since_ns(), Some(0));
        assert_eq!(HUNG.down(), None);
        assert_eq!(State::Late(DOWN).stepping_since_ns(), None);
        assert_eq!(State::Late(DOWN).down(), Some(DOWN));
    }
}
