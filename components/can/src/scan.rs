//! Scan for devices on a bus: IDs, protocols and settings.

use core::time::Duration;

use crate::bus::{Bus, Received};
use crate::frame::{Form, Frame, Id};
use crate::protocols::definitions;
pub use crate::protocols::device::{Device, DeviceKind};
use crate::protocols::spec::DriveProtocol;

/// Result of a scan: devices found on a bus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// Devices, ordered by ID.
    pub devices: Vec<Device>,
    /// Identifiers and counts of frames from unknown devices.
    pub others: Vec<(Id, u64)>,
    /// Outcome of the search for CAN FD drives.
    pub fd: FdSearch,
    /// `true` if a classic CAN frame was received; its sender may not support CAN FD.
    has_classic: bool,
}

/// Outcome of a search for CAN FD drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FdSearch {
    /// The search was not requested.
    #[default]
    NotWanted,
    /// Every ID was queried, without an error on the bus.
    Complete {
        /// Number of IDs queried.
        asked: u8,
    },
    /// The search was skipped or stopped, because a device on the bus sends classic frames and may not
    /// support CAN FD.
    Classic {
        /// Number of IDs queried before the first classic frame; 0 if the search was skipped.
        asked: u8,
    },
    /// The search stopped because the bus reported an error.
    Disturbed {
        /// Number of IDs queried before the error was noticed.
        asked: u8,
    },
}

