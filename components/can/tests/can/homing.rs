//! Homing of joints whose position is unknown after power-up, by drives of every family and at mechanical
//! stops.

use motorium_can::adapter::{Adapter, HomingState, Link, OnTrip, Phase};
use motorium_can::bus::simulated::Event;
use motorium_can::{AnySimulatedDrive, Overrides, Received, SimulatedBus, Table};

pub(super) const STEP_NS: u64 = 250_000;
pub(super) const CYCLE_NS: u64 = 2_000_000;
/// Largest effort of a homing at a stop, N m.
pub(super) const EFFORT: f64 = 1.2;
/// Position of the lower stop, rad.
pub(super) const STOP: f64 = -0.8;

/// Drive family with its specific keys.
pub(super) struct Case {
    pub(super) name: &'static str,
    pub(super) bus: &'static str,
    pub(super) drive: &'static str,
    pub(super) homing: &'static str,
}

const AT_STOP: &str = "homing = { by = \"stop\", velocity = -0.5, effort = 1.2, position = -0.8 }";
pub(super) const CIA402: &str = "protocol = \"cia402\"\nposition_loop = { kp = 20.0, kd = 1.0 }\nincrements = 65536.0\nrated_torque = 8.0\ncurrent_limit = 10.0\nrated_current = 10.0";
pub(super) const CIA402_HOMING: &str =
    "homing = { by = \"drive\", method = 17, velocity = 0.6, creep_velocity = 0.1, acceleration = 2.0 }";

pub(super) const BY_DRIVE: [Case; 3] = [
    Case {
        name: "odrive",
        bus: "",
        drive: "protocol = \"odrive\"\nposition_loop = { kp = 20.0, kd = 1.0 }\nreport_every = \"2 ms\"\ncurrent_limit = 60.0\ntorque_constant = 0.1",
        homing: "homing = { by = \"drive\" }",
    },
    Case {
        name: "odrive by its index",
        bus: "",
        drive: "protocol = \"odrive\"\nposition_loop = { kp = 20.0, kd = 1.0 }\nreport_every = \"2 ms\"\ncurrent_limit = 60.0\ntorque_constant = 0.1",
        homing: "homing = { by = \"drive\", procedure = \"index\" }",
    },
    Case { name: "cia402", bus: "", drive: CIA402, homing: CIA402_HOMING },
];

pub(super) const AT_STOPS: [Case; 5] = [
    Case { name: "damiao", bus: "", drive: "protocol = \"damiao\"", homing: AT_STOP },
    Case { name: "mini cheetah", bus: "", drive: "protocol = \"mini_cheetah\"", homing: AT_STOP },
    Case {
        name: "moteus",
        bus: "data_bitrate = 5_000_000",
        drive: "protocol = \"moteus\"\nposition_loop = { kp = 20.0, kd = 1.0 }",
        homing: AT_STOP,
    },
    Case {
        name: "odrive with torques",
        bus: "",
        drive: "protocol = \"odrive\"\nposition_loop = { kp = 20.0, kd = 1.0 }\nreport_every = \"2 ms\"\nmode = \"torque\"",
        homing: AT_STOP,
    },
    Case {
        name: "cia402 with torques",
        bus: "",
        drive: "protocol = \"cia402\"\nposition_loop = { kp = 20.0, kd = 1.0 }\nincrements = 65536.0\nrated_torque = 8.0\nmode = \"torque\"",
        homing: AT_STOP,
    },
];

pub(super) fn all() -> impl Iterator<Item = Case> {
    BY_DRIVE.into_iter().chain(AT_STOPS)
}

/// Joint with inertia, friction and stops.
pub(super) struct Joint {
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) stops: [f64; 2],
    pub(super) is_jammed: bool,
    /// Effort of the load, N m.
    pub(super) load: f64,
    /// Stiffness of a spring that rests at 0.3 rad, N m/rad.
    pub(super) spring: f64,
    /// Largest effort of the drive so far, N m.
    most: f64,
}

impl Joint {
    fn at_position(position: f64) -> Self {
        Self {
            position,
            velocity: 0.0,
            stops: [STOP, 1.5],
            is_jammed: false,
            load: 0.0,
            spring: 0.0,
            most: 0.0,
        }
    }

    fn step(&mut self, effort: f64) {
        let dt = STEP_NS as f64 * 1e-9;
        self.most = self.most.max(effort.abs());
        if self.is_jammed {
            return;
        }
        let load = self.load + self.spring * (0.3 - self.position);
        self.velocity += (effort + load - 0.3 * self.velocity) / 0.05 * dt;
        let next = self.position + self.velocity * dt;
        self.position = next.clamp(self.stops[0], self.stops[1]);
        if self.position != next {
            self.velocity = 0.0;
        }
    }
}

