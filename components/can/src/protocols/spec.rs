//! Specification of a protocol, as used by drive tables, buses and the adapter.

use core::ops::RangeInclusive;
use std::io;

use super::device::Device;
use super::entries::{BusEntry, BusKind, ControlMode, DriveEntry, HomingEntry, LoopEntry};
use super::simulation::{Overrides, Simulated};
use crate::bus::budget::Shape;
use crate::drive::Ranges;
use crate::frame::{Form, Frame, Id};

/// Refusal of a table entry: value found, and advice.
pub(crate) type Refusal = (String, &'static str);

/// Properties of a protocol.
#[derive(Clone, Debug)]
pub(crate) struct Spec {
    /// Required kind of bus.
    pub(crate) bus: BusKind,
    /// Frames that the drives receive.
    pub(crate) frames: Frames,
    /// Valid node numbers.
    pub(crate) nodes: RangeInclusive<u8>,
    /// `true` if drives of other protocols may share the bus.
    pub(crate) shares_bus: bool,
    /// Number of bytes per drive in the common answer to a fast read; `None` without fast reads.
    pub(crate) fast_answer: Option<usize>,
    /// Protocol-specific keys of a drive's entry.
    pub(crate) keys: &'static [&'static str],
    /// Watchdog of a drive.
    pub(crate) watchdog: Watchdog,
    /// Current limit of a drive.
    pub(crate) current_limit: CurrentLimit,
    /// Commands whose gains and efforts reach the drive.
    pub(crate) gains: Gains,
    /// `true` if the drive follows velocities in one of its modes.
    pub(crate) has_velocity_mode: bool,
    /// Homing by the drive.
    pub(crate) homing: OwnHoming,
}

impl Spec {
    /// Returns `true` if the protocol has the table key `key`.
    pub(crate) fn has_key(&self, key: &str) -> bool {
        self.keys.contains(&key)
    }

    /// Returns `true` for drives with an internal position loop, whose gains are in the table.
    pub(crate) fn has_loop(&self) -> bool {
        self.has_key("position_loop")
    }

    /// Returns `true` if the gains and efforts of commands reach the drive in this mode.
    pub(crate) fn takes_torques(&self, mode: Option<ControlMode>) -> bool {
        match self.gains {
            Gains::Commanded => true,
            Gains::InTorqueMode => mode == Some(ControlMode::Torque),
            Gains::Stored => false,
        }
    }
}

/// Frames that drives receive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Frames {
    /// Classic frames on any CAN bus.
    Classic,
    /// CAN FD frames on a bus with a second bitrate, otherwise classic ones.
    Fd,
    /// Packets on a serial line.
    Packet,
}

impl Frames {
    /// Returns the form on a bus with or without a bitrate for CAN FD.
    pub(crate) fn form(self, is_fd: bool) -> Form {
        match self {
            Self::Packet => Form::Packet,
            Self::Fd if is_fd => Form::FdFast,
            Self::Classic | Self::Fd => Form::Classic,
        }
    }
}

/// Watchdog of a drive.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Watchdog {
    /// Any time, as configured in the drive.
    Any,
    /// Multiples of a unit, up to `most` of them.
    Units { unit_ns: u64, most: u64, advice: &'static str },
    /// No watchdog.
    Missing { message: &'static str, advice: &'static str },
}

/// Current limit of a drive.
#[derive(Clone, Copy, Debug)]
pub(crate) enum CurrentLimit {
    /// The adapter sets the limit in the drive. Each of `keys` is required; the error for a missing key
    /// contains the advice.
    Settable { keys: &'static [(&'static str, &'static str)] },
    /// The protocol has no current limit.
    Unsupported { advice: &'static str },
}

/// Commands whose gains and efforts reach a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Gains {
    /// All commands.
    Commanded,
    /// Commands in the torque mode.
    InTorqueMode,
    /// None: the drive follows positions with its stored gains.
    Stored,
}

/// Homing by a drive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OwnHoming {
    /// `true` if the drive supports homing by itself.
    pub(crate) is_supported: bool,
    /// `true` if the joint moves. Otherwise, only an offset stored in the drive is compared.
    pub(crate) moves: bool,
    /// Keys of its entry.
    pub(crate) keys: &'static [&'static str],
}

/// Key required for the current limit of drives that limit their motor current.
pub(crate) const TORQUE_CONSTANT: (&str, &str) =
    ("torque_constant", "write the N m/A of the output shaft: 8.27 / KV of the motor, times its gear");

/// Largest number in 16-bit thousandths.
pub(crate) const THOUSANDTHS: f64 = 32.767;

/// Refuses a range that exceeds the field of a frame.
pub(crate) fn beyond(name: &str, value: f64, unit: &str, most: f64, field: &str) -> Result<(), Refusal> {
    if value > most {
        return Err((
            format!("the {name} is {value} {unit}, but {field} is limited to {most:.2}"),
            "write the largest value that the drive reaches within this limit: `ranges` refer to its output shaft",
        ));
    }
    Ok(())
}

/// Refuses a homing by the drive without a current limit.
pub(crate) fn require_current_limit(entry: &DriveEntry) -> Result<(), Refusal> {
    if entry.current_limit.is_none() {
        return Err((
            "a homing by the drive requires `current_limit`".into(),
            "write the largest current: the command gate does not limit a drive that homes itself",
        ));
    }
    Ok(())
}

