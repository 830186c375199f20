//! Specification of moteus drives.

use core::f64::consts::TAU;

use super::codec::{Instruction, Node, Resolution, State};
use super::dialogue::Moteus as MoteusDialogue;
use super::simulated::Moteus as SimulatedMoteus;
use crate::bus::budget::Shape;
use crate::drive::Ranges;
use crate::frame::{Form, Frame, Id};
use crate::protocols::device::{Device, DeviceKind};
use crate::protocols::entries::{BusEntry, BusKind, DriveEntry, HomingEntry};
use crate::protocols::simulation::{Overrides, Simulated};
use crate::protocols::spec::{
    CurrentLimit, DriveProtocol, DriveSetup, Frames, Gains, OwnHoming, Refusal, Spec, Watchdog,
};

/// Registers over CAN FD.
#[derive(Debug)]
pub(crate) struct Moteus {
    spec: Spec,
}

pub(crate) static MOTEUS: Moteus = Moteus {
    spec: Spec {
        bus: BusKind::Can,
        frames: Frames::Fd,
        // 127 is the adapter's own
        nodes: 1..=126,
        shares_bus: true,
        fast_answer: None,
        keys: &["position_loop", "reference"],
        watchdog: Watchdog::Units {
            unit_ns: 1_000_000,
            most: 32_767,
            advice: "write whole milliseconds, up to 32767, the unit of its commands",
        },
        current_limit: CurrentLimit::Unsupported {
            advice: "leave `current_limit` out: each command to a moteus contains `ranges.torque` as a limit",
        },
        gains: Gains::Commanded,
        has_velocity_mode: false,
        homing: OwnHoming { is_supported: false, moves: true, keys: &["order", "timeout"] },
    },
};

/// Largest values of 16-bit registers: position and velocity (converted from turns and turns per second) and
/// torque.
const MOST: [f64; 3] = [3.2767 * TAU, 8.19175 * TAU, 327.67];

impl Moteus {
    /// Returns the dialogue with a drive.
    pub(crate) fn dialogue(&self, setup: &DriveSetup<'_>) -> MoteusDialogue {
        MoteusDialogue::new(setup)
    }
}

impl DriveProtocol for Moteus {
    fn spec(&self) -> &Spec {
        &self.spec
    }

    /// Refuses ranges beyond the registers, which would clamp larger values.
    fn check_frames(&self, entry: &DriveEntry, bus: &BusEntry) -> Result<(), Refusal> {
        if bus.data_bitrate.is_none() {
            let message = format!("moteus drives cannot be on the classic bus `{}`", bus.name);
            let advice = "moteus requires CAN FD: give the bus a `data_bitrate`, usually 5_000_000";
            return Err((message, advice));
        }
        let ranges = [entry.ranges.position, entry.ranges.velocity, entry.ranges.torque];
        let names = [("position", "rad"), ("velocity", "rad/s"), ("torque", "N m")];
        let beyond = ranges.into_iter().zip(MOST).zip(names).find(|((value, most), _)| value > most);
        beyond.map_or(Ok(()), |((value, most), (name, unit))| {
            let message = format!(
                "the {name} is {value} {unit}, but the registers of a moteus are limited to {most:.2}"
            );
            Err((message, "reduce it; `ratio` is the ratio of the joint to the output of the drive"))
        })
    }

    fn check_homing(&self, _entry: &DriveEntry, _homing: &HomingEntry) -> Result<(), Refusal> {
        Err((
            "a homing by the drive is not supported by moteus".into(),
            "a moteus with an output encoder needs no homing: leave `homing` out; otherwise write `by = \"stop\"`",
        ))
    }

    fn limited(&self, entry: &DriveEntry, ranges: Ranges) -> Ranges {
        // its commands contain fractions, at most 1, of the gains stored in the drive
        let gains = entry.loop_gains();
        ranges.with_gains(ranges.kp.max.min(gains.kp), ranges.kd.max.min(gains.kd))
    }

    fn largest_damping(&self, entry: &DriveEntry) -> f64 {
        entry.loop_gains().kd
    }

    fn identifiers(&self, setup: &DriveSetup<'_>) -> Option<(Id, Id)> {
        Node::new(setup.entry.node).map(|node| (node.id(), node.reply_id()))
    }

    fn is_command(&self, setup: &DriveSetup<'_>, frame: &Frame) -> bool {
        let number = match frame.id {
            Id::Standard(id) => u32::from(id),
            Id::Extended(id) => id,
        };
        number & 0xff == u32::from(setup.entry.node)
    }

    fn fd_requests(&self) -> Vec<Frame> {
        let query = |node: Node| node.frame(&Instruction::Query, Resolution::Int16);
        self.spec.nodes.clone().filter_map(Node::new).map(query).collect()
    }

    fn answer(&self, frame: &Frame) -> Option<Device> {
        let number = match frame.id {
            Id::Standard(id) => u32::from(id),
            Id::Extended(id) => id,
        };
        // only complete answers in CAN FD frames count, because no other drive sends them
        let node =
            u8::try_from(number >> 8).ok().filter(|_| number & 0xff == 0 && frame.form != Form::Classic)?;
        let State { mode, home, fault, .. } = Node::new(node)?.reply(frame).ok()?;
        Some(Device { node, kind: DeviceKind::Moteus { mode: format!("{mode:?}"), home, fault } })
    }

    fn exchange(&self, setup: &DriveSetup<'_>) -> (Shape, Shape) {
        (Shape { extended: true, ..setup.shape(32) }, setup.shape(20))
    }

    fn simulated(&self, setup: &DriveSetup<'_>, overrides: Overrides) -> Box<dyn Simulated> {
        Box::new(SimulatedMoteus::new(setup, setup.watchdog_ns(overrides)))
    }
}
