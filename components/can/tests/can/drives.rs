//! Adapter with simulated drives of every protocol on a simulated bus, without a runtime.

use motorium_can::adapter::{Adapter, Link, OnTrip, Phase, WrongSetting};
use motorium_can::bus::simulated::Event;
use motorium_can::drive::Fault;
use motorium_can::{AnySimulatedDrive, Overrides, Received, SimulatedBus, Table};
use motorium_drive::JointSetpoint;

const WATCHDOG_NS: u64 = 40_000_000;
const STEP_NS: u64 = 250_000;
/// Initial position of the shafts, rad.
const SHAFT: f64 = 0.5;

/// Protocol, with its specific keys.
pub(super) struct Case {
    pub(super) protocol: &'static str,
    pub(super) bus: &'static str,
    pub(super) more: &'static str,
    pub(super) cycle_ns: u64,
}

const CASES: [Case; 7] = [
    Case { protocol: "damiao", bus: "", more: "", cycle_ns: 1_000_000 },
    Case { protocol: "odrive", bus: "", more: "report_every = \"2 ms\"", cycle_ns: 2_000_000 },
    Case {
        protocol: "odrive",
        bus: "",
        more: "report_every = \"2 ms\"\nmode = \"torque\"",
        cycle_ns: 2_000_000,
    },
    Case {
        protocol: "cia402",
        bus: "",
        more: "increments = 65536.0\nrated_torque = 5.0",
        cycle_ns: 1_000_000,
    },
    Case {
        protocol: "cia402",
        bus: "",
        more: "increments = 65536.0\nrated_torque = 5.0\nmode = \"torque\"",
        cycle_ns: 1_000_000,
    },
    Case {
        protocol: "cia402",
        bus: "",
        more: "increments = 65536.0\nrated_torque = 5.0\nmode = \"velocity\"\nposition_loop = { kp = 100.0, kd = 5.0 }",
        cycle_ns: 1_000_000,
    },
    Case { protocol: "moteus", bus: "data_bitrate = 5_000_000", more: "", cycle_ns: 1_000_000 },
];
const FEETECH: Case = Case { protocol: "feetech", bus: "kind = \"serial\"", more: "", cycle_ns: 5_000_000 };
pub(super) const DYNAMIXEL: Case =
    Case { protocol: "dynamixel", bus: "kind = \"serial\"", more: "", cycle_ns: 5_000_000 };

fn all() -> impl Iterator<Item = Case> {
    CASES.into_iter().chain([FEETECH, DYNAMIXEL])
}

/// Two drives on a bus, and the adapter.
pub(super) struct Rig {
    pub(super) adapter: Adapter,
    bus: SimulatedBus,
    drives: [AnySimulatedDrive; 2],
    pub(super) cycle: u64,
    pub(super) cycle_ns: u64,
    /// The first drive does not send.
    pub(super) is_silent: bool,
    pub(super) is_old: bool,
    pub(super) torques: [f64; 2],
    /// Position of the shafts, rad.
    shaft: f64,
}

impl Rig {
    pub(super) fn new(case: &Case, overrides: Overrides) -> Self {
        let watchdog = if case.protocol == "feetech" { "0 s" } else { "40 ms" };
        let drive = |joint: &str, node: u8| {
            format!(
                "[[drive]]\njoint = \"{joint}\"\nbus = \"bus\"\nprotocol = \"{}\"\nnode = {node}\nwatchdog = \"{watchdog}\"\n\
                 ranges = {{ position = 3.14, velocity = 30.0, torque = 10.0 }}\n{}\n",
                case.protocol, case.more
            )
        };
        let bus = format!("[[bus]]\nname = \"bus\"\nbitrate = 1_000_000\n{}\n", case.bus);
        let table = Table::parse(&format!("{bus}{}{}", drive("a", 1), drive("b", 2))).unwrap();
        let mut adapter = Adapter::new(&table, &[0, 1], &[0.3, 0.3], OnTrip::Damp);
        adapter.set_cycle(case.cycle_ns);
        let mut drives = [
            AnySimulatedDrive::new(&table, 0, overrides),
            AnySimulatedDrive::new(&table, 1, Overrides::default()),
        ];
        // drives report the position of their last step
        drives.iter_mut().for_each(|drive| _ = drive.step(SHAFT, 0.0, 0));
        Self {
            adapter,
            bus: SimulatedBus::new(table.rates(0), 3, 64),
            drives,
            cycle: 0,
            cycle_ns: case.cycle_ns,
            is_silent: false,
            is_old: false,
            torques: [0.0; 2],
            shaft: SHAFT,
        }
    }

    pub(super) fn healthy(case: &Case) -> Self {
        let mut rig = Self::new(case, Overrides::default());
        rig.run(400);
        assert_eq!(rig.phases(), [Phase::Enabled; 2], "{} {:?}", case.protocol, rig.adapter.wrong_setting());
        rig
    }