/// Finds the devices on a bus. The function reads the registers of Damiao drives, which has no side effects,
/// and listens for the heartbeats of ODrives and CANopen nodes. `pass` advances time on the bus by the given
/// duration.
///
/// If `has_errors` is given, the function then searches for moteus drives, by reading their registers with
/// CAN FD frames. `has_errors` returns `true` if the bus has reported an error since it was opened. A node
/// without CAN FD disturbs these frames, and the controller repeats them until it is bus-off. The search
/// therefore stops at the first classic frame or error, even before its first request. A silent classic node
/// remains undetected, so pass `has_errors` only if every node supports CAN FD.
///
/// ```no_run
/// use std::time::Duration;
/// use motorium_can::{SocketBus, scan};
///
/// let mut bus = SocketBus::open("can0")?;
/// let found = scan(&mut bus, None, Duration::from_secs(1), |_, time| std::thread::sleep(time));
/// for device in found.devices {
///     println!("{} {:?}", device.node, device.kind);
/// }
/// # Ok::<(), motorium_can::OpenError>(())
/// ```
pub fn scan<B: Bus>(
    bus: &mut B,
    has_errors: Option<&dyn Fn(&B) -> bool>,
    listen: Duration,
    mut pass: impl FnMut(&mut B, Duration),
) -> Found {
    const PAUSE: Duration = Duration::from_millis(2);
    let mut found = Found::default();
    for request in definitions().flat_map(DriveProtocol::requests) {
        bus.send(&[request]);
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
    if let Some(has_errors) = has_errors {
        found.fd = search_fd(bus, &mut found, has_errors, |bus| pass(bus, PAUSE));
    }
    found.devices.sort_by_key(|device| device.node);
    found.others.sort_by_key(|(id, _)| id.arbitration());
    found
}

/// Reads the settings of CAN FD drives.
fn search_fd<B: Bus>(
    bus: &mut B,
    found: &mut Found,
    has_errors: &dyn Fn(&B) -> bool,
    mut pass: impl FnMut(&mut B),
) -> FdSearch {
    let mut asked = 0;
    for request in definitions().flat_map(DriveProtocol::fd_requests) {
        if has_errors(bus) {
            return FdSearch::Disturbed { asked };
        }
        if found.has_classic {
            return FdSearch::Classic { asked };
        }
        bus.send(&[request]);
        asked += 1;
        pass(bus);
        receive(bus, found);
    }
    for _ in 0..10 {
        pass(bus);
        receive(bus, found);
    }
    match has_errors(bus) {
        true => FdSearch::Disturbed { asked },
        false => FdSearch::Complete { asked },
    }
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
        self.has_classic |= frame.form == Form::Classic;
        if let Some(device) = definitions().find_map(|protocol| protocol.answer(frame)) {
            self.add(device);
        } else if let Some(device) =
            definitions().find_map(|protocol| protocol.heartbeat(frame)).filter(|_| !self.is_other(frame.id))
        {
            self.add(device);
        } else {
            let is_refuted = |device: &Device| definitions().any(|protocol| protocol.refutes(device, frame));
            self.devices.retain(|device| !is_refuted(device));
            match self.others.iter_mut().find(|(id, _)| *id == frame.id) {
                Some((_, count)) => *count += 1,
                None => self.others.push((frame.id, 1)),
            }
        }
    }

    /// Adds a device, or updates it if it is known.
    fn add(&mut self, device: Device) {
        let is_same = |known: &&mut Device| {
            known.node == device.node
                && core::mem::discriminant(&known.kind) == core::mem::discriminant(&device.kind)
        };
        match self.devices.iter_mut().find(is_same) {
            Some(known) => known.kind.update(device.kind),
            None => self.devices.push(device),
        }
    }

    /// Returns `true` if some frames with this identifier were not heartbeats.
    fn is_other(&self, id: Id) -> bool {
        self.others.iter().any(|(other, _)| *other == id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Command, PositionReference, Ranges};
    use crate::{AnySimulatedDrive, Overrides, Rates, SimulatedBus, SimulatedDrive, Table, mit};

    /// Bus with a Damiao drive, a moteus, an ODrive and a CANopen node that send heartbeats, and an unknown
    /// device.
    struct Desk {
        bus: SimulatedBus,
        drive: SimulatedDrive,
        moteus: AnySimulatedDrive,
        /// The devices that send classic frames are present: all except the moteus.
        has_classic: bool,
        /// Number of CAN FD frames sent.
        fd_frames: u32,
        /// Number of CAN FD frames after which a device sends a classic frame.
        classic_from: u32,
        /// Number of CAN FD frames after which the bus reports an error.
        errors_from: u32,
        now_ns: u64,
    }

    impl Bus for Desk {
        fn send(&mut self, frames: &[Frame]) -> usize {
            self.fd_frames += frames.iter().filter(|frame| frame.form != Form::Classic).count() as u32;
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
                let answer = self.drive.receive(&received.frame, received.time_ns);
                if let Some(answer) = answer.filter(|_| self.has_classic) {
                    self.bus.enqueue(1, answer, received.time_ns + 50_000);
                }
                let Self { bus, moteus, .. } = self;
                moteus.receive(&received.frame, received.time_ns, &mut |answer| {
                    bus.enqueue(1, answer, received.time_ns + 50_000);
                });
            }
            if self.fd_frames >= self.classic_from {
                self.bus.enqueue(2, Frame::classic(Id::Standard(0x555), &[1, 2]), self.now_ns);
            }
            if self.has_classic && self.now_ns.is_multiple_of(100_000_000) {
                let beat = |id, data: &[u8]| Frame::classic(Id::Standard(id), data);
                self.bus.enqueue(2, beat(0x061, &[0, 0, 0, 0, 8, 0, 0, 0]), self.now_ns);
                self.bus.enqueue(2, beat(0x705, &[5]), self.now_ns);
                self.bus.enqueue(2, beat(0x555, &[1, 2]), self.now_ns);
            }
        }
    }

    #[test]
    fn foreign_commands_are_not_odrive_heartbeats() {
        let (drive, mut found) =
            (mit::Drive::damiao(1, 0x11, Ranges::new(12.5, 30.0, 10.0)), Found::default());
        // the low byte of the gain covers all axis states, and the low byte of the torque covers all flags
        for step in 0..20_000_u32 {
            let kp = f64::from(step % 500);
            let (velocity, torque) = (f64::from(step % 60) - 30.0, f64::from(step % 19) - 9.0);
            let command = Command { position: f64::from(step % 25) - 12.0, velocity, kp, kd: 0.0, torque };
            found.take(&drive.command(&command));
        }
        assert_eq!(found.devices, []);
        assert_eq!(found.others, [(Id::Standard(1), 20_000)], "each of them, whatever it looked like");
    }

    /// moteus with ID 9, with the output as its position reference.
    fn moteus() -> AnySimulatedDrive {
        let table = "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\ndata_bitrate = 5_000_000\n[[drive]]\njoint = \"hip\"\nbus = \"can0\"\n\
                     protocol = \"moteus\"\nnode = 9\nwatchdog = \"20 ms\"\nranges = { position = 12.5, velocity = 30.0, torque = 8.0 }\n";
        AnySimulatedDrive::new(&Table::parse(table).unwrap(), 0, Overrides::default())
    }

    /// Desk with or without the drives that send heartbeats.
    fn desk(has_beats: bool) -> Desk {
        let codec = mit::Drive::damiao(4, 0x14, Ranges::new(12.5, 30.0, 10.0));
        let rates = Rates { nominal: 1_000_000, fast: 1_000_000 };
        let drive = SimulatedDrive::new(codec, Some(20_000_000));
        let bus = SimulatedBus::new(rates, 3, 64);
        Desk {
            bus,
            drive,
            moteus: moteus(),
            has_classic: has_beats,
            fd_frames: 0,
            classic_from: u32::MAX,
            errors_from: u32::MAX,
            now_ns: 0,
        }
    }

    fn scanned(desk: &mut Desk, is_fd: bool) -> Found {
        let has_errors = |desk: &Desk| desk.fd_frames >= desk.errors_from;
        let has_errors = is_fd.then_some(&has_errors as &dyn Fn(&Desk) -> bool);
        scan(desk, has_errors, Duration::from_millis(500), |desk, time| desk.pass(time))
    }

    #[test]
    fn devices_are_found_with_their_reported_settings() {
        let mut desk = desk(true);
        let found = scanned(&mut desk, false);
        let kinds: Vec<_> = found.devices.iter().map(|device| (device.node, device.kind.clone())).collect();
        let damiao = DeviceKind::Damiao {
            master: 0x14,
            watchdog_ns: Some(20_000_000),
            ranges: [Some(12.5), Some(30.0), Some(10.0)],
        };
        let expected = [
            (3, DeviceKind::Odrive { state: 8, errors: 0 }),
            (4, damiao),
            (5, DeviceKind::CanOpen { state: 5 }),
        ];
        assert_eq!(kinds, expected);
        assert!(matches!(found.others[..], [(Id::Standard(0x555), 2..)]), "{:?}", found.others);
        assert!(!desk.drive.is_enabled() && !desk.moteus.is_enabled());
        assert_eq!((found.fd, desk.fd_frames), (FdSearch::NotWanted, 0));
    }

    #[test]
    fn moteus_drives_are_found_without_classic_devices() {
        let mut desk = desk(false);
        let found = scanned(&mut desk, true);
        let kind =
            DeviceKind::Moteus { mode: "Stopped".into(), home: Some(PositionReference::Output), fault: 0 };
        assert_eq!(found.devices, [Device { node: 9, kind }]);
        assert_eq!((found.fd, desk.fd_frames), (FdSearch::Complete { asked: 126 }, 126));
        assert!(!desk.moteus.is_enabled());
    }

    #[test]
    fn can_fd_frames_avoid_buses_with_classic_devices() {
        let mut desk = desk(true);
        let found = scanned(&mut desk, true);
        assert_eq!((found.fd, desk.fd_frames), (FdSearch::Classic { asked: 0 }, 0));
        assert_eq!(found.devices.len(), 3, "the classic ones: {found:?}");
    }

    #[test]
    fn search_stopped_by_a_late_classic_frame_counts_its_requests() {
        for classic_from in [1, 40] {
            let mut desk = Desk { classic_from, ..desk(false) };
            let found = scanned(&mut desk, true);
            let FdSearch::Classic { asked } = found.fd else { panic!("{:?}", found.fd) };
            // The frame arrives within a request or two.
            assert!((classic_from..=classic_from + 2).contains(&desk.fd_frames), "{}", desk.fd_frames);
            assert_eq!(u32::from(asked), desk.fd_frames);
        }
    }

    #[test]
    fn no_can_fd_frame_follows_a_bus_error() {
        for errors_from in [0, 1, 5, 126] {
            let mut desk = Desk { errors_from, ..desk(false) };
            let found = scanned(&mut desk, true);
            assert_eq!(found.fd, FdSearch::Disturbed { asked: errors_from as u8 });
            assert_eq!(desk.fd_frames, errors_from);
        }
    }
}
