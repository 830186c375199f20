//! The events of a run.

mod words;

use super::{Exit, Status};
use crate::plan::Plan;
use crate::region::{EventKind, EventSeverity, Latch, Misses, Refusal};

/// An event of a run, passed to the observer.
#[derive(Debug)]
pub enum Event<'a> {
    /// The run's services exist; its components are being started.
    Created {
        /// Id of the run.
        run: &'a str,
        /// Plan of the run.
        plan: &'a Plan,
    },
    /// The system denied requests of the graph. The text lists them in one line.
    Lost(&'a str),
    /// All ports are connected; the first step is due.
    Started,
    /// A component printed a line.
    Output {
        /// Name of the component.
        component: &'a str,
        /// The printed line.
        line: &'a str,
    },
    /// A component failed.
    Failed {
        /// Name of the component.
        component: &'a str,
        /// Index of the step at which it failed.
        tick: u64,
        /// Reason for the failure.
        reason: &'a str,
        /// Consequence of the failure, such as a restart.
        consequence: &'a str,
        /// Time at which the failure was detected, `CLOCK_MONOTONIC` ns; `None` if this is the time of the
        /// event.
        seen_ns: Option<u64>,
    },
    /// A restarted component steps again.
    Restarted {
        /// Name of the component.
        component: &'a str,
        /// Time from the component's end to its first step after the restart, ns.
        after_ns: u64,
    },
    /// All components and simulated time were reset for an episode.
    Reset {
        /// Index of the episode.
        episode: u64,
        /// Seed of the episode.
        seed: u64,
    },
    /// An episode of real time began, without a reset.
    EpisodeBegan {
        /// Index of the episode.
        episode: u64,
        /// Seed of the episode.
        seed: u64,
    },
    /// Steps of a component ended after their deadline.
    Missed {
        /// Name of the component.
        component: &'a str,
        /// Number of missed steps by cause, since the last event of this kind.
        misses: Misses,
    },
    /// Latencies were above their budget.
    LatencyMissed {
        /// Name of the topic at the head of the chain.
        from: &'a str,
        /// Name of the topic at the end of the chain.
        to: &'a str,
        /// Number of latencies above the budget since the last event of this kind.
        count: u64,
        /// Latency budget, ns.
        max_ns: u64,
        /// Longest latency of the run so far, ns.
        longest_ns: u64,
    },
    /// The command gate of an actuator refused commands.
    Refused {
        /// Name of the actuator.
        component: &'a str,
        /// Number of refused commands by reason, since the last event of this kind.
        refused: &'a [(Refusal, u64)],
    },
    /// An actuator that had followed commands entered its safe state.
    EnteredSafeState {
        /// Name of the actuator.
        component: &'a str,
        /// Number of entries into the safe state since the last event of this kind.
        times: u64,
        /// Reason for the safe state.
        cause: &'a str,
        /// `true` if the end of the run caused the safe state.
        is_end: bool,
        /// Time of the last entry into the safe state, `CLOCK_MONOTONIC` ns.
        since_ns: u64,
    },
    /// An actuator left its safe state: it follows its commands, or is resuming.
    LeftSafeState {
        /// Name of the actuator.
        component: &'a str,
        /// Time by which the actuator had left its safe state, `CLOCK_MONOTONIC` ns, if it has entered the
        /// safe state again since. Otherwise `None`.
        before_ns: Option<u64>,
        /// `true` if the actuator approaches its commands at limited rates and does not follow them yet.
        resuming: bool,
    },
    /// The whole graph enters its safe state, and the run ends.
    SafeStop {
        /// Reason for the safe stop.
        reason: &'a str,
    },
    /// All actuators are in their safe state.
    Safe {
        /// Time from the detection of the cause until the last actuator was in its safe state, ns.
        after_ns: u64,
    },
    /// Not all actuators reached their safe state.
    NotSafe {
        /// Names of actuators without a process.
        dead: &'a [&'a str],
        /// Names of running actuators that did not report their safe state in time.
        late: &'a [&'a str],
        /// Names of actuators in their safe state whose joints are not at rest.
        moving: &'a [&'a str],
        /// Names of actuators at rest in their safe state.
        safe: &'a [&'a str],
    },
    /// The actuators stay in their safe state until `motorium resume`; the run continues.
    Stopped {
        /// Kind of the stop.
        latch: Latch,
        /// Cause of the stop, as text.
        cause: &'a str,
    },
    /// The stop was released; the actuators return to their commands.
    Resumed,
    /// A component loses more of its steps than the graph allows.
    LosesSteps {
        /// Name of the component.
        component: &'a str,
        /// Fraction of its steps that the component lost in the last second, 0 to 1.
        share: f64,
    },
    /// In lockstep, a step has not completed, and simulated time does not advance.
    Waiting {
        /// Name of the component.
        component: &'a str,
        /// Index of the step.
        tick: u64,
        /// Time since the start of the step, ns.
        for_ns: u64,
    },
    /// A warning about an actual or possible deviation from the graph, as text.
    Warning(&'a str),
    /// The components received the request to end.
    Ending(&'a Exit),
    /// The launcher does not respond. Reported by the guard.
    LauncherSilent {
        /// Id of the run.
        run: &'a str,
    },
    /// The launcher responds again. Reported by the guard.
    LauncherBack {
        /// Id of the run.
        run: &'a str,
    },
    /// The launcher has ended or was killed. Reported by the guard, which then ends the run.
    LauncherEnded {
        /// Id of the run.
        run: &'a str,
        /// Description of the launcher's end.
        cause: &'a str,
    },
    /// The guard has brought the robot to its safe state. Reported by the guard.
    GuardActed {
        /// Description of the states of all actuators.
        actuators: &'a str,
        /// True if all actuators are in their safe state.
        is_safe: bool,
    },
    /// Periodic status of the graph.
    Status(&'a Status),
}

impl Event<'_> {
    /// Returns the kind of the event. Returns `None` for a status, which is not logged.
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

    /// Returns the name of the affected component, or `None` if the event concerns the whole run.
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

    /// Returns the value of the event as defined by its [kind](EventKind); 0 for kinds without a value.
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

    /// Returns `true` for an event that is logged but not printed by `motorium run`, because the closing
    /// summary contains it.
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
