//! The drive table: which drive moves which joint, on which bus, by which protocol, with which settings.

use core::ops::Range as Span;

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::bus::bits::Rates;
use crate::bus::budget::{Budget, Shape};
use crate::frame::{Form, Id};
use crate::{Range, mit};

/// A drive table, as its TOML file has it.
///
/// ```
/// use motorium_can::Table;
///
/// let text = r#"
/// [[bus]]
/// name    = "can0"
/// bitrate = 1_000_000
///
/// [[drive]]
/// joint    = "elbow"
/// bus      = "can0"
/// protocol = "mini_cheetah"
/// node     = 1
/// watchdog = "20 ms"
/// ranges   = { position = 12.5, velocity = 65.0, torque = 18.0 }
/// "#;
/// let table = Table::parse(text)?;
/// assert_eq!(table.drives[0].joint, "elbow");
/// # Ok::<(), motorium_can::TableError>(())
/// ```
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// The buses.
    #[serde(rename = "bus")]
    pub buses: Vec<BusEntry>,
    /// The drives.
    #[serde(rename = "drive")]
    pub drives: Vec<DriveEntry>,
}

/// A bus of a drive table.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusEntry {
    /// Its name.
    pub name: String,
    /// The network interface of the computer that it is, such as "can0" or "vcan0", or the serial line of an slcan adapter, such
    /// as "/dev/ttyACM0". Without one it is simulated.
    pub interface: Option<String>,
    /// Bits per second of arbitration, and of whole classic frames.
    pub bitrate: u32,
    /// Bits per second of the data of CAN FD frames; without it the bus is a classic one.
    pub data_bitrate: Option<u32>,
    /// Longest time from a command to the beginning of its answer. Default 100 us.
    #[serde(default = "turn_round")]
    pub turn_round: TimeSpan,
}

fn turn_round() -> TimeSpan {
    TimeSpan { ns: 100_000 }
}

/// A drive of a drive table.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveEntry {
    /// The joint that it moves.
    pub joint: String,
    /// The bus that it is on.
    pub bus: String,
    /// Its protocol.
    pub protocol: Protocol,
    /// Its number on the bus.
    pub node: u8,
    /// The identifier of its answers. Default: 0; of a Damiao drive the node and 0x10.
    pub master: Option<u16>,
    /// The ranges of its fields.
    pub ranges: RangeEntry,
    /// Time without a command after which the drive lets go by itself; "0 s" for never.
    pub watchdog: TimeSpan,
    /// Angle of the drive's output shaft per joint position (rad/rad or rad/m). Default 1.
    #[serde(default = "one")]
    pub ratio: f64,
    /// The drive turns the other way round. Default false.
    #[serde(default)]
    pub reversed: bool,
    /// Joint position where the drive says zero (rad or m). Default 0.
    #[serde(default)]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

/// The ranges of a drive's fields, in the units of its output shaft.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RangeEntry {
    /// Largest position, rad.
    pub position: f64,
    /// Largest velocity, rad/s.
    pub velocity: f64,
    /// Largest torque, N m.
    pub torque: f64,
    /// Largest position gain, N m/rad. Default 500.
    pub kp: Option<f64>,
    /// Largest velocity gain, N m s/rad. Default 5.
    pub kd: Option<f64>,
}

impl RangeEntry {
    fn ranges(&self) -> mit::Ranges {
        let gains = (self.kp.unwrap_or(500.0), self.kd.unwrap_or(5.0));
        mit::Ranges::new(self.position, self.velocity, self.torque).with_gains(gains.0, gains.1)
    }
}

/// The protocol of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// The MIT protocol with answers of six bytes.
    MiniCheetah,
    /// The same with answers of eight bytes, with the supply voltage.
    MiniCheetahVoltage,
    /// The MIT protocol of CubeMars.
    Cubemars,
    /// The MIT protocol of Damiao, whose registers tell ranges and watchdog.
    Damiao,
    /// The MIT protocol of RobStride.
    Robstride,
}

impl Protocol {
    fn reply(self) -> mit::Reply {
        match self {
            Self::MiniCheetah => mit::Reply::MiniCheetah,
            Self::MiniCheetahVoltage => mit::Reply::MiniCheetahVoltage,
            Self::Cubemars => mit::Reply::CubeMars,
            Self::Damiao => mit::Reply::Damiao,
            Self::Robstride => mit::Reply::RobStride,
        }
    }
}

/// A drive table that cannot be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}", .line.map_or_else(String::new, |line| format!("line {line}: ")))]
pub struct TableError {
    /// The line of the file, from 1, if one can be named.
    pub line: Option<usize>,
    /// The entry at fault: `bus` or `drive`, and its index.
    pub entry: Option<(&'static str, usize)>,
    /// The value found, and the values expected.
    pub message: String,
    /// Advice on how to mend it.
    pub advice: &'static str,
}

/// From a joint to its drive and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Angle of the drive per joint position, signed (rad/rad or rad/m).
    pub ratio: f64,
    /// Joint position where the drive says zero (rad or m).
    pub offset: f64,
}