    /// Runs cycles: the adapter sends, the bus and the drives advance step by step, the adapter collects.
    pub(super) fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            let begin_ns = self.cycle * self.cycle_ns;
            let mut frames = Vec::new();
            self.adapter.write(0, &mut frames);
            frames.iter().for_each(|frame| assert!(self.bus.enqueue(0, *frame, begin_ns)));
            self.adapter.sent(0, frames.len(), begin_ns);
            self.cycle += 1;
            for now_ns in (begin_ns..self.cycle * self.cycle_ns).step_by(STEP_NS as usize) {
                self.step(now_ns + STEP_NS);
            }
            self.adapter.end_cycle(true);
        }
    }

    fn step(&mut self, now_ns: u64) {
        let Self { bus, drives, adapter, is_silent, is_old, .. } = self;
        for (index, drive) in drives.iter_mut().enumerate() {
            drive.report(now_ns, &mut |frame, time_ns| {
                if index > 0 || !*is_silent {
                    bus.enqueue(index + 1, frame, time_ns);
                }
            });
        }
        while let Some(event) = bus.next(now_ns) {
            let Event::Delivered { sender, frame, time_ns } = event else { panic!("{event:?}") };
            if sender > 0 {
                for (index, drive) in drives.iter_mut().enumerate() {
                    drive.observe(&frame, &mut |answer| {
                        bus.enqueue(index + 1, answer, time_ns);
                    });
                }
                adapter.take(0, &Received { frame, time_ns });
                continue;
            }
            // servos with older firmware do not support fast reads
            let is_known = !*is_old || frame.data().get(7) != Some(&0x8a);
            for (index, drive) in drives.iter_mut().enumerate().filter(|_| is_known) {
                drive.receive(&frame, time_ns, &mut |answer| {
                    if index > 0 || !*is_silent {
                        bus.enqueue(index + 1, answer, time_ns + 50_000);
                    }
                });
            }
        }
        for (drive, torque) in drives.iter_mut().zip(&mut self.torques) {
            *torque = drive.step(self.shaft, 0.0, now_ns);
        }
    }

    fn phases(&self) -> Vec<Phase> {
        self.adapter.links().iter().map(Link::phase).collect()
    }
}

#[test]
fn drives_of_every_protocol_are_enabled_in_place() {
    for case in all() {
        let rig = Rig::healthy(&case);
        for link in rig.adapter.links() {
            let (protocol, counts) = (case.protocol, link.counts());
            assert!((link.state().0 - SHAFT).abs() < 1.6e-3, "{protocol}: {}", link.state().0);
            assert_eq!(
                (counts.missing, counts.late, counts.refused, counts.lost),
                (0, 0, 0, 0),
                "{protocol}"
            );
        }
        assert!(!rig.adapter.has_tripped() && rig.adapter.stray() == 0, "{}", case.protocol);
        assert!(rig.torques.iter().all(|torque| torque.abs() < 0.4), "{}: {:?}", case.protocol, rig.torques);
    }
}

#[test]
fn commands_move_the_shafts_towards_their_goals() {
    for case in all() {
        let mut rig = Rig::healthy(&case);
        let goal = |position: f64| JointSetpoint { position, kp: 4.0, kd: 0.1, ..JointSetpoint::default() };
        rig.adapter.set(0, goal(SHAFT + 0.02));
        rig.adapter.set(1, goal(SHAFT - 0.02));
        rig.run(20);
        let [forwards, backwards] = rig.torques;
        assert!(forwards > 0.05 && backwards < -0.05, "{}: {:?}", case.protocol, rig.torques);
        // gains of the command, if they reach the drive: 4 N m/rad at 20 mrad
        if case.more.contains("\"torque\"") || matches!(case.protocol, "damiao" | "moteus") {
            assert!((forwards - 0.08).abs() < 0.01, "{}: {forwards}", case.protocol);
        }
    }
}

#[test]
fn a_silent_drive_of_any_protocol_is_lost_in_three_cycles() {
    for case in all() {
        let mut rig = Rig::healthy(&case);
        rig.is_silent = true;
        // unsolicited reports are overdue a cycle later
        rig.run(5);
        let counts = rig.adapter.links()[0].counts();
        assert!(rig.adapter.has_tripped(), "{}: {counts:?}", case.protocol);
        assert_eq!(counts.lost, 1, "{}", case.protocol);
        assert_eq!(rig.adapter.links()[1].counts().missing, 0, "{}", case.protocol);
    }
}

