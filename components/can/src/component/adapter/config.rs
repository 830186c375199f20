//! Configuration of `can.adapter`, its checks, and the published state of its drives.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use motorium::declare::{ConfigError, Declare};
use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::component::{Equipped, Source, homing_load};
use crate::{BusEntry, DriveEntry, Table};

motorium::state_buffer! {
    /// Health of the drives of a robot, in the order of its joints.
    ///
    /// ```
    /// use motorium_can::JointHealth;
    ///
    /// let health = JointHealth::default();
    /// assert_eq!(health.flags[0] & JointHealth::LOST, 0);
    /// ```
    pub struct JointHealth as "motorium.can.JointHealth" {
        /// Number of joints.
        pub count: u32,
        /// 1 from a trip of the adapter until it is resumed.
        pub tripped: u32,
        /// Cycles since the newest answer of each drive.
        pub age: [u32; 64],
        /// Flags of each drive: the constants of this type.
        pub flags: [u32; 64],
        /// Temperature of each drive, degrees Celsius; 0 if the drive does not report it.
        pub temperature: [f64; 64],
    }
}

impl JointHealth {
    /// The drive follows commands.
    pub const ENABLED: u32 = 1;
    /// The drive did not answer in this cycle.
    pub const MISSING: u32 = 2;
    /// The drive did not answer for three cycles.
    pub const LOST: u32 = 4;
    /// The drive reported a fault.
    pub const FAULT: u32 = 8;
    /// The settings of the drive are still being read.
    pub const CHECKING: u32 = 16;
    /// The joint is being homed.
    pub const HOMING: u32 = 32;
    /// The joint's position is unknown: it must be homed first.
    pub const NOT_HOMED: u32 = 64;
}

/// Behaviour of the remaining drives when a drive is lost or reports a fault.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhenTripped {
    /// The drives brake softly, with the velocity gain of the safe states.
    #[default]
    Damp,
    /// The drives are disabled.
    Disable,
}

/// The `config` table of `can.adapter`.
///
/// ```toml
/// bus   = [{ name = "can0", bitrate = 1_000_000 }]
/// drive = [
///     { joint = "hinge", bus = "can0", protocol = "damiao", node = 1, watchdog = "20 ms", ranges = { position = 12.5, velocity = 30.0, torque = 10.0 } },
/// ]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CanAdapterConfig {
    /// Drive table: a TOML file, relative to the graph file. Replaces `bus` and `drive`.
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
    /// Reaction of the remaining drives when a drive is lost or reports a fault, until `motorium resume`:
    /// "damp" or "disable". Default "damp".
    #[serde(default)]
    pub when_tripped: WhenTripped,
    /// True: drives without a watchdog are also enabled, although they keep following their last command when
    /// commands stop. Default false.
    #[serde(default)]
    pub allow_no_watchdog: bool,
    /// True: no drive is enabled; the joints are moved by hand and measured, as with a leader arm. The
    /// adapter is then not an actuator: it has no input `joint_command` and no safe state. Drives with
    /// `homing` are refused, since homing needs torque. Default false.
    #[serde(default)]
    pub observe: bool,
    /// Distance beyond the limits of a joint (rad or m) at which its drive is still enabled. If any reading
    /// is farther out, no drive is enabled: a drive whose reading is off by a turn would drive its joint into
    /// the stop. Non-negative. Default 0.05 for a revolute joint, 0.005 for a prismatic one.
    pub enable_margin: Option<f64>,
    /// True: drives stay enabled at the end of a run until their watchdogs disable them. By default they are
    /// disabled after `settle`, as the last step of an orderly end, and a joint without a holding brake then
    /// sinks. Default false.
    #[serde(default)]
    pub leave_enabled: bool,
    /// Longest wait of a step for the answers of drives on real buses. Default half a period. If
    /// `command_within` is set, answers may arrive until the next step, and a step waits for them only on
    /// serial lines.
    pub answer_within: Option<TimeSpan>,
    /// Longest wait of a step for the command computed from the state that the step has just published. The
    /// frames of the command are then sent immediately. In lockstep no step waits. Default none: the command
    /// is sent in the next cycle.
    pub command_within: Option<TimeSpan>,
    /// Gravitational acceleration in the world (m/s2), used by the safe states to hold the robot. Default:
    /// the graph's `[world]`, or 9.81 downwards.
    #[serde(default = "gravity")]
    pub gravity: [f64; 3],
}

