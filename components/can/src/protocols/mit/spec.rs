//! Specification of the MIT family.

use super::codec::{Drive, Reply};
use super::damiao::{EVERYBODY, Register, Request, Value};
use super::dialogue::Mit as MitDialogue;
use super::simulated::SimulatedDrive;
use crate::bus::budget::Shape;
use crate::drive::Ranges;
use crate::frame::{Frame, Id};
use crate::protocols::device::{Device, DeviceKind};
use crate::protocols::entries::{BusEntry, BusKind, DriveEntry, HomingEntry};
use crate::protocols::simulation::{Overrides, Simulated};
use crate::protocols::spec::{
    CurrentLimit, DriveProtocol, DriveSetup, Frames, Gains, OwnHoming, Refusal, Spec, TORQUE_CONSTANT,
    Watchdog,
};
use crate::range::Range;

/// Protocol of the MIT family, whose drives differ in the format of their answers.
#[derive(Debug)]
pub(crate) struct Mit {
    spec: Spec,
    reply: Reply,
}

pub(crate) static MINI_CHEETAH: Mit = Mit::new(Reply::MiniCheetah);
pub(crate) static MINI_CHEETAH_VOLTAGE: Mit = Mit::new(Reply::MiniCheetahVoltage);
pub(crate) static CUBEMARS: Mit = Mit::new(Reply::CubeMars);
pub(crate) static ROBSTRIDE: Mit = Mit::new(Reply::RobStride);
pub(crate) static DAMIAO: Mit = Mit {
    spec: Spec {
        frames: Frames::Fd,
        nodes: 1..=0xf,
        keys: &["master", "torque_constant", "full_current"],
        watchdog: Watchdog::Units {
            unit_ns: 50_000,
            most: u32::MAX as u64,
            advice: "write a multiple of 50 us, the unit of register 9",
        },
        current_limit: CurrentLimit::Settable {
            keys: &[
                TORQUE_CONSTANT,
                (
                    "full_current",
                    "write the drive's largest current from its data sheet, A: register 3 is a fraction of this current",
                ),
            ],
        },
        ..Mit::SPEC
    },
    reply: Reply::Damiao,
};

impl Mit {
    /// Specification of drives without readable settings.
    const SPEC: Spec = Spec {
        bus: BusKind::Can,
        frames: Frames::Classic,
        nodes: 1..=255,
        shares_bus: true,
        fast_answer: None,
        keys: &["master"],
        watchdog: Watchdog::Any,
        current_limit: CurrentLimit::Unsupported {
            advice: "leave `current_limit` out, and set the limit in the drive with the manufacturer's tool: this protocol cannot transmit a limit",
        },
        gains: Gains::Commanded,
        has_velocity_mode: false,
        homing: OwnHoming { is_supported: false, moves: true, keys: &["order", "timeout"] },
    };

    const fn new(reply: Reply) -> Self {
        Self { spec: Self::SPEC, reply }
    }

    /// Returns the codec of a drive.
    pub(crate) fn codec(&self, setup: &DriveSetup<'_>) -> Drive {
        let entry = setup.entry;
        let usual = if self.reply == Reply::Damiao { 0x10 | u16::from(entry.node) } else { 0 };
        let reply_id = Id::Standard(entry.master.unwrap_or(usual));
        // the fields have these ranges, regardless of the limits of the drive
        let mut drive = Drive::new(entry.node, reply_id, self.reply, entry.ranges.ranges());
        drive.form = setup.form;
        drive
    }

    /// Returns the dialogue with a drive.
    pub(crate) fn dialogue(&self, setup: &DriveSetup<'_>) -> MitDialogue {
        let entry = setup.entry;
        let share = entry.current_limit.filter(|_| self.reply == Reply::Damiao);
        let share = share.zip(entry.full_current).map(|(limit, full)| limit / full);
        MitDialogue::new(self.codec(setup), entry.watchdog.ns, share)
    }
}

