//! Errors of a session.

use crate::launcher::{Exit, LaunchError};
use crate::os::OtherProcess;
use crate::parameter::ParameterError;
use crate::transport::PortError;

/// Error of launching or driving a run.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The graph did not start. Nothing is left in shared memory.
    #[error(transparent)]
    Launch(#[from] LaunchError),
    /// The run has ended: it received a signal, or a component failed and the actuators entered their safe
    /// state. The session can now only be stopped.
    #[error("the run has ended: {}", describe(.0))]
    Ended(Exit),
    /// The session belongs to the process from which the current process was forked.
    #[error("the session cannot be used in this process: {0}")]
    OtherProcess(#[from] OtherProcess),
    /// The operation requires simulated time, but the run is in real time.
    #[error(
        "{what} requires simulated time, but the run is in real time; launch it with the clock `lockstep`"
    )]
    RealTime {
        /// The requested operation.
        what: &'static str,
    },
    /// The operation requires real time; in lockstep an episode begins with a reset of simulated time.
    #[error("{what} requires real time, but the run is in lockstep; use `Session::reset`")]
    SimulatedTime {
        /// The requested operation.
        what: &'static str,
    },
    /// A component of the graph begins the episodes, so the session cannot begin one.
    #[error(
        "component `{component}` begins the episodes of this graph; remove its `begins_episodes` to begin episodes \
         from the session"
    )]
    EpisodeDriver {
        /// Name of the component.
        component: String,
    },
    /// A component cannot be reset for a new episode.
    #[error(
        "component `{component}` cannot be reset: {advice}",
        advice = "its kind does not implement `Component::reset`"
    )]
    NoReset {
        /// Name of the component.
        component: String,
    },
    /// The pace of simulated time is not above zero, or not finite.
    #[error("the pace of simulated time is {0}, expected a finite multiple of real time above 0")]
    Pace(f64),
    /// The graph has no topic with this name.
    #[error("the graph has no topic `{topic}`; {advice}")]
    NoTopic {
        /// Name of the requested topic.
        topic: String,
        /// Suggestion: the most similar topic, or all topics.
        advice: String,
    },
    /// The session cannot publish on the topic, because a component of the graph writes it.
    #[error(
        "topic `{topic}` is written by component `{writer}`; to write it from the session, launch with \
         `Options::standing_in_for(\"{writer}\")`"
    )]
    NotOurs {
        /// Name of the topic.
        topic: String,
        /// Name of the component that writes the topic.
        writer: String,
    },
    /// The topic cannot be read or written in this way, or a number of the value is not finite.
    #[error("topic `{topic}`: {reason}")]
    Topic {
        /// Name of the topic.
        topic: String,
        /// Reason for the error.
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
