//! The events of a run.

mod words;

use super::{Exit, Status};
use crate::plan::Plan;
use crate::region::{EventKind, EventSeverity, Latch, Misses, Refusal};

/// An event of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// The run's services exist; its components are being started.
    Created {
        /// The run's name.
        run: &'a str,
        /// The plan.
        plan: &'a Plan,
    },
    /// Requests that the system denied, in one line.
    Lost(&'a str),
    /// All ports are connected; the first step is due.
    Started,
    /// A line printed by a component.
    Output {
        /// The component.
        component: &'a str,
        /// The line.
        line: &'a str,
    },
    /// A component failed.
    Failed {
        /// The component.
        component: &'a str,
        /// Index of the step at which it failed.
        tick: u64,
        /// The reason.
        reason: &'a str,
        /// The consequence.
        consequence: &'a str,
        /// Time of its detection, ns of the monotonic clock; `None` for now.
        seen_ns: Option<u64>,
    },
    /// A restarted component steps again.
    Restarted {
        /// The component.
        component: &'a str,
        /// Time from its end to its first step, ns.
        after_ns: u64,
    },
    /// All components and simulated time were reset for an episode.
    Reset {
        /// Number of the episode.
        episode: u64,
        /// Its seed.
        seed: u64,
    },
    /// A real-time episode began.
    EpisodeBegan {
        /// Number of the episode.
        episode: u64,
        /// Its seed.
        seed: u64,
    },
    /// Steps of a component ended after their deadline.
    Missed {
        /// The component.
        component: &'a str,
        /// Their number by cause, since the last event of this kind.
        misses: Misses,
    },
    /// Latencies were above their budget.
    LatencyMissed {
        /// Topic at the head of the chain.
        from: &'a str,
        /// Topic at its end.
        to: &'a str,
        /// Their number since the last event of this kind.
        count: u64,
        /// The budget, ns.
        max_ns: u64,
        /// The longest latency of the run so far, ns.
        longest_ns: u64,
    },
    /// The command gate of an actuator refused commands.
    Refused {
        /// The actuator.
        component: &'a str,
        /// Their number by reason, since the last event of this kind.
        refused: &'a [(Refusal, u64)],
    },
    /// An actuator that followed commands applies its safe state.
    EnteredSafeState {
        /// The actuator.
        component: &'a str,
        /// Number of occurrences since the last event of this kind.
        times: u64,
        /// The reason.
        cause: &'a str,
        /// `true` if caused by the end of the run.
        is_end: bool,
        /// Time of the last entry, `CLOCK_MONOTONIC` ns.
        since_ns: u64,
    },
    /// An actuator left its safe state: it follows its commands, or is resuming.
    LeftSafeState {
        /// The actuator.
        component: &'a str,
        /// Time by which it happened, `CLOCK_MONOTONIC` ns, if it is in its safe state again; otherwise now.
        before_ns: Option<u64>,
        /// `true` if it does not follow its commands yet but approaches them at limited rates.
        resuming: bool,
    },
    /// The graph goes to its safe state.
    SafeStop {
        /// The reason.
        reason: &'a str,
    },
    /// The actuators are in their safe state.
    Safe {
        /// Time from the detection of the cause to the last actuator's safe state, ns.
        after_ns: u64,
    },
    /// Not all actuators reached their safe state.
    NotSafe {
        /// Actuators without a process.
        dead: &'a [&'a str],
        /// Running actuators that did not report their safe state in time.
        late: &'a [&'a str],
        /// Actuators in their safe state whose joints are not at rest.
        moving: &'a [&'a str],
        /// Actuators at rest in their safe state.
        safe: &'a [&'a str],
    },
    /// The actuators stay in their safe state until `motorium resume`; the run continues.
    Stopped {
        /// The kind of the stop.
        latch: Latch,
        /// The cause of the stop.
        cause: &'a str,
    },
    /// The stop was released; the actuators return to their commands.
    Resumed,
    /// A component loses more of its steps than the graph allows.
    LosesSteps {
        /// The component.
        component: &'a str,
        /// Share of steps lost in the last second.
        share: f64,
    },
    /// In lockstep, a step has not ended, and simulated time does not advance.
    Waiting {
        /// The component.
        component: &'a str,
        /// Index of the step.
        tick: u64,
        /// Time since its beginning, ns.
        for_ns: u64,
    },
    /// A deviation, actual or possible, from the graph's requirements.
    Warning(&'a str),
    /// The components received the request to end.
    Ending(&'a Exit),
    /// The launcher does not respond. Reported by the guard.
    LauncherSilent {
        /// The run's name.
        run: &'a str,
    },
    /// The launcher responds again. Reported by the guard.
    LauncherBack {
        /// The run's name.
        run: &'a str,
    },
    /// The launcher has ended or was killed. Reported by the guard, which ends the run instead.
    LauncherEnded {
        /// The run's name.
        run: &'a str,
        /// The end of the launcher.
        cause: &'a str,
    },
    /// The guard has brought the robot to its safe state. Reported by the guard.
    GuardActed {
        /// The states of the actuators.
        actuators: &'a str,
        /// True if all of them are in their safe state.
        is_safe: bool,
    },
    /// The status of the graph.
    Status(&'a Status),
}

impl Event<'_> {
    /// Returns the kind of the event; `None` for a status, which is not logged.
    pub fn kind(&self) -> Option<EventKind> {
        Some(match self {
            Self::Created { .. } => EventKind::Created,
            Self::Lost(_) => EventKind::Denied,
            Self::Started => EventKind::Started,
            Self::Output { .. } => EventKind::Output,
            Self::Failed { .. } => EventKind::Failed,
            Self::Restarted { .. } => EventKind::Restarted,
            Self::Reset { .. } => EventKind::Reset,
            Self::Missed { .. } => EventKind::Missed,
            Self::LatencyMissed { .. } => EventKind::LatencyMissed,
            Self::Refused { .. } => EventKind::Refused,
            Self::EnteredSafeState { .. } => EventKind::EnteredSafeState,
            Self::LeftSafeState { .. } => EventKind::LeftSafeState,
            Self::SafeStop { .. } => EventKind::SafeStop,
            Self::Safe { .. } => EventKind::Safe,
            Self::NotSafe { .. } => EventKind::NotSafe,
            Self::Stopped { .. } => EventKind::Stopped,
            Self::Resumed => EventKind::Resumed,
            Self::LosesSteps { .. } => EventKind::LosesSteps,
            Self::Waiting { .. } => EventKind::Waiting,
            Self::Warning(_) => EventKind::Warning,
            Self::Ending(_) => EventKind::Ending,
            Self::LauncherSilent { .. } => EventKind::LauncherSilent,
            Self::LauncherBack { .. } => EventKind::LauncherBack,
            Self::LauncherEnded { .. } => EventKind::LauncherEnded,
            Self::GuardActed { .. } => EventKind::GuardActed,
            Self::EpisodeBegan { .. } => EventKind::EpisodeBegan,
            Self::Status(_) => return None,
        })
    }

    /// Returns the severity of the event.
    pub fn severity(&self) -> EventSeverity {
        match self {
            Self::Failed { .. }
            | Self::SafeStop { .. }
            | Self::NotSafe { .. }
            | Self::LauncherEnded { .. }
            | Self::GuardActed { is_safe: false, .. }
            | Self::Ending(Exit::SafeStop { .. }) => EventSeverity::Error,
            Self::Lost(_)
            | Self::Missed { .. }
            | Self::LatencyMissed { .. }
            | Self::Refused { .. }
            | Self::EnteredSafeState { is_end: false, .. }
            | Self::Stopped { .. }
            | Self::LosesSteps { .. }
            | Self::Waiting { .. }
            | Self::Warning(_)
            | Self::LauncherSilent { .. } => EventSeverity::Warning,
            _ => EventSeverity::Information,
        }
    }

    /// Returns the affected component.
    pub fn component(&self) -> Option<&str> {
        match self {
            Self::Output { component, .. }
            | Self::Failed { component, .. }
            | Self::Restarted { component, .. }
            | Self::Missed { component, .. }
            | Self::Refused { component, .. }
            | Self::EnteredSafeState { component, .. }
            | Self::LeftSafeState { component, .. }
            | Self::LosesSteps { component, .. }
            | Self::Waiting { component, .. } => Some(component),
            _ => None,
        }
    }

    /// Returns the value of the event as defined by its [kind](EventKind), otherwise 0.
    pub fn value(&self) -> f64 {
        let seconds = |ns: u64| ns as f64 * 1e-9;
        match self {
            Self::Restarted { after_ns, .. } | Self::Safe { after_ns } => seconds(*after_ns),
            Self::Reset { episode, .. } | Self::EpisodeBegan { episode, .. } => *episode as f64,
            Self::Missed { misses, .. } => misses.missed() as f64,
            Self::LatencyMissed { count, .. } => *count as f64,
            Self::Refused { refused, .. } => refused.iter().map(|(_, count)| *count).sum::<u64>() as f64,
            Self::LosesSteps { share, .. } => *share,
            Self::Waiting { for_ns, .. } => seconds(*for_ns),
            _ => 0.0,
        }
    }

    /// Returns `true` for an event that is only logged: `motorium run` does not print it, because the closing
    /// summary counts it.
    pub fn is_logged_only(&self) -> bool {
        matches!(
            self,
            Self::Reset { .. }
                | Self::EpisodeBegan { .. }
                | Self::Missed { .. }
                | Self::LatencyMissed { .. }
                | Self::Refused { .. }
                | Self::EnteredSafeState { .. }
                | Self::LeftSafeState { .. }
                | Self::Ending(_)
                | Self::Status(_)
        )
    }
}
