//! Implausible readings, drives that are not enabled, and the end of a run: the adapter with one simulated
//! drive.

use motorium_can::adapter::{Adapter, Link, OnTrip, Phase, WrongSetting};
use motorium_can::bus::simulated::Event;
use motorium_can::cia402::{self, Emergency};
use motorium_can::drive::Fault;
use motorium_can::odrive::{self, Report};
use motorium_can::{AnySimulatedDrive, Frame, Overrides, Received, SimulatedBus, SimulatedDrive, Table};
use motorium_drive::JointSetpoint;

const CYCLE_NS: u64 = 1_000_000;

/// Protocol and additional keys of one drive of each family.
const FAMILIES: [(&str, &str); 5] = [
    ("damiao", ""),
    ("mini_cheetah", ""),
    ("odrive", "report_every = \"1 ms\""),
    ("cia402", "increments = 65536.0\nrated_torque = 5.0"),
    ("moteus", ""),
];

/// Change to a frame of the drive; `None` for a lost frame.
type Change = fn(&Frame) -> Option<Frame>;

/// One drive on a bus, and the adapter.
struct Rig {
    adapter: Adapter,
    bus: SimulatedBus,
    drive: AnySimulatedDrive,
    cycle: u64,
    shaft: f64,
    change: Change,
}

fn table(protocol: &str, more: &str) -> Table {
    let fast = if protocol == "moteus" { "data_bitrate = 5_000_000" } else { "" };
    let text = format!(
        "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n{fast}\n[[drive]]\njoint = \"a\"\nbus = \"can0\"\nprotocol = \"{protocol}\"\n\
         node = 5\nwatchdog = \"40 ms\"\nranges = {{ position = 12.5, velocity = 20.0, torque = 10.0 }}\n{more}\n"
    );
    Table::parse(&text).unwrap()
}

impl Rig {
    fn new(protocol: &str, more: &str) -> Self {
        Self::standing(protocol, more, 0.5)
    }

    /// Creates a rig with the shaft at this position.
    fn standing(protocol: &str, more: &str, shaft: f64) -> Self {
        let table = table(protocol, more);
        let adapter = Adapter::new(&table, &[0], &[0.3], OnTrip::Damp).with_limits(&[([-2.5, 2.5], 0.05)]);
        let mut drive = AnySimulatedDrive::new(&table, 0, Overrides::default());
        // the drive reports the position of its last step
        drive.step(shaft, 0.0, 0);
        Self {
            adapter,
            bus: SimulatedBus::new(table.rates(0), 2, 64),
            drive,
            cycle: 0,
            shaft,
            change: |frame| Some(*frame),
        }
    }

    fn enabled(protocol: &str, more: &str) -> Self {
        let mut rig = Self::new(protocol, more);
        rig.run(400);
        assert_eq!(rig.phase(), Phase::Enabled, "{protocol}: {:?}", rig.adapter.wrong_setting());
        rig
    }

    fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            let begin_ns = self.cycle * CYCLE_NS;
            self.cycle += 1;
            let mut frames = Vec::new();
            self.adapter.write(0, &mut frames);
            frames.iter().for_each(|frame| assert!(self.bus.enqueue(0, *frame, begin_ns)));
            self.adapter.sent(0, frames.len(), begin_ns);
            let Self { adapter, bus, drive, change, shaft, .. } = self;
            for now_ns in (1..=4).map(|step| begin_ns + step * CYCLE_NS / 4) {
                drive.report(now_ns, &mut |frame, time_ns| {
                    if let Some(frame) = change(&frame) {
                        bus.enqueue(1, frame, time_ns);
                    }
                });
                while let Some(event) = bus.next(now_ns) {
                    let Event::Delivered { sender, frame, time_ns } = event else { panic!("{event:?}") };
                    if sender > 0 {
                        adapter.take(0, &Received { frame, time_ns });
                        continue;
                    }
                    drive.receive(&frame, time_ns, &mut |answer| {
                        if let Some(answer) = change(&answer) {
                            bus.enqueue(1, answer, time_ns + 50_000);
                        }
                    });
                }
                drive.step(*shaft, 0.0, now_ns);
            }
            self.adapter.end_cycle(true);
        }
    }

    fn link(&self) -> &Link {
        &self.adapter.links()[0]
    }

    fn phase(&self) -> Phase {
        self.link().phase()
    }

    /// The adapter receives a frame now.
    fn receive(&mut self, frame: Frame) {
        self.adapter.take(0, &Received { frame, time_ns: self.cycle * CYCLE_NS });
    }
}