/// Drives on a bus, their joints, and the adapter.
pub(super) struct Rig {
    table: Table,
    pub(super) adapter: Adapter,
    bus: SimulatedBus,
    pub(super) drives: Vec<AnySimulatedDrive>,
    pub(super) joints: Vec<Joint>,
    pub(super) silent: Option<usize>,
    /// Additional delay of the answers of the first drive, ns.
    pub(super) late_ns: u64,
    pub(super) cycle: u64,
}

impl Rig {
    /// Joints of this family, each with its own homing keys.
    pub(super) fn new(case: &Case, homings: &[&str], on_trip: OnTrip) -> Self {
        let mut text = format!("[[bus]]\nname = \"bus\"\nbitrate = 1_000_000\n{}\n", case.bus);
        for (index, homing) in homings.iter().enumerate() {
            text += &format!(
                "[[drive]]\njoint = \"joint{index}\"\nbus = \"bus\"\nnode = {}\nwatchdog = \"40 ms\"\nratio = 2.0\noffset = 0.1\n\
                 ranges = {{ position = 12.5, velocity = 30.0, torque = 8.0 }}\n\
                 {}\n{homing}\n",
                index + 1,
                case.drive
            );
        }
        let table = Table::parse(&text).unwrap_or_else(|error| panic!("{}: {error}", case.name));
        let (count, order) = (homings.len(), (0..homings.len()).collect::<Vec<_>>());
        let adapter = Adapter::new(&table, &order, &vec![1.0; count], on_trip);
        let mut adapter = adapter.with_stiffness(&vec![20.0; count]);
        adapter.set_cycle(CYCLE_NS);
        let drive = |index| AnySimulatedDrive::new(&table, index, Overrides::default());
        Self {
            bus: SimulatedBus::new(table.rates(0), count + 1, 64),
            drives: (0..count).map(drive).collect(),
            joints: (0..count).map(|index| Joint::at_position(0.4 - 0.1 * index as f64)).collect(),
            adapter,
            table,
            silent: None,
            late_ns: 0,
            cycle: 0,
        }
    }

    pub(super) fn one(case: &Case) -> Self {
        Self::new(case, &[case.homing], OnTrip::Damp)
    }

    pub(super) fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds * 1e9) as u64 / CYCLE_NS {
            self.run_cycle();
        }
    }

    /// Runs until the homing of a joint has finished, at most for `seconds`.
    pub(super) fn run_until_over(&mut self, joint: usize, seconds: f64) -> HomingState {
        for _ in 0..(seconds * 1e9) as u64 / CYCLE_NS {
            self.run_cycle();
            if matches!(self.state(joint), HomingState::Homed | HomingState::Failed(_)) {
                break;
            }
        }
        self.state(joint)
    }

    pub(super) fn run_cycle(&mut self) {
        let begin_ns = self.cycle * CYCLE_NS;
        let mut frames = Vec::new();
        self.adapter.write(0, &mut frames);
        frames.iter().for_each(|frame| assert!(self.bus.enqueue(0, *frame, begin_ns)));
        self.adapter.sent(0, frames.len(), begin_ns);
        self.cycle += 1;
        for now_ns in (begin_ns..self.cycle * CYCLE_NS).step_by(STEP_NS as usize) {
            self.step(now_ns + STEP_NS);
        }
        self.adapter.end_cycle(true);
        // a joint without a known position is damped after the trip
        let enabled = |link: &Link| matches!(link.phase(), Phase::Enabled | Phase::Enabling);
        let links = self.adapter.links();
        assert!(
            self.adapter.has_tripped() || links.iter().all(|link| link.is_homed() || !enabled(link)),
            "a joint that is not homed is not enabled"
        );
        assert!(
            !self.adapter.is_complete() || links.iter().all(Link::is_homed),
            "its state is not published"
        );
    }

    pub(super) fn step(&mut self, now_ns: u64) {
        let Self { bus, drives, adapter, silent, late_ns, joints, table, .. } = self;
        for (index, drive) in drives.iter_mut().enumerate() {
            drive.report(now_ns, &mut |frame, time_ns| {
                if *silent != Some(index) {
                    bus.enqueue(index + 1, frame, time_ns);
                }
            });
        }
        while let Some(event) = bus.next(now_ns) {
            let Event::Delivered { sender, frame, time_ns } = event else { panic!("{event:?}") };
            if sender > 0 {
                adapter.take(0, &Received { frame, time_ns });
                continue;
            }
            for (index, drive) in drives.iter_mut().enumerate() {
                drive.receive(&frame, time_ns, &mut |answer| {
                    if *silent != Some(index) {
                        let late_ns = if index == 0 { *late_ns } else { 0 };
                        bus.enqueue(index + 1, answer, time_ns + 50_000 + late_ns);
                    }
                });
            }
        }
        for (index, (drive, joint)) in drives.iter_mut().zip(joints).enumerate() {
            let gear = table.transmission(index);
            let torque = drive.step(gear.to_drive(joint.position), joint.velocity * gear.ratio, now_ns);
            joint.step(torque * gear.ratio);
        }
    }

    pub(super) fn state(&self, joint: usize) -> HomingState {
        self.adapter.links()[joint].homing().expect("it is homed")
    }

    /// Returns `true` if all joints follow commands, and the adapter knows their positions.
    pub(super) fn is_right(&self) -> bool {
        let knows = |(link, joint): (&Link, &Joint)| {
            link.phase() == Phase::Enabled && (link.state().0 - joint.position).abs() < 0.02
        };
        self.adapter.links().iter().zip(&self.joints).all(knows)
    }
}

