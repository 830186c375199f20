//! Entries of a drive table file.

mod homing;

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use super::name::Protocol;
use crate::drive::{PositionReference, Ranges};
pub use homing::{HomingBy, HomingEntry, HomingProcedure};

/// A bus of a drive table.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusEntry {
    /// Name of the bus.
    pub name: String,
    /// Kind of the bus: "can", or "serial" for a line of serial servos. Default "can".
    #[serde(default)]
    pub kind: BusKind,
    /// The network interface of the computer, such as "can0" or "vcan0", or the serial line of an slcan
    /// adapter or of serial servos, such as "/dev/ttyACM0". It may also be the address at which
    /// `can.drive_sim` offers the bus in real time: "unix:NAME" for a unix socket, or "pty:PATH" for a
    /// pseudo-terminal with slcan or servo packets. Without an interface, the bus is simulated over topics.
    pub interface: Option<String>,
    /// Bitrate of arbitration and of whole classic frames, bit/s; for a serial line, its speed.
    pub bitrate: u32,
    /// Bitrate of the data of CAN FD frames, bit/s. Default: none; the bus is then classic.
    pub data_bitrate: Option<u32>,
    /// All servos answer together in one packet (fast sync read), which saves most of their turnaround times.
    /// Only for Dynamixel servos whose firmware supports fast sync read, at most nine on a line. Default
    /// false.
    #[serde(default)]
    pub fast_read: bool,
    /// Maximum time from a command to the beginning of its answer. Default 100 us.
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
    /// A serial line shared by all servos.
    Serial,
}

/// A drive of a drive table.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveEntry {
    /// Joint moved by the drive.
    pub joint: String,
    /// Name of the bus of the drive.
    pub bus: String,
    /// Protocol of the drive.
    pub protocol: Protocol,
    /// Number of the drive on its bus.
    pub node: u8,
    /// Identifier of the drive's answers. Default: 0; for a Damiao drive, `node | 0x10`. MIT family only.
    pub master: Option<u16>,
    /// Ranges of the drive's fields; for protocols without ranges, the largest values that the drive reaches.
    pub ranges: RangeEntry,
    /// Time without a command after which the drive disables itself; "0 s" for never.
    pub watchdog: TimeSpan,
    /// Angle of the drive's output shaft per joint position (rad/rad or rad/m). Default 1.
    #[serde(default = "one")]
    pub ratio: f64,
    /// The drive turns in the opposite direction. Default false.
    #[serde(default)]
    pub reversed: bool,
    /// Joint position at which the drive reads zero (rad or m). Default 0.
    #[serde(default)]
    pub offset: f64,
    /// Whole turns of the output shaft added to the reading of a drive that is off by whole turns after
    /// power-up. Default 0.
    #[serde(default)]
    pub turns: i32,
    /// The commanded quantity: "position", with the drive's own loop; "velocity", with the position loop in
    /// the adapter (CiA 402 only); or "torque", with the gains of the commands applied in the adapter.
    /// Default "position". ODrive and CiA 402 only.
    pub mode: Option<ControlMode>,
    /// Gains of the drive's own position loop. Default: full torque at a twentieth of a radian. Only for
    /// drives commanded by position, and for moteus.
    pub position_loop: Option<LoopEntry>,
    /// Time between two encoder reports, as configured in the drive. Default 10 ms. ODrive only.
    pub report_every: Option<TimeSpan>,
    /// Minimum reference that the drive must report for its position: "output", or "rotor" for a joint that
    /// moves by less than a turn of the rotor. Default "output". Only for moteus drives without `homing`.
    pub reference: Option<ReferenceEntry>,
    /// Increments of the encoder per turn of the output shaft. CiA 402 only, where it is required unless the
    /// data sheet has it.
    pub increments: Option<f64>,
    /// The rated torque, the base of torques in thousandths: object 0x6076, N m. CiA 402 only, where it is
    /// required unless the data sheet has it.
    pub rated_torque: Option<f64>,
    /// The largest current of the motor, A, which the adapter sets in the drive before enabling it; efforts
    /// that require more current are clamped. For ODrive, CiA 402 (object 0x6073), Damiao (register 3),
    /// Feetech (register 48) and Dynamixel (register 102). Default: the drive's setting.
    pub current_limit: Option<f64>,
    /// Torque of the output shaft per current of the motor, N m/A. Used by `current_limit` of ODrive, Damiao
    /// and Dynamixel drives.
    pub torque_constant: Option<f64>,
    /// The current to which the drive's limit is relative, A: the largest current of a Damiao drive, or the
    /// stall current of a Feetech servo.
    pub full_current: Option<f64>,
    /// Unit of the current registers of a Dynamixel servo, A.
    pub current_unit: Option<f64>,
    /// The rated current, the base of currents in thousandths: object 0x6075, A. For `current_limit` of CiA
    /// 402, where it is required unless the data sheet has it.
    pub rated_current: Option<f64>,
    /// The electronic data sheet of the drive, an EDS or DCF file, relative to the drive table. The data
    /// sheet provides the increments and the rated torque. The table is checked against the objects, modes,
    /// mappings and limits in the data sheet. CiA 402 only.
    pub eds: Option<String>,
    /// Procedure that determines the joint position after power-up, before the drive is enabled. Default:
    /// none, because the reported position is absolute, or the drive is at its zero at power-up.
    pub homing: Option<HomingEntry>,
    /// Numbers of the process data whose mapping is read-only according to the data sheet.
    #[serde(skip)]
    pub(crate) fixed_mappings: Vec<u8>,
}

fn one() -> f64 {
    1.0
}

/// The commanded quantity of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ControlMode {
    /// Positions, which the drive follows with its own loop.
    #[default]
    Position,
    /// Velocities, which the drive follows with its own loop. Once a cycle, the adapter closes a position
    /// loop around the drive's velocity loop, whose gain is the ratio `kp / kd` of `position_loop`.
    Velocity,
    /// Torques: once a cycle, the adapter applies the gains of the command to the newest state.
    Torque,
}

/// Zero point of the position that a drive reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceEntry {
    /// The output shaft of the drive.
    #[default]
    Output,
    /// The encoder of the drive's rotor.
    Rotor,
}

impl From<ReferenceEntry> for PositionReference {
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
    /// Returns the gains of the drive's own position loop: from its entry, or full torque at a twentieth of a
    /// radian.
    pub(crate) fn loop_gains(&self) -> LoopEntry {
        let torque = self.ranges.torque;
        self.position_loop.unwrap_or(LoopEntry { kp: 20.0 * torque, kd: 2.0 * torque })
    }
}

impl RangeEntry {
    /// Returns the ranges of the fields.
    pub(crate) fn ranges(&self) -> Ranges {
        let gains = (self.kp.unwrap_or(500.0), self.kd.unwrap_or(5.0));
        Ranges::new(self.position, self.velocity, self.torque).with_gains(gains.0, gains.1)
    }
}