/// Passes all frames of an ODrive except its heartbeats.
fn without_heartbeat(frame: &Frame) -> Option<Frame> {
    let report = odrive::Node::new(5).unwrap().report(frame);
    (!matches!(report, Ok(Report::Heartbeat { .. }))).then_some(*frame)
}

#[test]
fn a_drive_outside_of_its_joints_range_is_not_enabled() {
    for (protocol, more) in FAMILIES {
        for (shaft, turns) in [(2.7, None), (-2.7, None), (0.5 + core::f64::consts::TAU, Some(-1))] {
            let mut rig = Rig::standing(protocol, more, shaft);
            rig.run(400);
            assert!(!rig.drive.is_enabled(), "{protocol} at {shaft}");
            let Some((0, WrongSetting::Position { found, turns: advised, .. })) = rig.adapter.wrong_setting()
            else {
                panic!("{protocol} at {shaft}: {:?}", rig.adapter.wrong_setting());
            };
            assert!((found - shaft).abs() < 2e-3 && advised == turns, "{protocol}: {found} {advised:?}");
        }
        // at the stop, slightly outside of the range
        let mut rig = Rig::standing(protocol, more, 2.53);
        rig.run(400);
        assert!(rig.drive.is_enabled(), "{protocol}: {:?}", rig.adapter.wrong_setting());
    }
}