impl Transmission {
    /// The drive's position for that of the joint.
    pub fn to_drive(&self, joint: f64) -> f64 {
        (joint - self.offset) * self.ratio
    }

    /// The joint's position for that of the drive.
    pub fn to_joint(&self, drive: f64) -> f64 {
        drive / self.ratio + self.offset
    }
}

impl Table {
    /// Reads a table and checks it by itself.
    ///
    /// # Errors
    /// It is no such table, or a value in it cannot be.
    pub fn parse(text: &str) -> Result<Self, TableError> {
        let line = |span: Option<Span<usize>>| {
            span.map(|span| 1 + text[..span.start.min(text.len())].matches('\n').count())
        };
        let table: Self = toml::from_str(text).map_err(|error| TableError {
            line: line(error.span()),
            entry: None,
            message: error.message().to_string(),
            advice: "the keys of a drive table stand in the page of `can.adapter`",
        })?;
        table.check().map_err(|error| {
            let line = error.entry.and_then(|(entry, index)| nth_line(text, &format!("[[{entry}]]"), index));
            TableError { line, ..error }
        })?;
        Ok(table)
    }

    /// Checks a table by itself.
    ///
    /// # Errors
    /// A value in it cannot be.
    pub fn check(&self) -> Result<(), TableError> {
        let named = |(entry, message, advice)| TableError { line: None, entry, message, advice };
        self.check_entries().map_err(named)
    }

    fn check_entries(&self) -> Result<(), Fault> {
        for (index, bus) in self.buses.iter().enumerate() {
            let at = Some(("bus", index));
            let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
            if bus.name.is_empty() || !bus.name.chars().all(is_plain) {
                let message = format!("a bus named {:?}", bus.name);
                return Err((
                    at,
                    message,
                    "name it by letters, digits, `_` and `-`: its ports are named after it",
                ));
            }
            if !(10_000..=1_000_000).contains(&bus.bitrate) {
                let message = format!("bus `{}`: a bitrate of {}", bus.name, bus.bitrate);
                return Err((at, message, "write bits per second, 10000 to 1000000"));
            }
            if bus.data_bitrate.is_some_and(|fast| fast < bus.bitrate || fast > 8_000_000) {
                let message = format!("bus `{}`: a bitrate of data below the other, or too high", bus.name);
                return Err((at, message, "write bits per second, from `bitrate` to 8000000"));
            }
            if let Some(interface) = &bus.interface
                && (interface.is_empty() || (interface.len() > 15 && !interface.starts_with('/')))
            {
                let message = format!("bus `{}`: an interface named {interface:?}", bus.name);
                return Err((
                    at,
                    message,
                    "name one as `ip link` does: 1 to 15 letters; or a serial line: `/dev/ttyACM0`",
                ));
            }
            let before = &self.buses[..index];
            if before.iter().any(|other| bus.interface.is_some() && other.interface == bus.interface) {
                let message = format!("bus `{}`: another bus has its interface", bus.name);
                return Err((at, message, "a bus has one interface of its own"));
            }
            if before.first().is_some_and(|first| first.interface.is_some() != bus.interface.is_some()) {
                let message = format!("bus `{}`: simulated buses and real ones in one table", bus.name);
                return Err((at, message, "give all of them an `interface`, or none"));
            }
            if self.buses[..index].iter().any(|other| other.name == bus.name) {
                return Err((at, format!("bus `{}` stands there twice", bus.name), "name each bus once"));
            }
        }
        for (index, drive) in self.drives.iter().enumerate() {
            let at = Some(("drive", index));
            let refuse =
                |message: String, advice| Err((at, format!("drive of `{}`: {message}", drive.joint), advice));
            let before = &self.drives[..index];
            if self.bus_of(drive).is_none() {
                return refuse(format!("no bus is named `{}`", drive.bus), "add a `[[bus]]` of that name");
            }
            if before.iter().any(|other| other.joint == drive.joint) {
                return refuse("another drive moves that joint".into(), "name each joint once");
            }
            if drive.node == 0 || (drive.protocol == Protocol::Damiao && drive.node > 0xf) {
                let message = format!("node {}", drive.node);
                return refuse(message, "nodes are numbered from 1; those of Damiao drives end at 15");
            }
            let mine = self.drive(index);
            let twice = (0..index).any(|other| {
                let same_bus = before[other].bus == drive.bus;
                same_bus && (before[other].node == drive.node)
            });
            if twice {
                return refuse(
                    format!("node {} stands on that bus twice", drive.node),
                    "give each its own number",
                );
            }
            if mine.reply_id == mine.id() || matches!(mine.reply_id, Id::Standard(id) if id > 0x7fe) {
                return refuse("the identifier of its answers is taken".into(), "choose another `master`");
            }
            let ranges = mine.ranges;
            let valid = [ranges.position, ranges.velocity, ranges.torque, ranges.kp, ranges.kd];
            if !valid.iter().all(Range::is_valid) {
                return refuse(
                    "a range that is not positive".into(),
                    "write the largest value of each field",
                );
            }
            let gains = drive.ranges.kp.is_some() || drive.ranges.kd.is_some();
            if gains && matches!(drive.protocol, Protocol::Damiao) {
                let advice = "leave `kp` and `kd` out, and let `ratio` scale them";
                return refuse("the gains of a Damiao drive end at 500 and 5".into(), advice);
            }
            if !(drive.ratio.is_finite() && drive.ratio > 0.0 && drive.offset.is_finite()) {
                let advice =
                    "write a positive ratio, and `reversed = true` for a drive that turns the other way";
                return refuse(format!("a ratio of {}, an offset of {}", drive.ratio, drive.offset), advice);
            }
        }
        if self.drives.is_empty() {
            return Err((None, "there is no drive".into(), "add a `[[drive]]` for each joint"));
        }
        Ok(())
    }

