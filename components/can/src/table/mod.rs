//! Drive table, which assigns a drive, bus, protocol and settings to each joint.

mod check;
mod current;
mod homing;
mod wire;

use core::ops::Range as Span;
use std::io;

use serde::Deserialize;
use toml::Spanned;

use crate::bus::bits::Rates;
use crate::bus::budget::{Budget, Shape};
use crate::bus::offered::Place;
use crate::drive::Ranges;
use crate::frame::Form;
use crate::mit;
use crate::protocols::entries::{BusEntry, BusKind, DriveEntry, LoopEntry};
use crate::protocols::mit_codec;
use crate::protocols::spec::DriveSetup;
use crate::servo::FAST_HEAD;
use crate::{OpenError, RealBus};

/// Drive table, as read from its TOML file.
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
    /// Line and column of the joint name of each drive, from 1; empty if the table was not parsed from a
    /// text.
    #[serde(skip)]
    pub(crate) joint_places: Vec<(usize, usize)>,
}

/// Error in a drive table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}", position_prefix(*.line, *.column))]
pub struct TableError {
    /// Line of the file, counted from 1; `None` if unknown.
    pub line: Option<usize>,
    /// Column of that line, counted from 1; `None` if unknown.
    pub column: Option<usize>,
    /// Kind of the invalid entry, `bus` or `drive`, and its index; `None` for errors of the whole table.
    pub entry: Option<(&'static str, usize)>,
    /// Description of the invalid value.
    pub message: String,
    /// Advice on how to fix the error.
    pub advice: &'static str,
}

/// Conversion between the positions of a joint and its drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Angle of the drive per joint position, signed (rad/rad or rad/m).
    pub ratio: f64,
    /// Joint position at which the drive reads zero (rad or m).
    pub offset: f64,
    /// Number of whole drive turns included in `offset`.
    pub turns: i32,
}

impl Transmission {
    /// Converts a joint position (rad or m) to a drive position (rad).
    pub fn to_drive(&self, joint: f64) -> f64 {
        (joint - self.offset) * self.ratio
    }

    /// Converts a drive position (rad) to a joint position (rad or m).
    pub fn to_joint(&self, drive: f64) -> f64 {
        drive / self.ratio + self.offset
    }
}

impl Table {
    /// Parses and checks a table.
    ///
    /// # Errors
    /// Returns an error if the text is not a drive table, or if a value is invalid.
    pub fn parse(text: &str) -> Result<Self, TableError> {
        Self::parse_with(text, |path| {
            Err(io::Error::new(
                io::ErrorKind::Unsupported,
                format!("a table that is parsed from a text cannot name the file {path}"),
            ))
        })
    }

    /// Parses and checks a table. `read` is called with the name of each file in the table, and returns its
    /// text.
    ///
    /// # Errors
    /// Returns an error if the text is not a drive table, if a value is invalid, or if a named file cannot be
    /// read.
    pub fn parse_with(text: &str, read: impl Fn(&str) -> io::Result<String>) -> Result<Self, TableError> {
        let refuse = |error: toml::de::Error| {
            let place = error.span().map(|span| place_of(text, &span));
            TableError {
                line: place.map(|(line, _)| line),
                column: place.map(|(_, column)| column),
                entry: None,
                message: error.message().to_string(),
                advice: "the page of `can.adapter` lists the keys of a drive table",
            }
        };
        let mut table: Self = toml::from_str(text).map_err(refuse)?;
        let Joints { drives } = toml::from_str(text).map_err(refuse)?;
        table.joint_places = drives.iter().map(|drive| place_of(text, &drive.joint.span())).collect();
        table.complete(read).and_then(|()| table.check()).map_err(|error| {
            let line = error.entry.and_then(|(entry, index)| nth_line(text, &format!("[[{entry}]]"), index));
            TableError { line, ..error }
        })?;
        Ok(table)
    }

    /// Fills in missing keys of the drives from their data sheets. `read` is called with the name of each
    /// data sheet, and returns its text.
    ///
    /// # Errors
    /// Returns an error if a data sheet cannot be read, or contradicts the table.
    pub fn complete(&mut self, read: impl Fn(&str) -> io::Result<String>) -> Result<(), TableError> {
        for (index, drive) in self.drives.iter_mut().enumerate() {
            drive.protocol.definition().complete(drive, &read).map_err(|(message, advice)| TableError {
                line: None,
                column: None,
                entry: Some(("drive", index)),
                message: format!("drive of `{}`: {message}", drive.joint),
                advice,
            })?;
        }
        Ok(())
    }

