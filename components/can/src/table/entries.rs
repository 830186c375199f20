//! The entries of a drive table, as its file has them.

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use super::HomingEntry;
use crate::cia402::Mapping;
use crate::moteus::Home;
use crate::{Range, mit};

/// A bus of a drive table.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusEntry {
    /// Its name.
    pub name: String,
    /// Its kind: "can", or "serial" for a line of serial servos. Default "can".
    #[serde(default)]
    pub kind: BusKind,
    /// The network interface of the computer that it is, such as "can0" or "vcan0", or the serial line of an
    /// slcan adapter or of serial servos, such as "/dev/ttyACM0". Or a place at which `can.drive_sim` offers
    /// it in real time: "unix:NAME", a unix socket, or "pty:PATH", a pseudo-terminal that speaks slcan, or
    /// packets of servos. Without one it is simulated, over topics.
    pub interface: Option<String>,
    /// Bits per second of arbitration, and of whole classic frames; of a serial line its speed.
    pub bitrate: u32,
    /// Bits per second of the data of CAN FD frames; without it the bus is a classic one.
    pub data_bitrate: Option<u32>,
    /// All servos answer in one common packet (fast sync read), which saves most of their turn-rounds:
    /// Dynamixels with firmware support, up to nine on a line. Default false.
    #[serde(default)]
    pub fast_read: bool,
    /// Longest time from a command to the beginning of its answer. Default 100 us.
    #[serde(default = "turn_round")]
    pub turn_round: TimeSpan,
}

fn turn_round() -> TimeSpan {
    TimeSpan { ns: 100_000 }
}

/// The kind of a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BusKind {
    /// A CAN bus.
    #[default]
    Can,
    /// A serial line that all servos share.
    Serial,
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
    /// The identifier of its answers. Default: 0; of a Damiao drive the node and 0x10. Of the MIT family
    /// only.
    pub master: Option<u16>,
    /// The ranges of its fields; of protocols without ranges the largest values that it reaches.
    pub ranges: RangeEntry,
    /// Time without a command after which the drive disables itself; "0 s" for never.
    pub watchdog: TimeSpan,
    /// Angle of the drive's output shaft per joint position (rad/rad or rad/m). Default 1.
    #[serde(default = "one")]
    pub ratio: f64,
    /// The drive turns in the opposite direction. Default false.
    #[serde(default)]
    pub reversed: bool,
    /// Joint position at the drive's zero (rad or m). Default 0.
    #[serde(default)]
    pub offset: f64,
    /// Whole turns of the drive's output shaft added to its reading, for a drive that comes up whole turns
    /// away. Default 0.
    #[serde(default)]
    pub turns: i32,
    /// The quantity that it is commanded: "position", by its own loop, "velocity", with the position loop in
    /// the adapter (CiA 402 only), or "torque", with the gains of the commands applied in the adapter.
    /// Default "position". Of ODrive and CiA 402 only.
    pub mode: Option<ControlMode>,
    /// Gains of the drive's own position loop. Default: full torque at a twentieth of a radian. Of drives
    /// that are commanded positions, and of moteus.
    pub position_loop: Option<LoopEntry>,
    /// Time between two reports of the encoder, as it is set in the drive. Default 10 ms. Of ODrive only.
    pub report_every: Option<TimeSpan>,
    /// Required reference of the reported position: "output", or "rotor" for a joint that moves by less than
    /// a turn of the rotor. Default "output". Of moteus without `homing` only.
    pub reference: Option<ReferenceEntry>,
    /// Increments of the encoder per turn of the output shaft. Of CiA 402 only, where it is required unless
    /// the data sheet has it.
    pub increments: Option<f64>,
    /// The rated torque, of which torques are thousandths: object 0x6076, N m. Of CiA 402 only, where it is
    /// required unless the data sheet has it.
    pub rated_torque: Option<f64>,
    /// The largest current of the motor, A, which the adapter sets in the drive before it enables it: an
    /// effort beyond that current is clamped. Of ODrive, CiA 402 (object 0x6073), Damiao (register 3),
    /// Feetech (register 48) and Dynamixel (register 102). Default: as the drive has it.
    pub current_limit: Option<f64>,
    /// Torque of the output shaft per current of the motor, N m/A. Of ODrive, Damiao and Dynamixel, for
    /// `current_limit`.
    pub torque_constant: Option<f64>,
    /// The current of which the limit in the drive is a share: the largest one of a Damiao drive, the stall
    /// current of a Feetech, A.
    pub full_current: Option<f64>,
    /// The unit of currents in a Dynamixel, A.
    pub current_unit: Option<f64>,
    /// The rated current, of which currents are thousandths: object 0x6075, A. Of CiA 402 only, for
    /// `current_limit`, where it is required unless the data sheet has it.
    pub rated_current: Option<f64>,
    /// The electronic data sheet of the drive, an EDS or DCF file, relative to the drive table: it provides
    /// increments and rated torque, and the table is checked against its objects, modes, mappings and limits.
    /// Of CiA 402 only.
    pub eds: Option<String>,
    /// Procedure that determines its position after power-up, before it is enabled. Default: the reported
    /// position is absolute, or the drive is at its zero.
    pub homing: Option<HomingEntry>,
    /// Process data with a read-only mapping in the data sheet.
    #[serde(skip)]
    pub(crate) fixed_mappings: Vec<Mapping>,
}

