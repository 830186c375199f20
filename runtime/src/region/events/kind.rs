//! Kinds and severities of events.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::state::Event;

/// The severity of an event of a run.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum EventSeverity {
    /// The run proceeds as planned.
    #[default]
    Information = Event::INFORMATION,
    /// The run continues, but deviates from the graph.
    Warning = Event::WARNING,
    /// A failure.
    Error = Event::ERROR,
}

impl EventSeverity {
    /// All severities, in ascending order.
    pub const ALL: [Self; 3] = [Self::Information, Self::Warning, Self::Error];

    /// Returns the name of the severity in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Information => "information",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

macro_rules! kinds {
    ($($(#[doc = $doc:literal])+ $kind:ident = $number:literal, $name:literal;)*) => {
        /// The kind of an event of a run. Its number is the `code` of the published [`Event`].
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
        #[repr(u32)]
        pub enum EventKind {
            $($(#[doc = $doc])+ #[serde(rename = $name)] $kind = $number,)*
        }

        impl EventKind {
            /// All kinds, in the order of their declaration.
            pub const ALL: &'static [Self] = &[$(Self::$kind),*];

            /// Returns the name of the kind in JSON.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => $name,)*
                }
            }

            /// Decodes a number. Returns `None` if this version does not define it.
            pub fn from_number(number: u32) -> Option<Self> {
                match number {
                    $($number => Some(Self::$kind),)*
                    _ => None,
                }
            }
        }
    };
}

kinds! {
    /// The shared memory of the run exists; its components are being started.
    Created = 1, "created";
    /// All ports are connected; the first step is due.
    Started = 2, "started";
    /// The system denied a resource or privilege that the graph requires.
    Denied = 3, "denied";
    /// A component printed a line.
    Output = 4, "output";
    /// A component failed.
    Failed = 5, "failed";
    /// A restarted component steps again. The value is the time from the component's end to its first step
    /// after the restart, s.
    Restarted = 6, "restarted";
    /// All components and simulated time were reset for an episode. The value is the index of the episode.
    Reset = 7, "reset";
    /// Steps ended after their deadline. The value is the number of such steps since the last event of this
    /// kind.
    Missed = 8, "missed";
    /// Latencies were above their budget. The value is the number of such latencies since the last event of
    /// this kind.
    LatencyMissed = 9, "latency_missed";
    /// A command gate refused commands. The value is the number of refused commands since the last event of
    /// this kind.
    Refused = 10, "refused";
    /// An actuator entered its safe state.
    EnteredSafeState = 11, "entered_safe_state";
    /// An actuator left its safe state: it follows its commands or is resuming.
    LeftSafeState = 12, "left_safe_state";
    /// The whole graph enters its safe state, and the run ends.
    SafeStop = 13, "safe_stop";
    /// All actuators are in their safe state. The value is the time from the detection of the cause until the
    /// last actuator was in its safe state, s.
    Safe = 14, "safe";
    /// Not all actuators reached their safe state.
    NotSafe = 15, "not_safe";
    /// The robot stays in its safe state until `motorium resume`.
    Stopped = 16, "stopped";
    /// The stop was released by `motorium resume`.
    Resumed = 17, "resumed";
    /// A component loses a larger fraction of its steps than the graph allows. The value is the fraction, 0
    /// to 1.
    LosesSteps = 18, "loses_steps";
    /// A lockstep tick has not completed. The value is the time since the start of the tick, s.
    Waiting = 19, "waiting";
    /// A deviation from the graph for which there is no separate kind.
    Warning = 20, "warning";
    /// The run was requested to end.
    Ending = 21, "ending";
    /// The launcher does not respond; its guard monitors the graph.
    LauncherSilent = 22, "launcher_silent";
    /// The launcher responds again.
    LauncherBack = 23, "launcher_back";
    /// The launcher has ended. Its guard brings the robot to its safe state and ends the run.
    LauncherEnded = 24, "launcher_ended";
    /// The guard has brought the robot to its safe state, except for actuators whose process had already
    /// ended.
    GuardActed = 25, "guard_acted";
    /// An episode of real time began, without a reset. The value is the index of the episode.
    EpisodeBegan = 26, "episode_began";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_have_unique_numbers_and_json_names() {
        for kind in EventKind::ALL {
            assert_eq!(EventKind::from_number(*kind as u32), Some(*kind));
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
            assert_eq!(EventKind::ALL.iter().filter(|other| other.name() == kind.name()).count(), 1);
        }
        assert_eq!(EventKind::from_number(0), None);
    }

    #[test]
    fn severities_rise_and_are_named_as_in_json() {
        assert!(EventSeverity::ALL.is_sorted());
        for severity in EventSeverity::ALL {
            assert_eq!(serde_json::to_value(severity).unwrap(), severity.name());
        }
    }
}