#[test]
fn reenabled_drives_begin_at_their_moved_position() {
    for case in all() {
        let mut rig = Rig::healthy(&case);
        // moved to another position while unpowered
        rig.drives.iter_mut().for_each(AnySimulatedDrive::cut_power);
        rig.is_silent = true;
        rig.run(5);
        (rig.is_silent, rig.shaft) = (false, -1.0);
        // an ODrive reports its state each tenth of a second
        rig.run(150_000_000 / rig.cycle_ns);
        rig.adapter.resume();
        let cycles = 400;
        for cycle in 0..cycles {
            rig.run(1);
            let pulls = rig.torques.iter().any(|torque| torque.abs() > 0.4);
            assert!(!pulls, "{}, cycle {cycle}: {:?}", case.protocol, rig.torques);
        }
        assert_eq!(rig.phases(), [Phase::Enabled; 2], "{}", case.protocol);
    }
}

#[test]
fn a_drive_without_power_trips_until_resumed() {
    for case in all() {
        let mut rig = Rig::healthy(&case);
        rig.drives[0].cut_power();
        rig.is_silent = true;
        rig.run(5);
        rig.is_silent = false;
        // an ODrive reports its state each tenth of a second
        rig.run(150_000_000 / rig.cycle_ns);
        assert!(rig.adapter.has_tripped(), "{}", case.protocol);
        // a moteus follows any command, so it is damped
        assert!(!rig.drives[0].is_enabled() || case.protocol == "moteus", "{}", case.protocol);
        rig.adapter.resume();
        rig.run(400);
        assert_eq!(rig.phases(), [Phase::Enabled; 2], "{}", case.protocol);
        assert!(!rig.adapter.has_tripped(), "{}", case.protocol);
    }
}

#[test]
fn watchdog_releases_are_detected() {
    for case in &CASES {
        let mut rig = Rig::healthy(case);
        let killed_ns = rig.cycle * rig.cycle_ns;
        // the last command may have arrived a cycle before
        let safe_ns = killed_ns - rig.cycle_ns + WATCHDOG_NS - STEP_NS;
        for now_ns in (killed_ns..safe_ns).step_by(STEP_NS as usize) {
            rig.step(now_ns);
        }
        assert!(rig.drives.iter().all(AnySimulatedDrive::is_enabled), "{}: before its time", case.protocol);
        for now_ns in (safe_ns..killed_ns + WATCHDOG_NS + STEP_NS).step_by(STEP_NS as usize) {
            rig.step(now_ns);
        }
        assert!(!rig.drives.iter().any(AnySimulatedDrive::is_enabled), "{}", case.protocol);
        assert!(rig.drives.iter().all(|drive| drive.watchdog_trips() == 1), "{}", case.protocol);
        // the adapter resumes, and detects the disabled drives
        rig.cycle = 2 + (killed_ns + WATCHDOG_NS + STEP_NS) / rig.cycle_ns;
        rig.run(150_000_000 / rig.cycle_ns);
        assert!(
            rig.adapter.has_tripped() && !rig.drives.iter().any(AnySimulatedDrive::is_enabled),
            "{}",
            case.protocol
        );
        let fault = rig.adapter.links()[0].fault();
        assert_eq!(fault, Some(Fault::CommunicationLost), "{}", case.protocol);
        rig.adapter.resume();
        rig.run(400);
        assert_eq!(rig.phases(), [Phase::Enabled; 2], "{}", case.protocol);
    }
}

#[test]
fn watchdogs_act_after_a_hundred_interrupted_batches() {
    for case in &CASES {
        for run in 0..100 {
            let mut rig = Rig::healthy(case);
            rig.run(run % 7);
            let (begin_ns, mut frames) = (rig.cycle * rig.cycle_ns, Vec::new());
            rig.adapter.write(0, &mut frames);
            let sent = run as usize % (frames.len() + 1);
            frames[..sent].iter().for_each(|frame| assert!(rig.bus.enqueue(0, *frame, begin_ns)));
            // the last command is at most a cycle old, or arrives within a cycle from now
            let (soonest_ns, latest_ns) = (begin_ns - case.cycle_ns, begin_ns + case.cycle_ns);
            for now_ns in (begin_ns..latest_ns + WATCHDOG_NS + STEP_NS).step_by(STEP_NS as usize) {
                rig.step(now_ns);
                let acts_early = now_ns < soonest_ns + WATCHDOG_NS
                    && !rig.drives.iter().all(AnySimulatedDrive::is_enabled);
                assert!(!acts_early, "{}, run {run}: before its time", case.protocol);
            }
            let have_let_go =
                rig.drives.iter().all(|drive| !drive.is_enabled() && drive.watchdog_trips() == 1);
            assert!(have_let_go, "{}, run {run}", case.protocol);
        }
    }
}