impl CanAdapterConfig {
    /// Loads the drive table from its file, relative to `folder`, or from the entries in the configuration.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or if a value is invalid.
    pub fn table(&self, folder: &Path) -> Result<Table, ConfigError> {
        self.source().table(folder)
    }

    pub(in crate::component) fn source(&self) -> Source<'_> {
        Source {
            file: self.drives.as_deref(),
            buses: &self.bus,
            drives: &self.drive,
            interfaces: &self.interfaces,
        }
    }
}

fn gravity() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

/// Refuses keys that an adapter in listen-only mode cannot honour.
pub(super) fn check_observer(config: &CanAdapterConfig, equipped: &Equipped) -> Result<(), ConfigError> {
    if !config.observe {
        return Ok(());
    }
    if let Some(drive) = equipped.table.drives.iter().find(|drive| drive.is_homed()) {
        let message = format!("the drive of `{}` has to be homed, which needs torque", drive.joint);
        return Err(ConfigError::key("observe", message)
            .advise("leave `homing` out, and write the `offset` of its zero, or let the adapter enable it"));
    }
    if config.command_within.is_some() {
        return Err(ConfigError::key("command_within", "with `observe`, there are no commands to wait for")
            .advise("leave it out"));
    }
    if config.leave_enabled {
        return Err(
            ConfigError::key("leave_enabled", "with `observe`, no drive is enabled").advise("leave it out")
        );
    }
    Ok(())
}

/// Refuses drives whose watchdog is off or expires between two commands. Warns of a watchdog that expires
/// after a single lost command.
pub(super) fn check_watchdogs(
    config: &CanAdapterConfig,
    equipped: &Equipped,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    if config.observe {
        return Ok(());
    }
    let drives = &equipped.table.drives;
    if let Some(drive) = drives.iter().find(|drive| drive.watchdog.ns == 0)
        && !config.allow_no_watchdog
    {
        let message = format!("the watchdog of the drive of `{}` is off", drive.joint);
        return Err(ConfigError::key("drives", message).advise(
            "set a watchdog in the drive and in the table: without a watchdog the drive continues with its last command",
        ));
    }
    let Some(period) = declare.period() else { return Ok(()) };
    let watchdog = |drive: &DriveEntry| Duration::from(drive.watchdog);
    let Some(drive) =
        drives.iter().filter(|drive| drive.watchdog.ns > 0).min_by_key(|drive| drive.watchdog.ns)
    else {
        return Ok(());
    };
    let message = format!(
        "the drive of `{}` disables itself after {:?} without a command, but commands are sent every {period:?}",
        drive.joint,
        watchdog(drive)
    );
    let advice = "write three periods or more in the drive and in the table, or raise the rate";
    if watchdog(drive) <= period {
        return Err(ConfigError::key("drives", message).advise(advice));
    }
    if watchdog(drive) < 2 * period {
        declare
            .warn(format!("{message}: a single lost command disables the drive"))
            .key("drives")
            .advise(advice);
    }
    Ok(())
}

/// Refuses homings that fail at the stop or may hit it too hard, and warns about homings that may fail.
pub(super) fn check_homing_loads(
    config: &CanAdapterConfig,
    equipped: &Equipped,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    for unfit in homing_load::unfit(equipped, config.gravity) {
        let message = format!("the homing of `{}`: {}", unfit.joint, unfit.problem);
        if unfit.is_refused {
            return Err(ConfigError::key("drives", message).advise(unfit.problem.advice()));
        }
        declare.warn(message).key("drives").advise(unfit.problem.advice());
    }
    Ok(())
}
