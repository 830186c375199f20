//! The file of a run: the machine, every raw histogram, and the table of targets.

use serde::{Deserialize, Serialize};

use super::{Measurement, Target};
use crate::host::Machine;

/// Version of the file's format; raised when a field changes its meaning or goes.
pub const VERSION: u32 = 1;

/// What is written to the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Written {
    /// Version of this format.
    pub version: u32,
    /// What it was measured on.
    pub machine: Machine,
    /// What kept the machine busy where a name ends in `.loaded`, with its options.
    #[serde(default)]
    pub load: String,
    /// How long it took in all, s.
    #[serde(default)]
    pub seconds: f64,
    /// What was denied, in words; empty if everything ran at real-time priority on its own core.
    pub denied: Vec<String>,
    /// Every measurement with its raw histogram.
    pub measurements: Vec<Measurement>,
    /// What could not be measured, and why.
    pub skipped: Vec<Skipped>,
    /// The table of targets.
    pub targets: Vec<Target>,
}

/// Something that was not measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skipped {
    /// Its name.
    pub name: String,
    /// Why.
    pub reason: String,
}