/// A drive of a table, with the properties derived from its limits and its bus.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DriveSetup<'a> {
    pub(crate) entry: &'a DriveEntry,
    /// Largest values within the limits of the drive.
    pub(crate) ranges: Ranges,
    /// Gains of the drive's own position loop.
    pub(crate) gains: LoopEntry,
    /// Form of its frames.
    pub(crate) form: Form,
    /// `true` if all drives on its bus answer together.
    pub(crate) fast_read: bool,
}

impl DriveSetup<'_> {
    /// Returns the shape of a frame to or from the drive with this number of bytes and an 11-bit identifier.
    pub(crate) fn shape(&self, bytes: usize) -> Shape {
        Shape { extended: false, form: self.form, bytes }
    }

    /// Returns the watchdog of the simulated drive, ns; `None` for off.
    pub(crate) fn watchdog_ns(&self, overrides: Overrides) -> Option<u64> {
        Some(overrides.watchdog_ns.unwrap_or(self.entry.watchdog.ns)).filter(|ns| *ns > 0)
    }
}

/// Protocol of a drive.
///
/// A table checks the rules that follow from [`spec`](Self::spec), and calls the `check` functions.
pub(crate) trait DriveProtocol: Sync {
    /// Returns the properties of the protocol.
    fn spec(&self) -> &Spec;

    /// Refuses a bus or ranges that the frames of the protocol do not support.
    fn check_frames(&self, _entry: &DriveEntry, _bus: &BusEntry) -> Result<(), Refusal> {
        Ok(())
    }

    /// Refuses an entry that lacks a required key.
    fn check_keys(&self, _entry: &DriveEntry) -> Result<(), Refusal> {
        Ok(())
    }

    /// Refuses numbers that exceed the fields of the mode.
    fn check_fields(&self, _entry: &DriveEntry) -> Result<(), Refusal> {
        Ok(())
    }

    /// Refuses a current limit \[A\] that cannot be set in the drive.
    fn check_current(&self, _entry: &DriveEntry, _limit: f64) -> Result<(), Refusal> {
        Ok(())
    }

    /// Refuses a homing by the drive.
    fn check_homing(&self, _entry: &DriveEntry, _homing: &HomingEntry) -> Result<(), Refusal> {
        Ok(())
    }

    /// Completes an entry from the drive's data sheet. `read` returns the text of a file by name.
    fn complete(
        &self,
        _entry: &mut DriveEntry,
        _read: &dyn Fn(&str) -> io::Result<String>,
    ) -> Result<(), Refusal> {
        Ok(())
    }

    /// Returns the torque at the current limit, N m; `None` without a limit.
    fn torque_of_current(&self, entry: &DriveEntry) -> Option<f64> {
        Some(entry.current_limit? * entry.torque_constant?)
    }

    /// Reduces the ranges of an entry to the ranges that the drive reaches.
    fn limited(&self, _entry: &DriveEntry, ranges: Ranges) -> Ranges {
        ranges
    }

    /// Returns the largest velocity gain of a command, N m s/rad.
    fn largest_damping(&self, _entry: &DriveEntry) -> f64 {
        f64::INFINITY
    }

    /// Returns the objects that the adapter writes for a homing by the drive: index, subindex, number.
    fn homing_registers(&self, _entry: &DriveEntry) -> Vec<(u16, u8, i64)> {
        Vec::new()
    }

    /// Returns the identifiers of a drive's commands and of its answers, on a bus shared by several
    /// protocols.
    fn identifiers(&self, _setup: &DriveSetup<'_>) -> Option<(Id, Id)> {
        None
    }

    /// Returns `true` if a frame of another program commands the drive.
    fn is_command(&self, _setup: &DriveSetup<'_>, _frame: &Frame) -> bool {
        false
    }

    /// Returns the classic frames to which drives answer with their settings, without side effects.
    fn requests(&self) -> Vec<Frame> {
        Vec::new()
    }

    /// Returns the CAN FD frames to which drives answer with their settings, without side effects.
    fn fd_requests(&self) -> Vec<Frame> {
        Vec::new()
    }

    /// Returns the drive that sent the frame, if it answers one of the requests.
    fn answer(&self, _frame: &Frame) -> Option<Device> {
        None
    }

    /// Returns the drive that sent the frame, if the frame may be a heartbeat.
    fn heartbeat(&self, _frame: &Frame) -> Option<Device> {
        None
    }

    /// Returns `true` if the frame, which is not a heartbeat, proves that `device` was detected by mistake.
    fn refutes(&self, _device: &Device, _frame: &Frame) -> bool {
        false
    }

    /// Returns the shapes of the command and the answer of a cycle.
    fn exchange(&self, setup: &DriveSetup<'_>) -> (Shape, Shape);

    /// Returns the shapes of additional frames of the drive in a cycle.
    fn additional_frames(&self, _setup: &DriveSetup<'_>) -> Vec<Shape> {
        Vec::new()
    }

    /// Returns the shapes of the frames that all drives of a bus share in a cycle.
    fn bus_frames(&self) -> Vec<Shape> {
        Vec::new()
    }

    /// Creates a simulated drive.
    fn simulated(&self, setup: &DriveSetup<'_>, overrides: Overrides) -> Box<dyn Simulated>;
}
