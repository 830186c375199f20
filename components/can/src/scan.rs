//! The devices on a bus: who answers, by which protocol, with which settings.

use core::time::Duration;

use crate::bus::{Bus, Received};
use crate::damiao::{EVERYBODY, Register, Request, Value};
use crate::frame::{Form, Frame, Id};
use crate::moteus::{self, Home, Mode, Resolution};
use crate::odrive::{self, Report};

/// A device that was found on a bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// Its number on the bus.
    pub node: u8,
    /// Kind of the drive.
    pub kind: DeviceKind,
}

/// The kind of a device.
#[derive(Clone, Debug, PartialEq)]
pub enum DeviceKind {
    /// A Damiao drive, which tells its settings.
    Damiao {
        /// The identifier of its answers.
        master: u16,
        /// Its watchdog, ns, 0 for off; `None` if it did not tell.
        watchdog_ns: Option<u64>,
        /// The ends of its ranges: position (rad), velocity (rad/s), torque (N m); `None` for one that it did not tell.
        ranges: [Option<f64>; 3],
    },
    /// An ODrive: its heartbeat, with the state and the errors of its axis.
    Odrive {
        /// State of the axis: 1 idle, 8 closed loop.
        state: u8,
        /// Errors of the axis.
        errors: u32,
    },
    /// A CANopen node: its heartbeat, with its state.
    CanOpen {
        /// State: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational.
        state: u8,
    },
    /// A moteus, which tells its state.
    Moteus {
        /// Its mode.
        mode: Mode,
        /// The place from which it counts its position, if it tells.
        home: Option<Home>,
        /// Code of its fault.
        fault: u8,
    },
}

/// Drives found on a bus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// The devices, by their numbers.
    pub devices: Vec<Device>,
    /// Identifiers of frames that belong to none of them, and how many there were.
    pub others: Vec<(Id, u64)>,
}

/// Finds the devices on a bus. Reads the registers of Damiao drives and, on a bus of CAN FD (`is_fd`), of moteus, which changes
/// nothing, and listens for the heartbeats of ODrives and CANopen nodes. `pass` lets time pass.
///
/// ```no_run
/// use std::time::Duration;
/// use motorium_can::{SocketBus, scan};
///
/// let mut bus = SocketBus::open("can0")?;
/// let found = scan(&mut bus, false, Duration::from_secs(1), |_, time| std::thread::sleep(time));
/// for device in found.devices {
///     println!("{} {:?}", device.node, device.kind);
/// }
/// # Ok::<(), motorium_can::OpenError>(())
/// ```
pub fn scan<B: Bus>(
    bus: &mut B,
    is_fd: bool,
    listen: Duration,
    mut pass: impl FnMut(&mut B, Duration),
) -> Found {
    const PAUSE: Duration = Duration::from_millis(2);
    let mut found = Found::default();
    for node in 1..=0xf {
        for register in Register::CHECKED {
            let request = Request { node, register };
            bus.send(&[request.frame()]);
            pass(bus, PAUSE);
            receive(bus, &mut found);
        }
    }
    for node in (1..=126).filter_map(moteus::Node::new).filter(|_| is_fd) {
        bus.send(&[node.frame(&moteus::Instruction::Query, Resolution::Int16)]);
        pass(bus, PAUSE);
        receive(bus, &mut found);
    }
    let mut left = listen;
    while !left.is_zero() {
        let pause = left.min(Duration::from_millis(10));
        pass(bus, pause);
        receive(bus, &mut found);
        left -= pause;
    }
    found.devices.sort_by_key(|device| device.node);
    found.others.sort_by_key(|(id, _)| id.arbitration());
    found
}

fn receive(bus: &mut impl Bus, found: &mut Found) {
    let mut inbox = [Received::default(); 32];
    loop {
        let count = bus.receive(&mut inbox);
        for received in &inbox[..count] {
            found.take(&received.frame);
        }
        if count < inbox.len() {
            return;
        }
    }
}