#[test]
fn joints_of_every_family_are_homed() {
    for case in all() {
        let mut rig = Rig::one(&case);
        rig.run(0.1);
        let unknown = (rig.adapter.links()[0].state().0 - rig.joints[0].position).abs();
        assert!(unknown > 0.2, "{}: its encoder counts from its power-up position: {unknown}", case.name);
        assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed, "{}", case.name);
        rig.run(0.3);
        let (link, joint) = (&rig.adapter.links()[0], &rig.joints[0]);
        assert!(rig.is_right(), "{}: {:?} {:?} {}", case.name, link.phase(), link.state(), joint.position);
        assert!(!rig.adapter.has_tripped() && rig.adapter.is_complete(), "{}", case.name);
        assert_eq!((link.counts().missing, link.counts().refused), (0, 0), "{}", case.name);
    }
}

#[test]
fn homing_to_a_stop_keeps_its_effort_limit() {
    for case in AT_STOPS {
        let mut rig = Rig::one(&case);
        assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed, "{}", case.name);
        // within the rounding of the frames
        assert!(rig.joints[0].most < 1.1 * EFFORT, "{}: {}", case.name, rig.joints[0].most);
        assert!(rig.joints[0].most > 0.9 * EFFORT, "{}: {}", case.name, rig.joints[0].most);
        let off = rig.joints[0].position - STOP;
        assert!((0.04..0.08).contains(&off), "{}: {off}", case.name);
    }
}

#[test]
fn joints_are_homed_in_order_while_others_hold() {
    let homing = |order: u8| {
        format!(
            "homing = {{ by = \"stop\", velocity = -0.5, effort = 1.2, position = -0.8, order = {order} }}"
        )
    };
    let (last, first) = (homing(2), homing(1));
    let mut rig = Rig::new(&AT_STOPS[0], &[&last, &first, "", &first], OnTrip::Damp);
    while [1, 3].iter().any(|joint| rig.state(*joint) != HomingState::Homed) {
        assert_eq!(rig.state(0), HomingState::Waiting);
        rig.run_cycle();
        assert!(rig.cycle * CYCLE_NS < 20_000_000_000);
    }
    assert_eq!(rig.joints[0].position, 0.4, "the joint has not moved");
    let links = rig.adapter.links();
    assert_eq!(links[2].phase(), Phase::Disabled, "a joint without homing waits until all are homed");
    assert_eq!([links[1].phase(), links[3].phase()], [Phase::Enabled; 2]);
    let held = rig.joints[1].position;
    assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed);
    assert!((rig.joints[1].position - held).abs() < 0.01, "{held} {}", rig.joints[1].position);
    rig.run(0.2);
    assert!(rig.adapter.links().iter().all(|link| link.phase() == Phase::Enabled));
}

#[test]
fn homing_in_place_moves_nothing() {
    let homing = CIA402_HOMING.replace("17", "37");
    let mut rig = Rig::new(&BY_DRIVE[2], &[&homing], OnTrip::Damp);
    assert_eq!(rig.run_until_over(0, 5.0), HomingState::Homed);
    rig.run(0.2);
    assert!((rig.joints[0].position - 0.4).abs() < 0.01, "{}", rig.joints[0].position);
    // the drive reads zero there, which the table maps to the offset of the joint
    assert!((rig.adapter.links()[0].state().0 - 0.1).abs() < 0.01);
}

#[test]
fn a_slow_odrive_is_homed_by_a_report_after_its_mark() {
    let case = &BY_DRIVE[0];
    let seldom = Case { drive: case.drive.replace("2 ms", "50 ms").leak(), ..*case };
    // the search ends at any time between a report and the heartbeat
    for place in 0..8 {
        let mut rig = Rig::one(&seldom);
        rig.joints[0].position = 0.2 + 0.03 * f64::from(place);
        while !rig.adapter.is_complete() {
            rig.run_cycle();
            assert!(rig.cycle * CYCLE_NS < 10_000_000_000 && !rig.adapter.has_tripped());
        }
        let (known, position) = (rig.adapter.links()[0].state().0, rig.joints[0].position);
        assert!((known - position).abs() < 0.02, "{place}: {known} {position}");
        rig.run(0.3);
        assert!(rig.is_right(), "{place}");
    }
}
