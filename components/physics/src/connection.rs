//! Connections of parts besides the joints of robots.

pub use motorium_robots::{Connection, ConnectionKind};

/// A connection that cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConnectError {
    /// The engine has no connections.
    #[error(
        "the {engine} engine connects nothing besides the joints of robots; use `physics.articulated` (`ArticulatedSimulator`)"
    )]
    Unable {
        /// The engine.
        engine: &'static str,
    },
    /// Nothing has this name.
    #[error("no link or object is called \"{name}\"{}", .nearest.as_ref().map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default())]
    Unknown {
        /// The name.
        name: String,
        /// The name most likely meant.
        nearest: Option<String>,
    },
    /// The two do not move relative to one another.
    #[error("\"{first}\" and \"{second}\" do not move relative to one another: there is nothing to connect")]
    Rigid {
        /// A part.
        first: String,
        /// The other.
        second: String,
    },
    /// A point that is nowhere.
    #[error("`point` is {0:?}, expected finite numbers")]
    Point([f64; 3]),
}