impl DriveProtocol for Mit {
    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn check_frames(&self, entry: &DriveEntry, _bus: &BusEntry) -> Result<(), Refusal> {
        let has_gains = entry.ranges.kp.is_some() || entry.ranges.kd.is_some();
        if has_gains && self.reply == Reply::Damiao {
            let advice = "leave `kp` and `kd` out, and let `ratio` scale them";
            return Err(("the gains of a Damiao drive are limited to 500 and 5".into(), advice));
        }
        Ok(())
    }

    fn check_current(&self, entry: &DriveEntry, limit: f64) -> Result<(), Refusal> {
        if entry.full_current.is_some_and(|full| limit / full >= 1.0) {
            return Err((
                format!("the current limit of {limit} A is not below `full_current`"),
                "write less than `full_current`: register 3 is a fraction below 1",
            ));
        }
        Ok(())
    }

    fn check_homing(&self, entry: &DriveEntry, _homing: &HomingEntry) -> Result<(), Refusal> {
        Err((
            format!("a homing by the drive is not supported by {:?}", entry.protocol),
            "write `by = \"stop\"`; the drive's command \"set zero\" is not used, because many of these drives store the zero permanently",
        ))
    }

    fn largest_damping(&self, entry: &DriveEntry) -> f64 {
        entry.ranges.ranges().kd.max
    }

    fn identifiers(&self, setup: &DriveSetup<'_>) -> Option<(Id, Id)> {
        let codec = self.codec(setup);
        Some((codec.id(), codec.reply_id))
    }

    fn is_command(&self, setup: &DriveSetup<'_>, frame: &Frame) -> bool {
        self.codec(setup).id() == frame.id
    }

    fn requests(&self) -> Vec<Frame> {
        if self.reply != Reply::Damiao {
            return Vec::new();
        }
        let registers = |node| Register::CHECKED.map(|register| Request { node, register }.frame());
        self.spec.nodes.clone().flat_map(registers).collect()
    }

    fn answer(&self, frame: &Frame) -> Option<Device> {
        if self.reply != Reply::Damiao {
            return None;
        }
        let (Id::Standard(master), [node, 0, _, register, ..]) = (frame.id, frame.data()) else {
            return None;
        };
        if frame.id == EVERYBODY {
            return None;
        }
        let register = *Register::CHECKED.iter().find(|known| **known as u8 == *register)?;
        let value = Request { node: *node, register }.value(frame, frame.id).ok()?;
        let (mut watchdog_ns, mut ranges) = (None, [None; 3]);
        match (register, value) {
            (_, Value::Watchdog(time)) => watchdog_ns = Some(time.unwrap_or(0)),
            (Register::PositionMax, Value::Number(max)) => ranges[0] = Some(max),
            (Register::VelocityMax, Value::Number(max)) => ranges[1] = Some(max),
            (_, Value::Number(max)) => ranges[2] = Some(max),
            // a drive in another mode is still found on the bus; enabling refuses it
            (_, Value::Mode(_)) => {}
        }
        Some(Device { node: *node, kind: DeviceKind::Damiao { master, watchdog_ns, ranges } })
    }

    fn exchange(&self, setup: &DriveSetup<'_>) -> (Shape, Shape) {
        (setup.shape(8), setup.shape(self.reply.length()))
    }

    fn simulated(&self, setup: &DriveSetup<'_>, overrides: Overrides) -> Box<dyn Simulated> {
        let mut codec = self.codec(setup);
        if let Some(torque) = overrides.torque {
            codec = codec.with_ranges(Ranges { torque: Range::symmetric(torque), ..*codec.ranges() });
        }
        let drive = SimulatedDrive::new(codec, setup.watchdog_ns(overrides));
        let full = setup.entry.full_current.zip(setup.entry.torque_constant);
        Box::new(match full {
            Some((current, constant)) => drive.with_full_torque(current * constant),
            None => drive,
        })
    }
}
