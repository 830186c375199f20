//! The configuration of `can.adapter`, its checks, and the state that it publishes of its drives.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use motorium::declare::{ConfigError, Declare};
use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::component::{Equipped, Source};
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
    /// Interfaces of buses, by the names of the buses, instead of those of the drive table: so one table serves on simulated buses
    /// and on real ones. Default none.
    #[serde(default)]
    pub interfaces: BTreeMap<String, String>,
    /// Reaction of the other drives when one is lost or reports a fault, until `motorium resume`: "damp" or
    /// "disable". Default "damp".
    #[serde(default)]
    pub when_tripped: WhenTripped,
    /// True: drives whose watchdog is off are enabled, too. They go on by themselves when nobody commands them any more.
    /// Default false.
    #[serde(default)]
    pub allow_no_watchdog: bool,
    /// Longest time for which a step waits for the answers of drives on real buses. Default half a period.
    pub answer_within: Option<TimeSpan>,
    /// Acceleration of free fall in the world (m/s2), from which the safe states compute what holds the robot. Default: that of
    /// the graph's `[world]`, or 9.81 downwards.
    #[serde(default = "gravity")]
    pub gravity: [f64; 3],
}

impl CanAdapterConfig {
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

/// Longest time for which a step waits for answers.
pub(super) fn answer_within(
    config: &CanAdapterConfig,
    period: Option<Duration>,
) -> Result<Duration, ConfigError> {
    let within = config.answer_within.map(Duration::from);
    let Some(period) = period else { return Ok(within.unwrap_or_default()) };
    match within {
        Some(within) if within.is_zero() || within >= period => {
            let message = format!("answers within {within:?} of a period of {period:?}");
            let advice = "leave time for the commands of the next period: write about half a period";
            Err(ConfigError::key("answer_within", message).advise(advice))
        }
        _ => Ok(within.unwrap_or(period / 2)),
    }
}

pub(super) fn check_watchdogs(config: &CanAdapterConfig, equipped: &Equipped) -> Result<(), ConfigError> {
    let off = equipped.table.drives.iter().find(|drive| drive.watchdog.ns == 0);
    match off {
        Some(drive) if !config.allow_no_watchdog => {
            let message = format!("the watchdog of the drive of `{}` is off", drive.joint);
            Err(ConfigError::key("drives", message).advise(
                "set one in the drive and in the table: without it the drive goes on when nobody commands it any more",
            ))
        }
        _ => Ok(()),
    }
}

/// Refuses a bus whose frames do not fit into a cycle; `within` is the time for which the answers of a real one are awaited.
pub(super) fn check_budget(
    bus: &str,
    budget: &Budget,
    within: Option<Duration>,
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
    if let Some(within) = within
        && (within.as_nanos() as u64) < budget.complete_ns()
    {
        let message =
            format!("answers on bus `{bus}` are waited for {within:?}, and may take longer: {budget}");
        let advice = "wait longer, raise the bitrate, or lower the rate";
        declare.warn(message).at("answer_within").advise(advice);
    }
    if budget.share() > Budget::COMFORTABLE {
        let warning = declare.warn(format!("bus `{bus}` is nearly full: {budget}"));
        warning
            .at("drives")
            .advise("a single disturbed frame makes others miss their cycle: stay below 80 %");
    }
    Ok(())
}
