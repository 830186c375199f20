//! Configuration of `can.drive_sim`.

use std::collections::BTreeMap;

use motorium::units::TimeSpan;
use motorium_robots::ActuatorTable;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::component::Source;
use crate::component::faults::FaultConfig;
use crate::{BusEntry, DriveEntry};

/// The `config` table of `can.drive_sim`.
///
/// ```toml
/// bus   = [{ name = "can0", bitrate = 1_000_000 }]
/// drive = [
///     { joint = "hinge", bus = "can0", protocol = "damiao", node = 1, watchdog = "20 ms", ranges = { position = 12.5, velocity = 30.0, torque = 10.0 } },
/// ]
/// delay  = "60 us"
/// jitter = "20 us"
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveSimulationConfig {
    /// Drive table: the same file as for the adapter. Replaces `bus` and `drive`.
    #[schemars(extend("format" = "path"))]
    pub drives: Option<String>,
    /// The buses, if there is no drive table file.
    #[serde(default)]
    pub bus: Vec<BusEntry>,
    /// The drives, if there is no drive table file.
    #[serde(default)]
    pub drive: Vec<DriveEntry>,
    /// Interfaces of the computer for named buses. An interface given here replaces the interface in the
    /// drive table, so that one table serves both simulated and real buses. Default: an empty table.
    #[serde(default)]
    pub interfaces: BTreeMap<String, String>,
    /// Time from the last bit of a command until its answer is queued in the drive. Default 50 us.
    #[serde(default = "delay")]
    pub delay: TimeSpan,
    /// Maximum random addition to `delay`. Default none.
    #[serde(default)]
    pub jitter: TimeSpan,
    /// Fraction of the answers that are lost, 0 to 1. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub loss: f64,
    /// True: each joint has a holding brake that is open while its drive is enabled. Default true.
    #[serde(default = "yes")]
    pub brakes: bool,
    /// Stages between the drives and the joints: lag, limits, elasticity. Default: none.
    pub actuator: Option<ActuatorTable<TimeSpan>>,
    /// Stages of individual joints, by joint name. They replace the stages of `actuator`.
    #[serde(default)]
    pub actuators: BTreeMap<String, ActuatorTable<TimeSpan>>,
    /// Drives with settings that differ from the drive table.
    #[serde(default)]
    pub set: Vec<SettingConfig>,
    /// Scripted faults, each with its start time.
    #[serde(default)]
    pub faults: Vec<FaultConfig>,
}

/// Settings of a drive that differ from the drive table.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SettingConfig {
    /// Joint of the drive.
    pub joint: String,
    /// Watchdog time of the drive; "0 s" for off.
    pub watchdog: Option<TimeSpan>,
    /// Largest torque of the drive's range, N m.
    pub torque: Option<f64>,
}

impl DriveSimulationConfig {
    pub(super) fn source(&self) -> Source<'_> {
        Source {
            file: self.drives.as_deref(),
            buses: &self.bus,
            drives: &self.drive,
            interfaces: &self.interfaces,
        }
    }
}

fn delay() -> TimeSpan {
    TimeSpan { ns: 50_000 }
}

fn yes() -> bool {
    true
}
