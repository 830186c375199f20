//! Drive protocols. Each folder contains the codec (conversion between values and frames, without allocation,
//! clock or bus), the adapter's dialogue with a drive, the simulated drive, and the protocol's specification.
//!
//! Decoding is strict: a wrong length, identifier or device, a set reserved bit, or a non-finite number is an
//! error. No frame causes a panic.
//!
//! This module is the only one that distinguishes protocols. All other modules use [`DriveProtocol`],
//! [`Dialogue`](dialogue::Dialogue) and [`Simulated`](simulation::Simulated).

pub(crate) mod device;
pub(crate) mod dialogue;
pub(crate) mod entries;
pub(crate) mod homing_fault;
pub(crate) mod setting;
pub(crate) mod simulation;
pub(crate) mod spec;

/// Names of the protocols in drive tables.
pub(crate) mod name {
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// The protocol of a drive.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum Protocol {
        /// The MIT protocol with answers of six bytes.
        MiniCheetah,
        /// The MIT protocol with answers of eight bytes, including the supply voltage.
        MiniCheetahVoltage,
        /// The MIT protocol of CubeMars.
        Cubemars,
        /// The MIT protocol of Damiao, with readable ranges and watchdog.
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
        /// All protocols.
        pub(crate) const ALL: [Self; 10] = [
            Self::MiniCheetah,
            Self::MiniCheetahVoltage,
            Self::Cubemars,
            Self::Damiao,
            Self::Robstride,
            Self::Odrive,
            Self::Cia402,
            Self::Moteus,
            Self::Feetech,
            Self::Dynamixel,
        ];
    }
}

pub(crate) mod cia402 {
    pub mod codec;
    mod data_sheet;
    pub(super) mod dialogue;
    mod homing_objects;
    mod simulated;
    pub(super) mod spec;
}

pub(crate) mod mit {
    pub mod codec;
    pub mod damiao;
    pub(super) mod dialogue;
    mod rounding;
    pub(crate) mod simulated;
    pub(super) mod spec;
}

pub(crate) mod moteus {
    pub mod codec;
    pub(super) mod dialogue;
    mod simulated;
    pub(super) mod spec;
}

pub(crate) mod odrive {
    pub mod codec;
    pub(super) mod dialogue;
    mod simulated;
    pub(super) mod spec;
}

pub(crate) mod servo {
    pub(crate) mod codec {
        pub mod dynamixel;
        pub mod feetech;
        mod steps;
    }
    pub(super) mod dialogue;
    mod maker;
    mod simulated;
    pub(super) mod spec;
}

/// Codecs of all protocols.
pub(crate) mod codecs {
    pub use super::cia402::codec as cia402;
    pub use super::mit::{codec as mit, damiao};
    pub use super::moteus::codec as moteus;
    pub use super::odrive::codec as odrive;
    pub use super::servo::codec::{dynamixel, feetech};
}

use crate::drive::{Feedback, Ranges};
use crate::frame::{DecodeError, Form, Frame};
use crate::range::Range;
use dialogue::{Dialogue, Member, Order, Response};
use entries::DriveEntry;
use homing_fault::HomingFault;
use name::Protocol;
use spec::{DriveProtocol, DriveSetup, Spec};

/// Evaluates an expression for the value of any variant of a family enum.
macro_rules! each {
    ($any:ident, $value:expr, $inner:ident => $result:expr) => {
        match $value {
            $any::Mit($inner) => $result,
            $any::Odrive($inner) => $result,
            $any::Cia402($inner) => $result,
            $any::Moteus($inner) => $result,
            $any::Servo($inner) => $result,
        }
    };
}