    /// Returns `true` if the buses are interfaces of the computer.
    pub fn is_real(&self) -> bool {
        self.buses.iter().any(|bus| bus.interface.is_some())
    }

    /// Returns `true` if the buses are simulated for other programs: `unix:NAME` and `pty:PATH`.
    pub fn is_offered(&self) -> bool {
        self.buses
            .iter()
            .filter_map(|bus| bus.interface.as_deref())
            .any(|name| Place::from_interface(name).is_some())
    }

    /// Opens the interface of the bus with index `bus`.
    ///
    /// # Errors
    /// Returns an error if the interface is missing or down, or if its bitrates differ from the table.
    pub fn open(&self, bus: usize) -> Result<RealBus, OpenError> {
        let entry = &self.buses[bus];
        let interface = entry.interface.as_deref().unwrap_or(&entry.name);
        match entry.kind {
            BusKind::Can => RealBus::open(interface, &self.rates(bus), entry.data_bitrate.is_some()),
            BusKind::Serial => RealBus::open_servos(interface, entry.bitrate),
        }
    }

    /// Returns `true` if each bus timestamps received frames independently of when they are read, as kernel
    /// interfaces and unix sockets do, but not serial lines.
    pub(crate) fn tells_times(&self) -> bool {
        self.buses.iter().filter_map(|bus| bus.interface.as_deref()).all(|name| {
            match Place::from_interface(name) {
                Some(place) => matches!(place, Place::Socket(_)),
                None => !name.starts_with('/'),
            }
        })
    }

    /// Returns `true` if one of the simulated buses is an adapter on a pseudo-terminal.
    pub(crate) fn has_adapters_on_terminals(&self) -> bool {
        let of_can = self.buses.iter().filter(|bus| bus.kind == BusKind::Can);
        of_can
            .filter_map(|bus| Place::from_interface(bus.interface.as_deref()?))
            .any(|place| matches!(place, Place::Terminal(_)))
    }

    /// Returns the index of a drive's bus; `None` if the table does not contain this bus.
    pub fn bus_of(&self, drive: &DriveEntry) -> Option<usize> {
        self.buses.iter().position(|bus| bus.name == drive.bus)
    }

    /// Returns the codec of drive `index` of the MIT family; `None` for other protocols.
    pub fn drive(&self, index: usize) -> Option<mit::Drive> {
        mit_codec(&self.setup(index))
    }