#[test]
fn a_refused_position_names_range_and_correction() {
    let mut rig = Rig::standing("damiao", "offset = 6.283185307179586", 1.0);
    rig.run(20);
    let (_, wrong) = rig.adapter.wrong_setting().expect("it reads 7.28 rad");
    let text = wrong.to_string();
    for part in ["reads 7.283 rad", "-2.500 to 2.500", "margin 0.05", "`homing`", "`offset`", "`turns = -1`"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn turns_of_the_table_bring_a_drive_into_its_range() {
    let mut rig = Rig::enabled("damiao", "offset = 6.283185307179586\nturns = -1\nreversed = false");
    rig.run(10);
    assert!((rig.link().state().0 - 0.5).abs() < 1e-3, "{:?}", rig.link().state());
    // for a reversed drive, `turns` counts in the direction of the drive
    let table = table("damiao", "ratio = 4.0\nreversed = true\nturns = 2");
    assert!((table.transmission(0).to_joint(0.0) + core::f64::consts::PI).abs() < 1e-12);
}

#[test]
fn a_damiao_in_another_control_mode_is_not_enabled() {
    for mode in [0, 2, 3, 4] {
        let mut rig = Rig::new("damiao", "");
        let codec = table("damiao", "").drive(0).unwrap();
        let drive = SimulatedDrive::new(codec, Some(40_000_000)).with_control_mode(mode);
        rig.drive = AnySimulatedDrive::from(drive);
        rig.run(20);
        let wrong = rig.adapter.wrong_setting().map(|(_, wrong)| wrong.to_string());
        let expected = format!("the control mode (register 10) is {mode}, expected 1");
        assert_eq!(wrong.as_deref(), Some(expected.as_str()));
        assert!(!rig.drive.is_enabled());
    }
}

#[test]
fn a_cia402_drive_that_displays_another_mode_is_not_enabled() {
    let mut rig = Rig::new("cia402", FAMILIES[3].1);
    rig.change = |frame| {
        let mut data = frame.data().to_vec();
        if data.len() == 8 && data[1..4] == [0x61, 0x60, 0] {
            data[4] = 1;
        }
        Some(Frame::classic(frame.id, &data))
    };
    rig.run(60);
    assert_eq!(rig.adapter.wrong_setting(), None, "it may still change");
    rig.run(100);
    let wrong = rig.adapter.wrong_setting().map(|(_, wrong)| wrong.to_string());
    assert_eq!(wrong.as_deref(), Some("the control mode (object 0x6061) is 1, expected 8"));
    assert!(!rig.drive.is_enabled());
}

#[test]
fn an_odrive_without_heartbeat_is_lost() {
    for mode in ["", "\nmode = \"torque\""] {
        let mut rig = Rig::enabled("odrive", &format!("{}{mode}", FAMILIES[2].1));
        rig.change = without_heartbeat;
        rig.run(200);
        assert!(!rig.adapter.has_tripped(), "two heartbeats may be lost");
        rig.run(300);
        assert!(rig.adapter.has_tripped() && rig.link().counts().lost == 1, "{:?}", rig.link().counts());
    }
}

/// Passes all frames of a CANopen node except its heartbeats; a boot-up message is not a heartbeat.
fn without_beat(frame: &Frame) -> Option<Frame> {
    let beat = cia402::Node::new(5).unwrap().heartbeat(frame);
    beat.map_or(true, |state| state == cia402::NetworkState::BootUp).then_some(*frame)
}

#[test]
fn a_cia402_drive_whose_heartbeat_stops_is_lost() {
    let mut rig = Rig::enabled("cia402", FAMILIES[3].1);
    rig.run(900);
    rig.change = without_beat;
    rig.run(2000);
    assert!(!rig.adapter.has_tripped(), "one heartbeat may be lost");
    rig.run(500);
    assert!(rig.adapter.has_tripped() && rig.link().counts().lost == 1, "{:?}", rig.link().counts());
    // The heartbeat returns, and the operator decides.
    rig.change = |frame| Some(*frame);
    rig.adapter.resume();
    rig.run(1000);
    assert!(!rig.adapter.has_tripped() && rig.phase() == Phase::Enabled, "{:?}", rig.link().counts());
}

#[test]
fn a_cia402_drive_without_heartbeat_is_monitored() {
    let mut rig = Rig::new("cia402", FAMILIES[3].1);
    rig.change = without_beat;
    rig.run(4000);
    assert!(!rig.adapter.has_tripped() && rig.phase() == Phase::Enabled, "{:?}", rig.link().counts());
}

#[test]
fn an_odrive_that_never_sends_a_heartbeat_is_not_enabled() {
    let mut rig = Rig::new("odrive", FAMILIES[2].1);
    rig.change = without_heartbeat;
    rig.run(1000);
    assert_ne!(rig.phase(), Phase::Enabled);
    assert!(rig.link().counts().missing > 0);
}

#[test]
fn implausible_positions_are_refused_and_trip() {
    for wrong in [1e35, -1e35, 1e6, 9.0] {
        let mut rig = Rig::enabled("odrive", FAMILIES[2].1);
        let node = odrive::Node::new(5).unwrap();
        rig.receive(node.report_frame(&Report::Encoder { position: wrong, velocity: 0.0 }));
        assert_eq!((rig.link().counts().implausible, rig.link().counts().refused), (1, 1), "{wrong}");
        assert!((rig.link().state().0 - 0.5).abs() < 1e-3, "{wrong}: the last position is kept");
        rig.run(50);
        assert!(!rig.adapter.has_tripped(), "a single implausible position has no effect");
        // all frames from now on
        rig.change = |frame| {
            let node = odrive::Node::new(5).unwrap();
            match node.report(frame) {
                Ok(Report::Encoder { .. }) => {
                    Some(node.report_frame(&Report::Encoder { position: 1e35, velocity: 0.0 }))
                }
                _ => Some(*frame),
            }
        };
        rig.run(10);
        assert!(rig.adapter.has_tripped(), "{wrong}");
        assert!((rig.link().state().0 - 0.5).abs() < 1e-3);
        // while damped, the drive is held at its real position, not at the implausible one
        let mut frames = Vec::new();
        rig.adapter.write(0, &mut frames);
        if let Ok(odrive::Instruction::Position { position, .. }) = node.instruction(&frames[0]) {
            assert!((position - 0.5).abs() < 1e-3, "{position}");
        }
    }
}

#[test]
fn motion_within_the_velocity_limit_is_plausible() {
    for (protocol, more) in FAMILIES {
        let mut rig = Rig::enabled(protocol, more);
        rig.adapter.set(0, JointSetpoint::default());
        // 20 rad/s, up to the end of its range
        for _ in 0..95 {
            rig.shaft += 0.02;
            rig.run(1);
        }
        assert_eq!(rig.link().counts().implausible, 0, "{protocol}");
        assert!(!rig.adapter.has_tripped(), "{protocol}");
    }
}

#[test]
fn an_emergency_message_is_counted_and_trips() {
    let node = cia402::Node::new(5).unwrap();
    let mut rig = Rig::enabled("cia402", FAMILIES[3].1);
    // the end of an error, and a warning
    rig.receive(node.emergency_frame(&Emergency { code: 0, register: 0 }));
    assert_eq!(rig.link().counts().emergencies, 0);
    rig.receive(node.emergency_frame(&Emergency { code: 0xff01, register: 0 }));
    assert_eq!(rig.link().counts().emergencies, 1);
    rig.run(2);
    assert!(!rig.adapter.has_tripped(), "no error is present");
    for _ in 0..5 {
        rig.receive(node.emergency_frame(&Emergency { code: 0x2310, register: 3 }));
    }
    assert!(rig.adapter.has_tripped());
    assert_eq!(rig.link().counts().emergencies, 6);
    assert_eq!(rig.link().fault(), Some(Fault::OverCurrent));
    assert_eq!(rig.adapter.stray(), 0);
}

#[test]
fn a_simulated_cia402_drive_has_the_mandatory_objects() {
    let node = cia402::Node::new(5).unwrap();
    let mut drive = AnySimulatedDrive::new(&table("cia402", FAMILIES[3].1), 0, Overrides::default());
    let mut ask = |service: cia402::Service| {
        let mut result = None;
        drive.receive(&node.service(&service), 0, &mut |answer| {
            result = Some(node.service_result(&service, &answer));
        });
        result.expect("an answer")
    };
    let object = |index, subindex| cia402::Object { index, subindex };
    for (index, subindex, value) in [
        (0x1000, 0, 0x2_0192),
        (0x1001, 0, 0),
        (0x1018, 0, 4),
        (0x1018, 1, 0),
        (0x6040, 0, 0),
        (0x6041, 0, 0x250),
    ] {
        let found = ask(cia402::Service::Read(object(index, subindex)));
        assert_eq!(found.map(|found| found.map(cia402::Value::number)), Ok(Some(value)), "0x{index:X}");
    }
    let refused = ask(cia402::Service::Write(cia402::Object::MODE, cia402::Value::byte(99)));
    assert_eq!(refused, Err(motorium_can::DecodeError::Refused { code: 0x0609_0030 }));
}

#[test]
fn drives_of_every_family_are_disabled_at_the_end() {
    for (protocol, more) in FAMILIES {
        let mut rig = Rig::enabled(protocol, more);
        rig.adapter.release();
        assert!(!rig.adapter.is_released(), "{protocol}: no answer yet");
        rig.run(200);
        assert!(!rig.drive.is_enabled() && rig.adapter.is_released(), "{protocol}");
        assert!(!rig.adapter.has_tripped() && rig.link().counts().faults == 0, "{protocol}");
    }
}

#[test]
fn an_observer_measures_and_enables_no_drive() {
    for (protocol, more) in FAMILIES {
        let mut rig = Rig::new(protocol, more);
        let damping = [0.3];
        rig.adapter = Adapter::new(&table(protocol, more), &[0], &damping, OnTrip::Damp).observer();
        for _ in 0..800 {
            rig.run(1);
            assert!(!rig.drive.has_torque(), "{protocol}");
        }
        // moved by hand
        for _ in 0..100 {
            rig.shaft += 0.005;
            rig.run(1);
        }
        rig.run(3);
        assert!((rig.link().state().0 - 1.0).abs() < 2e-3, "{protocol}: {:?}", rig.link().state());
        assert!(rig.adapter.is_complete() && !rig.adapter.has_tripped(), "{protocol}");
    }
}
