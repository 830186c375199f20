//! Scripted faults of simulated drives and buses.

use motorium::declare::ConfigError;
use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::{BusKind, HomingBy, Table};

/// One fault of the script.
///
/// ```toml
/// faults = [
///     { at = "2 s", lasts = "50 ms", kind = "silent", joint = "panda_joint4" },
///     { at = "5 s", lasts = "1 s", kind = "late", delay = "1.2 ms", joint = "panda_joint2" },
///     { at = "8 s", lasts = "10 ms", kind = "babbling", bus = "can0" },
/// ]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FaultConfig {
    /// Start time.
    pub at: TimeSpan,
    /// Duration. Default: until the end of the run.
    pub lasts: Option<TimeSpan>,
    /// Kind of the fault.
    pub kind: FaultKind,
    /// The joint of the affected drive, for the kinds "silent", "late", "wrong_length", "corrupt",
    /// "duplicate", "twin", "off", "no_mark", "stuck_mark".
    pub joint: Option<String>,
    /// The affected bus, for the kinds "babbling", "disturbed", "bus_off", "alone", "down".
    pub bus: Option<String>,
    /// Additional delay of a late answer. Default 1 ms.
    pub delay: Option<TimeSpan>,
}

/// The kind of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// The drive does not answer; it still receives its commands.
    Silent,
    /// The drive delays each answer by the additional time `delay`.
    Late,
    /// The drive's answers lack their last byte.
    WrongLength,
    /// The drive's answers name an unknown state or device.
    Corrupt,
    /// The drive sends each answer twice.
    Duplicate,
    /// A second drive with the same number answers in addition to the drive, and reports a different
    /// position.
    Twin,
    /// The drive has no power: it receives nothing, answers nothing and is disabled.
    Off,
    /// The drive never finds its mark, such as a switch, when it homes itself.
    NoMark,
    /// The drive detects its mark at every position.
    StuckMark,
    /// A node floods the bus with frames that win arbitration against all others.
    Babbling,
    /// Every frame on the bus is disturbed once.
    Disturbed,
    /// The controller of the adapter is bus-off, and recovers at the end of the fault.
    BusOff,
    /// The cable between the adapter and the drives is unplugged: frames of the adapter are not acknowledged.
    /// Only on simulated buses.
    Alone,
    /// The interface of the adapter is down. Only on simulated buses.
    Down,
}

impl FaultKind {
    /// Returns `true` for a bus fault, `false` for a drive fault.
    fn is_of_bus(self) -> bool {
        matches!(self, Self::Babbling | Self::Disturbed | Self::BusOff | Self::Alone | Self::Down)
    }
}

/// Fault with its target.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fault {
    pub(super) kind: FaultKind,
    /// Index of the drive in the table, or of the bus.
    pub(super) target: usize,
    pub(super) delay_ns: u64,
    from_ns: u64,
    until_ns: u64,
}

impl Fault {
    /// Parses one scripted fault.
    pub(super) fn from_config(
        config: &FaultConfig,
        index: usize,
        table: &Table,
    ) -> Result<Self, ConfigError> {
        let of_bus = config.kind.is_of_bus();
        let refuse = |key: &str, message: String| {
            Err(ConfigError::key(format!("faults[{index}].{key}"), message)
                .advise("faults of drives need `joint`, faults of buses `bus`, as named in the drive table"))
        };
        let (key, name, other) =
            if of_bus { ("bus", &config.bus, &config.joint) } else { ("joint", &config.joint, &config.bus) };
        if other.is_some() {
            return refuse(if of_bus { "joint" } else { "bus" }, format!("the fault affects a {key}"));
        }
        let Some(name) = name else { return refuse("kind", format!("the {key} is missing")) };
        let found = if of_bus {
            table.buses.iter().position(|bus| bus.name == *name)
        } else {
            table.drives.iter().position(|drive| drive.joint == *name)
        };
        let Some(target) = found else { return refuse(key, format!("the drive table has no `{name}`")) };
        let bus = if of_bus { Some(target) } else { table.bus_of(&table.drives[target]) };
        let needs_can = matches!(
            config.kind,
            FaultKind::Babbling | FaultKind::Disturbed | FaultKind::BusOff | FaultKind::Twin
        );
        if needs_can && bus.is_some_and(|bus| table.buses[bus].kind == BusKind::Serial) {
            return refuse(
                "kind",
                "this kind of fault is only for CAN buses, but the bus is a serial line".to_string(),
            );
        }
        let is_of_mark = matches!(config.kind, FaultKind::NoMark | FaultKind::StuckMark);
        let homing = table.drives.get(target).and_then(|drive| drive.homing.as_ref());
        if is_of_mark && homing.is_none_or(|homing| homing.by != HomingBy::Drive) {
            return refuse("kind", format!("the drive of `{name}` does not home itself"));
        }
        if config.delay.is_some() && config.kind != FaultKind::Late {
            return refuse("delay", "only the kind \"late\" has a delay".to_string());
        }
        let from_ns = config.at.ns;
        let until_ns = config.lasts.map_or(u64::MAX, |lasts| from_ns.saturating_add(lasts.ns));
        let delay_ns = config.delay.map_or(1_000_000, |delay| delay.ns);
        Ok(Self { kind: config.kind, target, delay_ns, from_ns, until_ns })
    }

    pub(super) fn is_on(&self, now_ns: u64) -> bool {
        (self.from_ns..self.until_ns).contains(&now_ns)
    }

    /// Returns `true` while the fault affects this drive or bus.
    pub(super) fn befalls(&self, kind: FaultKind, target: usize, now_ns: u64) -> bool {
        self.kind == kind && self.target == target && self.is_on(now_ns)
    }
}
