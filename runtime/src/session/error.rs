//! Errors of a session.

use crate::launcher::{Exit, LaunchError};
use crate::os::OtherProcess;
use crate::parameter::ParameterError;
use crate::transport::PortError;

/// Error of driving a run.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The graph did not start; nothing is left behind.
    #[error(transparent)]
    Launch(#[from] LaunchError),
    /// The run has ended: it received a signal, or a component failed and the actuators entered their safe
    /// state. The only remaining operation is to stop the session.
    #[error("the run has ended: {}", describe(.0))]
    Ended(Exit),
    /// The session belongs to the process that this one was forked from.
    #[error("the session: {0}")]
    OtherProcess(#[from] OtherProcess),
    /// Only simulated time can be paused, reset or sped up.
    #[error("{what}: the run is in real time; launch it with the clock `lockstep`")]
    RealTime {
        /// The requested value.
        what: &'static str,
    },
    /// In lockstep an episode requires a reset of simulated time.
    #[error("{what}: the run is in lockstep; use `Session::reset`")]
    SimulatedTime {
        /// The operation.
        what: &'static str,
    },
    /// A component begins the episodes of the run.
    #[error(
        "component `{component}` begins the episodes of this graph; remove its `begins_episodes` to begin them from here"
    )]
    EpisodeDriver {
        /// The component.
        component: String,
    },
    /// A component cannot be reset for a new episode.
    #[error(
        "component `{component}` cannot be reset: {advice}",
        advice = "its kind does not implement `Component::reset`"
    )]
    NoReset {
        /// The component.
        component: String,
    },
    /// The factor of time is not above zero, or not finite.
    #[error("simulated time cannot run at {0} times real time; expected a factor above 0")]
    Pace(f64),
    /// The graph has no such topic.
    #[error("the graph has no topic `{topic}`; {advice}")]
    NoTopic {
        /// The requested topic.
        topic: String,
        /// The most similar topic, or all topics.
        advice: String,
    },
    /// Another component writes the topic.
    #[error(
        "topic `{topic}` is written by component `{writer}`; to write it launch with \
         `Options::standing_in_for(\"{writer}\")`"
    )]
    NotOurs {
        /// The topic.
        topic: String,
        /// Its writer.
        writer: String,
    },
    /// The topic cannot be read or written this way, or a number of the value is not finite.
    #[error("topic `{topic}`: {reason}")]
    Topic {
        /// The topic.
        topic: String,
        /// The reason.
        reason: String,
    },
    /// A port could not be opened.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A parameter could not be set.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

fn describe(exit: &Exit) -> String {
    match exit {
        Exit::Finished => "all its components have".to_string(),
        Exit::Interrupted => "requested by a signal".to_string(),
        Exit::SafeStop { reason } => format!("safe stop: {reason}"),
    }
}