impl Found {
    fn take(&mut self, frame: &Frame) {
        if let Some(device) = damiao(frame) {
            let kind = |device: &Device| matches!(device.kind, DeviceKind::Damiao { .. });
            match self.devices.iter_mut().find(|known| known.node == device.node && kind(known)) {
                Some(known) => known.kind.complete(device.kind),
                None => self.devices.push(device),
            }
        } else if let Some(device) = moteus(frame) {
            self.devices.retain(|known| {
                known.node != device.node || !matches!(known.kind, DeviceKind::Moteus { .. })
            });
            self.devices.push(device);
        } else if let Some(device) = heartbeat(frame).filter(|_| !self.is_other(frame.id)) {
            let same = |known: &Device| {
                known.node == device.node
                    && core::mem::discriminant(&known.kind) == core::mem::discriminant(&device.kind)
            };
            match self.devices.iter_mut().find(|known| same(known)) {
                Some(known) => *known = device,
                None => self.devices.push(device),
            }
        } else {
            // commands of another program look like heartbeats now and then; those of an ODrive are heartbeats always
            self.devices.retain(|device| {
                !(matches!(device.kind, DeviceKind::Odrive { .. })
                    && frame.id == Id::Standard(u16::from(device.node) << 5 | 1))
            });
            match self.others.iter_mut().find(|(id, _)| *id == frame.id) {
                Some((_, count)) => *count += 1,
                None => self.others.push((frame.id, 1)),
            }
        }
    }

    /// True if frames with this identifier have been something else than a heartbeat.
    fn is_other(&self, id: Id) -> bool {
        self.others.iter().any(|(other, _)| *other == id)
    }
}

impl DeviceKind {
    /// Takes what the other one tells.
    fn complete(&mut self, other: Self) {
        let (
            Self::Damiao { watchdog_ns, ranges, .. },
            Self::Damiao { watchdog_ns: told, ranges: told_ranges, .. },
        ) = (self, other)
        else {
            return;
        };
        *watchdog_ns = watchdog_ns.or(told);
        for (range, told) in ranges.iter_mut().zip(told_ranges) {
            *range = range.or(told);
        }
    }
}

/// The answer of a Damiao drive about one of its registers.
fn damiao(frame: &Frame) -> Option<Device> {
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
    }
    Some(Device { node: *node, kind: DeviceKind::Damiao { master, watchdog_ns, ranges } })
}

/// The answer of a moteus.
fn moteus(frame: &Frame) -> Option<Device> {
    let number = match frame.id {
        Id::Standard(id) => u32::from(id),
        Id::Extended(id) => id,
    };
    // whole and in frames of CAN FD only: no other drive sends such
    let node =
        u8::try_from(number >> 8).ok().filter(|_| number & 0xff == 0 && frame.form != Form::Classic)?;
    let moteus::State { mode, home, fault, .. } = moteus::Node::new(node)?.reply(frame).ok()?;
    Some(Device { node, kind: DeviceKind::Moteus { mode, home, fault } })
}