/// Specification of a protocol, with its type.
enum Family {
    Mit(&'static mit::spec::Mit),
    Odrive(&'static odrive::spec::Odrive),
    Cia402(&'static cia402::spec::Cia402),
    Moteus(&'static moteus::spec::Moteus),
    Servo(&'static servo::spec::Servo),
}

impl Protocol {
    fn family(self) -> Family {
        match self {
            Self::MiniCheetah => Family::Mit(&mit::spec::MINI_CHEETAH),
            Self::MiniCheetahVoltage => Family::Mit(&mit::spec::MINI_CHEETAH_VOLTAGE),
            Self::Cubemars => Family::Mit(&mit::spec::CUBEMARS),
            Self::Damiao => Family::Mit(&mit::spec::DAMIAO),
            Self::Robstride => Family::Mit(&mit::spec::ROBSTRIDE),
            Self::Odrive => Family::Odrive(&odrive::spec::ODRIVE),
            Self::Cia402 => Family::Cia402(&cia402::spec::CIA402),
            Self::Moteus => Family::Moteus(&moteus::spec::MOTEUS),
            Self::Feetech => Family::Servo(&servo::spec::FEETECH),
            Self::Dynamixel => Family::Servo(&servo::spec::DYNAMIXEL),
        }
    }

    /// Returns the definition of the protocol.
    pub(crate) fn definition(self) -> &'static dyn DriveProtocol {
        each!(Family, self.family(), rules => rules)
    }

    /// Returns the specification of the protocol.
    pub(crate) fn spec(self) -> &'static Spec {
        self.definition().spec()
    }
}

/// Returns the definitions of all protocols.
pub(crate) fn definitions() -> impl Iterator<Item = &'static dyn DriveProtocol> {
    Protocol::ALL.into_iter().map(Protocol::definition)
}

/// Dialogue with a drive of any protocol.
///
/// It is an enum rather than a trait object, because drives are called several times per cycle.
#[derive(Clone, Debug)]
pub(crate) enum AnyDialogue {
    Mit(mit::dialogue::Mit),
    Odrive(odrive::dialogue::Odrive),
    Cia402(cia402::dialogue::Cia402),
    Moteus(moteus::dialogue::Moteus),
    Servo(servo::dialogue::Servo),
}

impl AnyDialogue {
    /// Creates the dialogue with a drive.
    pub(crate) fn new(setup: &DriveSetup<'_>) -> Self {
        match setup.entry.protocol.family() {
            Family::Mit(rules) => Self::Mit(rules.dialogue(setup)),
            Family::Odrive(rules) => Self::Odrive(rules.dialogue(setup)),
            Family::Cia402(rules) => Self::Cia402(rules.dialogue(setup)),
            Family::Moteus(rules) => Self::Moteus(rules.dialogue(setup)),
            Family::Servo(rules) => Self::Servo(rules.dialogue(setup)),
        }
    }
}

impl Dialogue for AnyDialogue {
    fn checks(&self) -> u8 {
        each!(AnyDialogue, self, drive => drive.checks())
    }

    fn takes_gains(&self) -> bool {
        each!(AnyDialogue, self, drive => drive.takes_gains())
    }

    fn reports_state(&self) -> bool {
        each!(AnyDialogue, self, drive => drive.reports_state())
    }

    fn reports_every_ns(&self) -> Option<u64> {
        each!(AnyDialogue, self, drive => drive.reports_every_ns())
    }

    fn state_within_ns(&self) -> Option<u64> {
        each!(AnyDialogue, self, drive => drive.state_within_ns())
    }

    fn shortest(&self) -> (Form, usize, usize) {
        each!(AnyDialogue, self, drive => drive.shortest())
    }

    fn set_cycle(&mut self, cycle_ns: u64) {
        each!(AnyDialogue, self, drive => drive.set_cycle(cycle_ns))
    }

    fn accept(&mut self, feedback: &Feedback) {
        each!(AnyDialogue, self, drive => drive.accept(feedback))
    }

    fn restart(&mut self) {
        each!(AnyDialogue, self, drive => drive.restart())
    }

    fn forget(&mut self) {
        each!(AnyDialogue, self, drive => drive.forget())
    }

    fn begin_homing(&mut self) {
        each!(AnyDialogue, self, drive => drive.begin_homing())
    }

    fn homing_result(&self) -> Option<Result<(), HomingFault>> {
        each!(AnyDialogue, self, drive => drive.homing_result())
    }

    fn is_from(&self, frame: &Frame) -> bool {
        each!(AnyDialogue, self, drive => drive.is_from(frame))
    }

    fn write(&mut self, order: &Order, frames: &mut Vec<Frame>) {
        each!(AnyDialogue, self, drive => drive.write(order, frames))
    }

    fn is_synchronised(&self, order: &Order) -> bool {
        each!(AnyDialogue, self, drive => drive.is_synchronised(order))
    }

    fn synchronise(&self, frames: &mut Vec<Frame>) {
        each!(AnyDialogue, self, drive => drive.synchronise(frames))
    }

    fn member(&self) -> Option<&dyn Member> {
        each!(AnyDialogue, self, drive => drive.member())
    }

    fn member_mut(&mut self) -> Option<&mut dyn Member> {
        each!(AnyDialogue, self, drive => drive.member_mut())
    }

    fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError> {
        each!(AnyDialogue, self, drive => drive.read(checking, frame))
    }
}

/// Returns the codec of an MIT drive; `None` for other protocols.
pub(crate) fn mit_codec(setup: &DriveSetup<'_>) -> Option<mit::codec::Drive> {
    match setup.entry.protocol.family() {
        Family::Mit(rules) => Some(rules.codec(setup)),
        _ => None,
    }
}

impl DriveEntry {
    /// Returns `true` if the joint must be homed after power-up: its position is unknown until a homing
    /// motion has finished. Returns `false` without `homing`, and for servos, whose `homing` only compares a
    /// stored offset.
    pub fn is_homed(&self) -> bool {
        self.homing.is_some() && self.protocol.spec().homing.moves
    }

    /// Returns the objects written for the homing, each with index, subindex and value; empty without a CiA
    /// 402 homing.
    ///
    /// Velocities are in increments of the drive per second.
    pub fn homing_registers(&self) -> Vec<(u16, u8, i64)> {
        self.protocol.definition().homing_registers(self)
    }

    /// Returns the ranges of the drive. The torque is limited by its current limit, and for moteus, the gains
    /// are limited to the gains of its own loop.
    pub(crate) fn limited_ranges(&self) -> Ranges {
        let (protocol, ranges) = (self.protocol.definition(), self.ranges.ranges());
        // an invalid current limit is refused elsewhere
        let torque = protocol.torque_of_current(self).filter(|torque| *torque > 0.0);
        let most = torque.map_or(ranges.torque.max, |torque| torque.min(ranges.torque.max));
        protocol.limited(self, Ranges { torque: Range::symmetric(most), ..ranges })
    }
}