    /// True if its buses are interfaces of the computer.
    pub fn is_real(&self) -> bool {
        self.buses.iter().any(|bus| bus.interface.is_some())
    }

    /// The index of a drive's bus.
    pub fn bus_of(&self, drive: &DriveEntry) -> Option<usize> {
        self.buses.iter().position(|bus| bus.name == drive.bus)
    }

    /// The codec of a drive.
    pub fn drive(&self, index: usize) -> mit::Drive {
        let entry = &self.drives[index];
        let usual = if entry.protocol == Protocol::Damiao { 0x10 | u16::from(entry.node) } else { 0 };
        mit::Drive {
            node: entry.node,
            reply_id: Id::Standard(entry.master.unwrap_or(usual)),
            reply: entry.protocol.reply(),
            ranges: entry.ranges.ranges(),
            form: self.form(entry),
        }
    }

    fn form(&self, drive: &DriveEntry) -> Form {
        let fast = self.bus_of(drive).and_then(|bus| self.buses[bus].data_bitrate);
        if fast.is_some() { Form::FdFast } else { Form::Classic }
    }

    /// The gear between a joint and its drive.
    pub fn transmission(&self, index: usize) -> Transmission {
        let entry = &self.drives[index];
        let sign = if entry.reversed { -1.0 } else { 1.0 };
        Transmission { ratio: sign * entry.ratio, offset: entry.offset }
    }

    /// The rates of a bus.
    pub fn rates(&self, bus: usize) -> Rates {
        let entry = &self.buses[bus];
        Rates { nominal: entry.bitrate, fast: entry.data_bitrate.unwrap_or(entry.bitrate) }
    }

    /// The budget of one cycle on a bus.
    pub fn budget(&self, bus: usize, cycle_ns: u64) -> Budget {
        let drives = self.drives.iter().enumerate().filter(|(_, drive)| self.bus_of(drive) == Some(bus));
        let exchange = |(index, drive): (usize, &DriveEntry)| {
            let command = Shape { extended: false, form: self.form(drive), bytes: 8 };
            (command, Shape { bytes: self.drive(index).reply.length(), ..command })
        };
        Budget {
            rates: self.rates(bus),
            exchanges: drives.map(exchange).collect(),
            turn_round_ns: self.buses[bus].turn_round.ns,
            cycle_ns,
        }
    }

    /// The index of each joint's drive, in this order of the joints.
    ///
    /// # Errors
    /// A joint has no drive, or a drive moves no such joint.
    pub fn of_joints(&self, joints: &[String]) -> Result<Vec<usize>, TableError> {
        let refuse = |message, advice| TableError { line: None, entry: None, message, advice };
        if let Some(stray) = self.drives.iter().find(|drive| !joints.contains(&drive.joint)) {
            let message = format!("the robot has no joint `{}`; it has {}", stray.joint, joints.join(", "));
            return Err(refuse(message, "name the joints as the robot's model does"));
        }
        joints
            .iter()
            .map(|joint| {
                let found = self.drives.iter().position(|drive| drive.joint == *joint);
                found.ok_or_else(|| {
                    refuse(format!("joint `{joint}` has no drive"), "add a `[[drive]]` for it")
                })
            })
            .collect()
    }
}

/// A mistake: the table and its index, what was found, what to try.
type Fault = (Option<(&'static str, usize)>, String, &'static str);

/// The line of the `index`-th header.
fn nth_line(text: &str, header: &str, index: usize) -> Option<usize> {
    text.lines()
        .enumerate()
        .filter(|(_, line)| line.trim().starts_with(header))
        .nth(index)
        .map(|(line, _)| line + 1)
}