/// The heartbeat of an ODrive or of a CANopen node.
fn heartbeat(frame: &Frame) -> Option<Device> {
    let Id::Standard(id) = frame.id else { return None };
    match *frame.data() {
        [state] if (0x701..=0x77f).contains(&id) && matches!(state & 0x7f, 0 | 4 | 5 | 127) => {
            Some(Device { node: (id & 0x7f) as u8, kind: DeviceKind::CanOpen { state: state & 0x7f } })
        }
        // the last bytes are the result of a procedure, or flags: of motor, encoder, controller, and of a trajectory
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mit::Ranges;
    use crate::{AnySimulatedDrive, Overrides, Rates, SimulatedBus, SimulatedDrive, Table, mit};

    /// A bus with one Damiao drive, a moteus, an ODrive and a CANopen node that beat, and a stranger.
    struct Desk {
        bus: SimulatedBus,
        drive: SimulatedDrive,
        moteus: AnySimulatedDrive,
        now_ns: u64,
    }

    impl Bus for Desk {
        fn send(&mut self, frames: &[Frame]) -> usize {
            self.bus.port(0, self.now_ns).send(frames)
        }

        fn receive(&mut self, frames: &mut [Received]) -> usize {
            self.bus.port(0, self.now_ns).receive(frames)
        }
    }

    impl Desk {
        fn pass(&mut self, time: Duration) {
            let mut inbox = [Received::default(); 8];
            self.now_ns += time.as_nanos() as u64;
            let heard = self.bus.port(1, self.now_ns).receive(&mut inbox);
            for received in &inbox[..heard] {
                if let Some(answer) = self.drive.receive(&received.frame, received.time_ns) {
                    self.bus.enqueue(1, answer, received.time_ns + 50_000);
                }
                let Self { bus, moteus, .. } = self;
                moteus.receive(&received.frame, received.time_ns, &mut |answer| {
                    bus.enqueue(1, answer, received.time_ns + 50_000);
                });
            }
            if self.now_ns.is_multiple_of(100_000_000) {
                let beat = |id, data: &[u8]| Frame::classic(Id::Standard(id), data);
                self.bus.enqueue(2, beat(0x061, &[0, 0, 0, 0, 8, 0, 0, 0]), self.now_ns);
                self.bus.enqueue(2, beat(0x705, &[5]), self.now_ns);
                self.bus.enqueue(2, beat(0x555, &[1, 2]), self.now_ns);
            }
        }
    }

    #[test]
    fn commands_of_another_program_on_a_live_bus_are_no_heartbeats_of_an_odrive() {
        let (drive, mut found) =
            (mit::Drive::damiao(1, 0x11, Ranges::new(12.5, 30.0, 10.0)), Found::default());
        // the low byte of the gain passes all states of an axis, and that of the torque all flags
        for step in 0..20_000_u32 {
            let kp = f64::from(step % 500);
            let (velocity, torque) = (f64::from(step % 60) - 30.0, f64::from(step % 19) - 9.0);
            let command =
                mit::Command { position: f64::from(step % 25) - 12.0, velocity, kp, kd: 0.0, torque };
            found.take(&drive.command(&command));
        }
        assert_eq!(found.devices, []);
        assert_eq!(found.others, [(Id::Standard(1), 20_000)], "each of them, whatever it looked like");
    }

    /// A moteus with the number 9, which counts from its output.
    fn moteus() -> AnySimulatedDrive {
        let table = "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\ndata_bitrate = 5_000_000\n[[drive]]\njoint = \"hip\"\nbus = \"can0\"\n\
                     protocol = \"moteus\"\nnode = 9\nwatchdog = \"20 ms\"\nranges = { position = 12.5, velocity = 30.0, torque = 8.0 }\n";
        AnySimulatedDrive::new(&Table::parse(table).unwrap(), 0, Overrides::default())
    }

    #[test]
    fn devices_are_found_with_what_they_tell_of_themselves() {
        for is_fd in [true, false] {
            devices_are_found(is_fd);
        }
    }

    fn devices_are_found(is_fd: bool) {
        let codec = mit::Drive::damiao(4, 0x14, Ranges::new(12.5, 30.0, 10.0));
        let rates = Rates { nominal: 1_000_000, fast: 1_000_000 };
        let drive = SimulatedDrive::new(codec, Some(20_000_000));
        let mut desk = Desk { bus: SimulatedBus::new(rates, 3, 64), drive, moteus: moteus(), now_ns: 0 };
        let found = scan(&mut desk, is_fd, Duration::from_millis(500), |desk, time| desk.pass(time));
        let kinds: Vec<_> = found.devices.iter().map(|device| (device.node, device.kind.clone())).collect();
        let damiao = DeviceKind::Damiao {
            master: 0x14,
            watchdog_ns: Some(20_000_000),
            ranges: [Some(12.5), Some(30.0), Some(10.0)],
        };
        let mut expected = vec![
            (3, DeviceKind::Odrive { state: 8, errors: 0 }),
            (4, damiao),
            (5, DeviceKind::CanOpen { state: 5 }),
        ];
        if is_fd {
            let moteus = DeviceKind::Moteus { mode: Mode::Stopped, home: Some(Home::Output), fault: 0 };
            expected.push((9, moteus));
        }
        assert_eq!(kinds, expected);
        assert!(matches!(found.others[..], [(Id::Standard(0x555), 2..)]), "{:?}", found.others);
        assert!(!desk.drive.is_enabled() && !desk.moteus.is_enabled());
    }
}