fn one() -> f64 {
    1.0
}

/// The quantity that a drive is commanded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ControlMode {
    /// Positions, followed by the drive's own loop.
    #[default]
    Position,
    /// Velocities, followed by the drive's own loop: the adapter closes the position loop around it, with the
    /// ratio of the gains of `position_loop`, once a cycle.
    Velocity,
    /// Torques: the adapter applies the gains of the command to the newest state, once a cycle.
    Torque,
}

/// The place from which a drive counts its position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceEntry {
    /// Its output.
    #[default]
    Output,
    /// The encoder of its rotor.
    Rotor,
}

impl From<ReferenceEntry> for Home {
    fn from(entry: ReferenceEntry) -> Self {
        match entry {
            ReferenceEntry::Output => Self::Output,
            ReferenceEntry::Rotor => Self::Rotor,
        }
    }
}

/// The gains of a drive's own position loop, in the units of its output shaft.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LoopEntry {
    /// Position gain, N m/rad.
    pub kp: f64,
    /// Velocity gain, N m s/rad.
    pub kd: f64,
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

impl DriveEntry {
    /// Gains of its own position loop: the entry's, or full torque at a twentieth of a radian.
    pub(super) fn loop_gains(&self) -> LoopEntry {
        let torque = self.ranges.torque;
        self.position_loop.unwrap_or(LoopEntry { kp: 20.0 * torque, kd: 2.0 * torque })
    }

    /// Its ranges, with the torque limited by its current and, for a moteus, the gains limited to its own
    /// loop's.
    pub(super) fn limited_ranges(&self) -> mit::Ranges {
        let ranges = self.ranges.ranges();
        // one that cannot be is refused as such
        let torque = self.torque_of_current().filter(|torque| *torque > 0.0);
        let most = torque.map_or(ranges.torque.max, |torque| torque.min(ranges.torque.max));
        let ranges = mit::Ranges { torque: Range::symmetric(most), ..ranges };
        match self.protocol {
            // it receives shares of its stored gains, at most one
            Protocol::Moteus => {
                let gains = self.loop_gains();
                ranges.with_gains(ranges.kp.max.min(gains.kp), ranges.kd.max.min(gains.kd))
            }
            _ => ranges,
        }
    }
}

impl RangeEntry {
    pub(super) fn ranges(&self) -> mit::Ranges {
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
    /// The MIT protocol of Damiao, whose registers report ranges and watchdog.
    Damiao,
    /// The MIT protocol of RobStride.
    Robstride,
    /// CANSimple of ODrive.
    Odrive,
    /// CiA 402 over CANopen, in the cyclic synchronous modes.
    Cia402,
    /// Registers of moteus over CAN FD.
    Moteus,
    /// Packets of Feetech's STS servos on a serial line.
    Feetech,
    /// Protocol 2.0 of Dynamixel's X series on a serial line.
    Dynamixel,
}

impl Protocol {
    /// The form of its answers, of the MIT family.
    pub(super) fn reply(self) -> Option<mit::Reply> {
        Some(match self {
            Self::MiniCheetah => mit::Reply::MiniCheetah,
            Self::MiniCheetahVoltage => mit::Reply::MiniCheetahVoltage,
            Self::Cubemars => mit::Reply::CubeMars,
            Self::Damiao => mit::Reply::Damiao,
            Self::Robstride => mit::Reply::RobStride,
            Self::Odrive | Self::Cia402 | Self::Moteus | Self::Feetech | Self::Dynamixel => {
                return None;
            }
        })
    }

    /// The largest number of a drive.
    pub(super) fn last_node(self) -> u8 {
        match self {
            Self::Damiao => 0xf,
            Self::Odrive => 63,
            // 127 is the adapter's own
            Self::Cia402 | Self::Moteus => 126,
            Self::Feetech => 253,
            Self::Dynamixel => 252,
            _ => 255,
        }
    }

    /// True for servos on a serial line.
    pub(super) fn is_servo(self) -> bool {
        matches!(self, Self::Feetech | Self::Dynamixel)
    }

    /// The kind of bus that it is spoken on.
    pub(super) fn bus(self) -> BusKind {
        if self.is_servo() { BusKind::Serial } else { BusKind::Can }
    }

    /// Returns `true` for drives with a selectable mode, positions or torques.
    pub(super) fn has_modes(self) -> bool {
        matches!(self, Self::Odrive | Self::Cia402)
    }

    /// Returns `true` for drives with their own position loop, whose gains are in the table.
    pub(crate) fn has_loop(self) -> bool {
        matches!(self, Self::Odrive | Self::Cia402 | Self::Moteus) || self.is_servo()
    }
}