#[test]
fn a_canopen_drive_with_other_settings_is_not_enabled() {
    let no_watchdog = Overrides { watchdog_ns: Some(0), ..Overrides::default() };
    let stronger = Overrides { torque: Some(7.5), ..Overrides::default() };
    for overrides in [no_watchdog, stronger] {
        let mut rig = Rig::new(&CASES[3], overrides);
        rig.run(200);
        assert!(!rig.drives.iter().any(AnySimulatedDrive::is_enabled));
        let expected = match overrides.torque {
            Some(found) => WrongSetting::RatedTorque { found, expected: 5.0 },
            None => WrongSetting::Watchdog { found: None, expected: WATCHDOG_NS },
        };
        assert_eq!(rig.adapter.wrong_setting(), Some((0, expected)));
    }
}

#[test]
fn a_dynamixel_watchdog_stops_it_until_checked() {
    let mut rig = Rig::healthy(&DYNAMIXEL);
    let killed_ns = rig.cycle * rig.cycle_ns;
    // the last packet arrived at the end of the last cycle's commands
    for now_ns in (killed_ns..killed_ns + WATCHDOG_NS + STEP_NS).step_by(STEP_NS as usize) {
        rig.step(now_ns);
    }
    assert!(!rig.drives.iter().any(AnySimulatedDrive::is_enabled));
    assert!(rig.drives.iter().all(|drive| drive.watchdog_trips() == 1));
    rig.shaft = SHAFT + 0.03;
    rig.step(killed_ns + WATCHDOG_NS + 2 * STEP_NS);
    assert!(rig.torques.iter().all(|torque| *torque < -5.0), "it holds its position: {:?}", rig.torques);
    // goals are refused until the checks of a resumed adapter set the watchdog again
    rig.cycle = 2 + (killed_ns + WATCHDOG_NS) / rig.cycle_ns;
    rig.run(5);
    assert!(!rig.drives.iter().any(AnySimulatedDrive::is_enabled));
    rig.adapter.trip();
    rig.adapter.resume();
    rig.run(50);
    assert!(rig.drives.iter().all(AnySimulatedDrive::is_enabled));
    assert!(rig.torques.iter().all(|torque| torque.abs() < 0.4), "{:?}", rig.torques);
}

#[test]
fn a_dynamixel_with_a_fixed_watchdog_is_not_enabled() {
    let keeps = Overrides { watchdog_ns: Some(100_000_000), ..Overrides::default() };
    let mut rig = Rig::new(&DYNAMIXEL, keeps);
    rig.run(50);
    let wrong = WrongSetting::Watchdog { found: Some(100_000_000), expected: WATCHDOG_NS };
    assert_eq!(rig.adapter.wrong_setting(), Some((0, wrong)));
    assert!(!rig.drives[0].is_enabled());
}

/// Runs the adapter of one drive with a table, and simulates the drive of the same table or of another one.
/// Returns `true` if the drive is enabled, and the mismatched setting.
pub(super) fn follow(table: &Table, drive: Option<&Table>) -> (bool, Option<WrongSetting>) {
    let mut adapter = Adapter::new(table, &[0], &[0.3], OnTrip::Damp);
    let mut drive = AnySimulatedDrive::new(drive.unwrap_or(table), 0, Overrides::default());
    for cycle in 0..200_u64 {
        let mut frames = Vec::new();
        adapter.write(0, &mut frames);
        adapter.sent(0, frames.len(), cycle * 1_000_000);
        for (frame, time_ns) in frames.iter().zip(cycle * 1_000_000 + 300_000..) {
            drive.receive(frame, time_ns, &mut |answer| {
                adapter.take(0, &Received { frame: answer, time_ns: time_ns + 300_000 });
            });
        }
        drive.step(SHAFT, 0.0, (cycle + 1) * 1_000_000);
        adapter.end_cycle(true);
    }
    let wrong = adapter.wrong_setting().map(|(_, wrong)| wrong);
    (adapter.links()[0].phase() == Phase::Enabled, wrong)
}

#[test]
fn the_adapter_closes_the_position_loop_in_velocity_mode() {
    let mut rig = Rig::healthy(&CASES[5]);
    assert!(CASES[5].more.contains("velocity"));
    // 20 mrad at 100 / 5 = 20 1/s are 0.4 rad/s, which times 5 N m s/rad is 2 N m; the commanded velocity is
    // added
    for (velocity, kp, torque) in [(0.0, 4.0, 2.0), (0.1, 4.0, 2.5), (0.3, 0.0, 1.5), (0.0, 0.0, 0.0)] {
        let goal =
            JointSetpoint { position: SHAFT + 0.02, velocity, kp, kd: 0.1, ..JointSetpoint::default() };
        rig.adapter.set(0, goal);
        rig.run(20);
        assert!((rig.torques[0] - torque).abs() < 0.02, "{velocity} {kp}: {}", rig.torques[0]);
    }
}
