//! Specification of ODrives.

use core::f64::consts::TAU;

use super::codec::{Node, Report};
use super::dialogue::Odrive as OdriveDialogue;
use super::simulated::Odrive as SimulatedOdrive;
use crate::bus::budget::Shape;
use crate::frame::{Frame, Id};
use crate::protocols::device::{Device, DeviceKind};
use crate::protocols::entries::{BusKind, ControlMode, DriveEntry, HomingEntry};
use crate::protocols::simulation::{Overrides, Simulated};
use crate::protocols::spec::{
    CurrentLimit, DriveProtocol, DriveSetup, Frames, Gains, OwnHoming, Refusal, Spec, THOUSANDTHS,
    TORQUE_CONSTANT, Watchdog, beyond, require_current_limit,
};

/// CANSimple.
#[derive(Debug)]
pub(crate) struct Odrive {
    spec: Spec,
}

pub(crate) static ODRIVE: Odrive = Odrive {
    spec: Spec {
        bus: BusKind::Can,
        frames: Frames::Classic,
        nodes: 0..=63,
        shares_bus: false,
        fast_answer: None,
        keys: &["mode", "position_loop", "report_every", "torque_constant"],
        watchdog: Watchdog::Any,
        current_limit: CurrentLimit::Settable { keys: &[TORQUE_CONSTANT] },
        gains: Gains::InTorqueMode,
        has_velocity_mode: false,
        homing: OwnHoming { is_supported: true, moves: true, keys: &["order", "timeout", "procedure"] },
    },
};

impl Odrive {
    /// Returns the dialogue with a drive.
    pub(crate) fn dialogue(&self, setup: &DriveSetup<'_>) -> OdriveDialogue {
        OdriveDialogue::new(setup)
    }
}

impl DriveProtocol for Odrive {
    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn check_fields(&self, entry: &DriveEntry) -> Result<(), Refusal> {
        if entry.mode.unwrap_or_default() != ControlMode::Position {
            return Ok(());
        }
        let field = "the field of its feed-forward";
        beyond("velocity", entry.ranges.velocity, "rad/s", THOUSANDTHS * TAU, field)
            .and_then(|()| beyond("torque", entry.ranges.torque, "N m", THOUSANDTHS, field))
    }

    fn check_homing(&self, entry: &DriveEntry, _homing: &HomingEntry) -> Result<(), Refusal> {
        require_current_limit(entry)
    }

    fn is_command(&self, setup: &DriveSetup<'_>, frame: &Frame) -> bool {
        // reports of a drive use other command codes
        Node::new(setup.entry.node).is_some_and(|node| node.instruction(frame).is_ok())
    }

    fn heartbeat(&self, frame: &Frame) -> Option<Device> {
        let (Id::Standard(id), [.., result, encoder, flags]) = (frame.id, frame.data()) else { return None };
        // the last bytes contain the result of a procedure, or flags of motor, encoder, controller and
        // trajectory
        if id & 0x1f != 1 || *result >= 0x10 || *encoder >= 2 || flags & 0x7e != 0 {
            return None;
        }
        let node = (id >> 5) as u8;
        let Report::Heartbeat { error: errors, state, .. } = Node::new(node)?.report(frame).ok()? else {
            return None;
        };
        Some(Device { node, kind: DeviceKind::Odrive { state: state as u8, errors } })
    }

    fn refutes(&self, device: &Device, frame: &Frame) -> bool {
        // commands of other programs occasionally look like heartbeats; frames of an ODrive with this
        // identifier always are heartbeats
        matches!(device.kind, DeviceKind::Odrive { .. })
            && frame.id == Id::Standard(u16::from(device.node) << 5 | 1)
    }

    fn exchange(&self, setup: &DriveSetup<'_>) -> (Shape, Shape) {
        (setup.shape(8), setup.shape(8))
    }

    fn additional_frames(&self, setup: &DriveSetup<'_>) -> Vec<Shape> {
        // torques, the heartbeat, and temperatures
        vec![setup.shape(8); 3]
    }

    fn simulated(&self, setup: &DriveSetup<'_>, overrides: Overrides) -> Box<dyn Simulated> {
        Box::new(SimulatedOdrive::new(setup, setup.watchdog_ns(overrides)))
    }
}
