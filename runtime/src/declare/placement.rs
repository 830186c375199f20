//! Placement of a component in its graph: the properties that are known before the ports are declared.

use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// The clock of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClockKind {
    /// The machine's monotonic clock. Components step at absolute times.
    #[default]
    Realtime,
    /// Simulated time, which advances as fast as the machine allows. Components step in a fixed order at each
    /// tick.
    Lockstep,
}

/// Placement of a component in its graph: the properties that are known before the ports are declared.
///
/// ```
/// use std::time::Duration;
/// use motorium::declare::{ClockKind, Declare, Placement};
///
/// let placement = Placement { period: Some(Duration::from_millis(1)), clock: ClockKind::Lockstep, ..Placement::default() };
/// let declare = Declare::new(None).placed(placement);
/// assert_eq!(declare.period(), Some(Duration::from_millis(1)));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Placement {
    /// Nominal time between two steps; `None` if it is not known yet.
    pub period: Option<Duration>,
    /// The clock of the graph. Defaults to real time.
    pub clock: ClockKind,
    /// Folder that relative paths in the `config` table refer to. Defaults to the working directory.
    pub folder: PathBuf,
    /// Names of the ports in the component's `subscribe` table.
    #[serde(default)]
    pub subscribed: Vec<String>,
}

impl Default for Placement {
    fn default() -> Self {
        Self { period: None, clock: ClockKind::Realtime, folder: PathBuf::from("."), subscribed: Vec::new() }
    }
}
