//! The configuration of `can.adapter`, its checks, and the state that it publishes of its drives.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use motorium::declare::{ConfigError, Declare};
use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use super::order::StepOrder;
use crate::component::{Equipped, Source, homing_load};
use crate::{Budget, BusEntry, DriveEntry, Table};

motorium::state_buffer! {
    /// The drives of a robot, in the order of its joints.
    ///
    /// ```
    /// use motorium_can::JointHealth;
    ///
    /// let health = JointHealth::default();
    /// assert_eq!(health.flags[0] & JointHealth::LOST, 0);
    /// ```
    pub struct JointHealth as "motorium.can.JointHealth" {
        /// Number of the joints.
        pub count: u32,
        /// 1 once the adapter has tripped, until it is resumed.
        pub tripped: u32,
        /// Cycles since the newest answer of each drive.
        pub age: [u32; 64],
        /// Flags of each drive: the constants of this type.
        pub flags: [u32; 64],
        /// Temperature of each drive, degrees Celsius; 0 if it does not tell.
        pub temperature: [f64; 64],
    }
}

impl JointHealth {
    /// It follows commands.
    pub const ENABLED: u32 = 1;
    /// It did not answer in this cycle.
    pub const MISSING: u32 = 2;
    /// It did not answer for three cycles.
    pub const LOST: u32 = 4;
    /// It reported a fault.
    pub const FAULT: u32 = 8;
    /// Its settings are still being read.
    pub const CHECKING: u32 = 16;
    /// Its joint is being homed.
    pub const HOMING: u32 = 32;
    /// Its position is not that of the joint: it has to be homed first.
    pub const NOT_HOMED: u32 = 64;
}

/// Behaviour of the other drives when one is lost or reports a fault.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhenTripped {
    /// They brake softly, with the velocity gain of the safe states.
    #[default]
    Damp,
    /// They let go.
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
    /// The drive table: a TOML file, relative to the graph file. Instead of `bus` and `drive`.
    pub drives: Option<String>,
    /// The buses, where no file has them.
    #[serde(default)]
    pub bus: Vec<BusEntry>,
    /// The drives, where no file has them.
    #[serde(default)]
    pub drive: Vec<DriveEntry>,
    /// Interfaces of buses, by the names of the buses, instead of those of the drive table: so one table
    /// serves on simulated buses and on real ones. Default none.
    #[serde(default)]
    pub interfaces: BTreeMap<String, String>,
    /// Reaction of the other drives when one is lost or reports a fault, until `motorium resume`: "damp" or
    /// "disable". Default "damp".
    #[serde(default)]
    pub when_tripped: WhenTripped,
    /// True: drives whose watchdog is off are enabled, too. They go on by themselves when nobody commands
    /// them any more. Default false.
    #[serde(default)]
    pub allow_no_watchdog: bool,
    /// True: no drive is enabled, and the joints are moved by hand and measured, as those of a leader arm.
    /// The adapter is no actuator then: it has no input `joint_command`, and no safe state. Drives with a
    /// `homing` are refused, as it needs torque. Default false.
    #[serde(default)]
    pub observe: bool,
    /// Distance beyond the limits of a joint (rad or m) at which its drive is still enabled. A reading
    /// farther out refuses all drives: a drive a turn away would be driven into its stop. At least 0. Default
    /// 0.05 of a joint that turns, 0.005 of one that slides.
    pub enable_margin: Option<f64>,
    /// True: drives stay enabled at the end of a run, until their watchdogs let go. By default they are let
    /// go after `settle`, in the last act of an orderly end, and a joint without a holding brake sinks from
    /// there. Default false.
    #[serde(default)]
    pub leave_enabled: bool,
    /// Longest time for which a step waits for the answers of drives on real buses. Default half a period.
    /// With `command_within` answers have until the next step, and are waited for only on serial lines.
    pub answer_within: Option<TimeSpan>,
    /// Longest time for which a step waits for the command that is made of the state it has just published,
    /// so that its frames go out at once. In lockstep no step waits. Default none: the command is sent in the
    /// next cycle.
    pub command_within: Option<TimeSpan>,
    /// Acceleration of free fall in the world (m/s2), from which the safe states compute what holds the
    /// robot. Default: that of the graph's `[world]`, or 9.81 downwards.
    #[serde(default = "gravity")]
    pub gravity: [f64; 3],
}

