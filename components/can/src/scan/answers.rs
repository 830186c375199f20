//! Frames that identify devices.

use super::device::{Device, DeviceKind};
use crate::damiao::{EVERYBODY, Register, Request, Value};
use crate::frame::{Form, Frame, Id};
use crate::moteus;
use crate::odrive::{self, Report};

/// Answer of a Damiao drive about one of its registers.
pub(super) fn damiao(frame: &Frame) -> Option<Device> {
    let (Id::Standard(master), [node, 0, _, register, ..]) = (frame.id, frame.data()) else { return None };
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
        // a drive in another mode is still on the bus; enabling refuses it
        (_, Value::Mode(_)) => {}
    }
    Some(Device { node: *node, kind: DeviceKind::Damiao { master, watchdog_ns, ranges } })
}

/// Answer of a moteus.
pub(super) fn moteus(frame: &Frame) -> Option<Device> {
    let number = match frame.id {
        Id::Standard(id) => u32::from(id),
        Id::Extended(id) => id,
    };
    // only complete answers in CAN FD frames count: no other drive sends those
    let node =
        u8::try_from(number >> 8).ok().filter(|_| number & 0xff == 0 && frame.form != Form::Classic)?;
    let moteus::State { mode, home, fault, .. } = moteus::Node::new(node)?.reply(frame).ok()?;
    Some(Device { node, kind: DeviceKind::Moteus { mode, home, fault } })
}

/// Heartbeat of an ODrive or of a CANopen node.
pub(super) fn heartbeat(frame: &Frame) -> Option<Device> {
    let Id::Standard(id) = frame.id else { return None };
    match *frame.data() {
        [state] if (0x701..=0x77f).contains(&id) && matches!(state & 0x7f, 0 | 4 | 5 | 127) => {
            Some(Device { node: (id & 0x7f) as u8, kind: DeviceKind::CanOpen { state: state & 0x7f } })
        }
        // the last bytes are the result of a procedure, or flags of motor, encoder, controller and trajectory
        [.., result, encoder, flags]
            if id & 0x1f == 1 && result < 0x10 && encoder < 2 && flags & 0x7e == 0 =>
        {
            let node = (id >> 5) as u8;
            let Report::Heartbeat { error: errors, state, .. } =
                odrive::Node::new(node)?.report(frame).ok()?
            else {
                return None;
            };
            Some(Device { node, kind: DeviceKind::Odrive { state: state as u8, errors } })
        }
        _ => None,
    }
}
