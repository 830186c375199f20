//! Connections between parts in addition to the joints of robots.

pub use motorium_worlds::{Connection, ConnectionKind};

/// The connection cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConnectError {
    /// The engine does not support connections.
    #[error(
        "the {engine} engine does not support connections in addition to the joints of robots; use `physics.articulated` (`ArticulatedSimulator`)"
    )]
    Unable {
        /// Name of the engine.
        engine: &'static str,
    },
    /// No part has this name.
    #[error("there is no link or object \"{name}\"{}", .nearest.as_ref().map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default())]
    Unknown {
        /// The unknown name.
        name: String,
        /// The most similar known name.
        nearest: Option<String>,
    },
    /// The two parts do not move relative to each other.
    #[error(
        "\"{first}\" and \"{second}\" do not move relative to each other, so there is nothing to connect"
    )]
    Rigid {
        /// Name of one part.
        first: String,
        /// Name of the other part.
        second: String,
    },
    /// The connection point is not finite.
    #[error("`point` is {0:?}, expected finite numbers")]
    Point([f64; 3]),
}