    /// Returns a drive with the properties derived from its limits and its bus.
    pub(crate) fn setup(&self, index: usize) -> DriveSetup<'_> {
        let entry = &self.drives[index];
        let bus = self.bus_of(entry).map(|bus| &self.buses[bus]);
        DriveSetup {
            entry,
            ranges: self.ranges(index),
            gains: self.position_loop(index),
            form: self.form(entry),
            fast_read: bus.is_some_and(|bus| bus.fast_read),
        }
    }

    /// Returns the ranges of the fields of drive `index` or, for a protocol without ranges, the largest
    /// values that the drive reaches. A current limit in the table reduces the torque. The gains stored in a
    /// moteus drive limit the ranges of gains.
    pub fn ranges(&self, index: usize) -> Ranges {
        self.drives[index].limited_ranges()
    }

    /// Returns the gains of drive `index`'s own position loop. By default, they apply full torque at a
    /// twentieth of a radian.
    pub fn position_loop(&self, index: usize) -> LoopEntry {
        self.drives[index].loop_gains()
    }

    fn form(&self, drive: &DriveEntry) -> Form {
        let bus = self.bus_of(drive).map(|bus| &self.buses[bus]);
        drive.protocol.spec().frames.form(bus.is_some_and(|bus| bus.data_bitrate.is_some()))
    }

    /// Returns the transmission between drive `index` and its joint.
    pub fn transmission(&self, index: usize) -> Transmission {
        let entry = &self.drives[index];
        let sign = if entry.reversed { -1.0 } else { 1.0 };
        let ratio = sign * entry.ratio;
        let offset = entry.offset + f64::from(entry.turns) * core::f64::consts::TAU / ratio;
        Transmission { ratio, offset, turns: entry.turns }
    }

    /// Returns the bitrates of the bus with index `bus`.
    pub fn rates(&self, bus: usize) -> Rates {
        let entry = &self.buses[bus];
        Rates { nominal: entry.bitrate, fast: entry.data_bitrate.unwrap_or(entry.bitrate) }
    }

    /// Returns the time budget of the bus with index `bus` for a cycle of `cycle_ns`.
    pub fn budget(&self, bus: usize, cycle_ns: u64) -> Budget {
        let entry = &self.buses[bus];
        let drives = self.drives.iter().enumerate().filter(|(_, drive)| self.bus_of(drive) == Some(bus));
        let (mut exchanges, mut others, mut shared) = (Vec::new(), Vec::new(), Vec::new());
        for (index, drive) in drives {
            let (protocol, setup) = (drive.protocol.definition(), self.setup(index));
            exchanges.push(protocol.exchange(&setup));
            others.extend(protocol.additional_frames(&setup));
            if shared.is_empty() {
                shared = protocol.bus_frames();
            }
        }
        others.extend(shared);
        let mut turn_rounds = 1;
        match (entry.kind, entry.fast_read) {
            (BusKind::Can, _) => {}
            (BusKind::Serial, true) => {
                others.push(Shape { extended: false, form: Form::Packet, bytes: FAST_HEAD });
            }
            // the servos answer in turn
            (BusKind::Serial, false) => turn_rounds = exchanges.len() as u64,
        }
        let turn_round_ns = entry.turn_round.ns * turn_rounds;
        Budget { rates: self.rates(bus), exchanges, others, turn_round_ns, cycle_ns }
    }

    /// Returns the table index of each joint's drive, in the order of `joints`.
    ///
    /// # Errors
    /// Returns an error if a joint has no drive, or if the joint of a drive is not in `joints`.
    pub fn of_joints(&self, joints: &[String]) -> Result<Vec<usize>, TableError> {
        if let Some(index) = self.drives.iter().position(|drive| !joints.contains(&drive.joint)) {
            let place = self.joint_places.get(index);
            return Err(TableError {
                line: place.map(|(line, _)| *line),
                column: place.map(|(_, column)| *column),
                entry: Some(("drive", index)),
                message: format!(
                    "the robot has no joint `{}`; its joints are {}",
                    self.drives[index].joint,
                    joints.join(", ")
                ),
                advice: "name the joints as the robot's model does",
            });
        }
        joints
            .iter()
            .map(|joint| {
                let found = self.drives.iter().position(|drive| drive.joint == *joint);
                found.ok_or_else(|| TableError {
                    line: None,
                    column: None,
                    entry: None,
                    message: format!("joint `{joint}` has no drive"),
                    advice: "add a `[[drive]]` for this joint",
                })
            })
            .collect()
    }
}

/// Joint names of a table, with their positions in its text.
#[derive(Deserialize)]
struct Joints {
    #[serde(rename = "drive")]
    drives: Vec<JointOf>,
}

#[derive(Deserialize)]
struct JointOf {
    joint: Spanned<String>,
}

/// Returns the line and column of the beginning of a span, from 1.
fn place_of(text: &str, span: &Span<usize>) -> (usize, usize) {
    let before = text.get(..span.start).unwrap_or(text);
    let line = before.rsplit('\n').next().unwrap_or_default();
    (1 + before.matches('\n').count(), 1 + line.chars().count())
}

/// Returns the position as the prefix of a message.
fn position_prefix(line: Option<usize>, column: Option<usize>) -> String {
    match (line, column) {
        (Some(line), Some(column)) => format!("line {line}, column {column}: "),
        (Some(line), None) => format!("line {line}: "),
        (None, _) => String::new(),
    }
}

/// Returns the line of the `index`-th header.
fn nth_line(text: &str, header: &str, index: usize) -> Option<usize> {
    text.lines()
        .enumerate()
        .filter(|(_, line)| line.trim().starts_with(header))
        .nth(index)
        .map(|(line, _)| line + 1)
}