impl CanAdapterConfig {
    /// Time that answers on real buses have in a cycle of this length, from the batch to the place where they
    /// are read; `None` where all buses are simulated over topics.
    pub fn answers_have(&self, table: &Table, cycle: Duration) -> Option<Duration> {
        let order = StepOrder::of(self, table, table.is_real(), Some(cycle)).ok()?;
        table.is_real().then(|| order.answers_have(cycle))
    }

    /// The drive table: that of the file, which is relative to `folder`, or of the configuration itself.
    ///
    /// # Errors
    /// It cannot be read, or a value in it cannot be.
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

/// Refuses what an adapter that only listens cannot do.
pub(super) fn check_observer(config: &CanAdapterConfig, equipped: &Equipped) -> Result<(), ConfigError> {
    if !config.observe {
        return Ok(());
    }
    if let Some(drive) = equipped.table.drives.iter().find(|drive| drive.is_homed()) {
        let message = format!("the drive of `{}` has to be homed, which needs torque", drive.joint);
        return Err(ConfigError::key("observe", message).advise(
            "leave `homing` out, and write the `offset` from which its position counts, or let the adapter enable it",
        ));
    }
    if config.command_within.is_some() {
        return Err(ConfigError::key("command_within", "with `observe` there are no commands to wait for")
            .advise("leave it out"));
    }
    if config.leave_enabled {
        return Err(
            ConfigError::key("leave_enabled", "with `observe` no drive is enabled").advise("leave it out")
        );
    }
    Ok(())
}

/// Refuses drives whose watchdog is off, or acts between two commands; warns of one that a single lost
/// command sets off. Drives that are never enabled need none.
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
            "set one in the drive and in the table: without it the drive goes on when nobody commands it any more",
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
        "the drive of `{}` lets go after {:?} without a command, and one is sent each {period:?}",
        drive.joint,
        watchdog(drive)
    );
    let advice = "write three periods or more in the drive and in the table, or raise the rate";
    if watchdog(drive) <= period {
        return Err(ConfigError::key("drives", message).advise(advice));
    }
    if watchdog(drive) < 2 * period {
        declare
            .warn(format!("{message}: a single one that is lost makes it let go"))
            .at("drives")
            .advise(advice);
    }
    Ok(())
}

/// Refuses homings that fail at the stop, or may meet it too hard, and warns of those that may not succeed.
pub(super) fn check_homing_loads(
    config: &CanAdapterConfig,
    equipped: &Equipped,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    for unfit in homing_load::unfit(equipped, config.gravity) {
        let message = format!("the homing of `{}`: {}", unfit.joint, unfit.message);
        if unfit.is_refused {
            return Err(ConfigError::key("drives", message).advise(unfit.advice));
        }
        declare.warn(message).at("drives").advise(unfit.advice);
    }
    Ok(())
}

/// Refuses a bus whose frames do not fit into a cycle, and warns of one whose answers may come too late for
/// this order of a step.
pub(super) fn check_budget(
    bus: &str,
    budget: &Budget,
    order: &StepOrder,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    if !budget.fits() {
        let message = format!("{} drives do not fit on bus `{bus}`: {budget}", budget.exchanges.len());
        let advice = format!(
            "at most {} such drives fit: spread them over more buses, or lower the rate",
            budget.most()
        );
        return Err(ConfigError::key("drives", message).advise(advice));
    }
    let within = order.answers_have(Duration::from_nanos(budget.cycle_ns));
    if (within.as_nanos() as u64) < budget.complete_ns() {
        let message =
            format!("answers on bus `{bus}` are waited for {within:?}, and may take longer: {budget}");
        let advice = "wait longer, raise the bitrate, or lower the rate";
        let key = if order.answer_within.is_some() { "answer_within" } else { "command_within" };
        declare.warn(message).at(key).advise(advice);
    }
    if budget.share() > Budget::COMFORTABLE {
        let warning = declare.warn(format!("bus `{bus}` is nearly full: {budget}"));
        warning
            .at("drives")
            .advise("a single disturbed frame makes others miss their cycle: stay below 80 %");
    }
    Ok(())
}
