//! `can.drive_sim`: buses and drives of a robot that physics simulates.

mod config;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::CanFrame;
use motorium::transport::{SliceInput, SliceOutput};

use super::adapter::BATCH;
use super::faults::{Fault, FaultKind};
use super::{Equipped, load, wire};
use crate::bus::simulated::{ErrorState, Event};
use crate::{Frame, Id, SimulatedBus, SimulatedDrive, Table, Transmission};

pub use config::DriveSimulationConfig;

/// Velocity gain of a closed brake, N m s/rad or N s/m: it gives the joint's full effort at a creep.
const BRAKE: f64 = 1e5;
/// Time from one frame of a babbling node to the next, ns: shorter than a frame.
const BABBLE_NS: u64 = 50_000;

/// A component that simulates the buses and drives of a robot.
///
/// In each step it moves the buses on to the present, lets each drive hear and answer, runs the inner loops on the joint state
/// that physics has just published, and publishes the efforts.
pub struct DriveSimulation {
    joint_state: Input<JointState>,
    sent: SliceInput<CanFrame>,
    received: SliceOutput<CanFrame>,
    command: Output<JointCommand>,
    clock: RunClock,
    axes: Vec<Axis>,
    buses: Vec<Wire>,
    faults: Vec<Fault>,
    answers: Vec<CanFrame>,
    config: DriveSimulationConfig,
    random: u64,
    lost: u64,
}

/// One joint with its drive.
struct Axis {
    name: String,
    drive: SimulatedDrive,
    gear: Transmission,
    bus: usize,
    /// Its node on the bus.
    node: usize,
    /// Its index in the table.
    entry: usize,
    /// It had no power in the step before.
    was_off: bool,
}

/// One bus: node 0 is the adapter, the last one babbles, those between are drives.
struct Wire {
    bus: SimulatedBus,
    babbler: usize,
    babbled_ns: u64,
    state: ErrorState,
    was_off: bool,
}

impl Component for DriveSimulation {
    const KIND: &'static str = "can.drive_sim";
    const SUMMARY: &'static str = "simulates drives on CAN buses";
    type Config = DriveSimulationConfig;

    fn declare(config: &DriveSimulationConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let equipped = load(declare.robot(), declare.folder(), &config.source())?;
        axes(config, &equipped)?;
        faults(config, &equipped.table)?;
        if !(0.0..=1.0).contains(&config.loss) {
            return Err(ConfigError::key("loss", format!("{}, expected 0 to 1", config.loss)));
        }
        if let Some(period) = declare.period()
            && period.as_nanos() > 250_000
        {
            let message = format!("an inner loop of {:.0} Hz", 1.0 / period.as_secs_f64());
            let warning = declare.warn(message);
            warning.advise("simulate physics at 4 kHz or more: drives hold stiff gains only in a fast loop");
        }
        declare.input::<JointState>("joint_state", "true state of the joints");
        declare.slice_input::<CanFrame>("frames_sent", 16, "frames that the adapter sends");
        declare.slice_output::<CanFrame>("frames_received", BATCH, 16, "frames that the adapter receives");
        declare.output::<JointCommand>(
            "joint_command",
            "efforts of the drives, for physics with `plant = true`",
        );
        Ok(())
    }

    fn configure(config: DriveSimulationConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let equipped =
            load(Some(&robot), setup.folder(), &config.source()).map_err(ConfigureError::Config)?;
        let mut axes = axes(&config, &equipped).map_err(ConfigureError::Config)?;
        let table = &equipped.table;
        let mut buses = Vec::new();
        for index in 0..table.buses.len() {
            let mut nodes = 1;
            for axis in axes.iter_mut().filter(|axis| axis.bus == index) {
                (axis.node, nodes) = (nodes, nodes + 1);
            }
            buses.push(Wire {
                bus: SimulatedBus::new(table.rates(index), nodes + 1, BATCH),
                babbler: nodes,
                babbled_ns: 0,
                state: ErrorState::Active,
                was_off: false,
            });
        }
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            sent: setup.slice_input("frames_sent")?,
            received: setup.slice_output("frames_received")?,
            command: setup.output("joint_command")?,
            clock: setup.clock(),
            axes,
            buses,
            faults: faults(&config, table).map_err(ConfigureError::Config)?,
            answers: Vec::with_capacity(BATCH),
            random: setup.seed(),
            config,
            lost: 0,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let now_ns = self.clock.now_ns().max(tick.time_ns);
        self.hear();
        self.begin_faults(now_ns);
        self.answers.clear();
        for index in 0..self.buses.len() {
            self.run_bus(index, now_ns);
        }
        if !self.answers.is_empty() {
            let mut out = self.received.loan(self.answers.len())?;
            out.copy_from_slice(&self.answers);
            out.publish()?;
        }
        self.run_loops(now_ns)
    }

    fn result(&self) -> Option<serde_json::Value> {
        let drive = |axis: &Axis| {
            let value = serde_json::json!({
                "enabled": axis.drive.is_enabled(),
                "watchdog_trips": axis.drive.watchdog_trips(),
                "temperature_celsius": axis.drive.temperature(),
            });
            (axis.name.clone(), value)
        };
        let drives: serde_json::Map<_, _> = self.axes.iter().map(drive).collect();
        Some(serde_json::json!({ "answers_lost": self.lost, "drives": drives }))
    }
}

impl DriveSimulation {
    /// Hands the frames of the adapter to their buses, at the time at which it sent them.
    fn hear(&mut self) {
        let start_ns = self.clock.stamp_ns(0);
        while let Some((stamp, frames)) = self.sent.next_unread() {
            let ready_ns = stamp.publish_time.saturating_sub(start_ns);
            for frame in frames {
                let Some(wire) = self.buses.get_mut(frame.bus as usize) else { continue };
                if let Some(data) = wire::from_topic(frame) {
                    wire.bus.enqueue(0, data, ready_ns);
                }
            }
        }
    }

    /// The faults that are not those of an answer.
    fn begin_faults(&mut self, now_ns: u64) {
        for (index, wire) in self.buses.iter_mut().enumerate() {
            let is_on = |kind| self.faults.iter().any(|fault| fault.befalls(kind, index, now_ns));
            let is_off = is_on(FaultKind::BusOff);
            match (is_off, wire.was_off) {
                (true, _) => wire.bus.switch_off(0),
                (false, true) => wire.bus.restart(0),
                (false, false) => {}
            }
            wire.was_off = is_off;
            if is_on(FaultKind::Disturbed) {
                wire.bus.disturb(1);
            }
            if is_on(FaultKind::Babbling) {
                // it goes on where it was, and never saves up
                wire.babbled_ns = wire.babbled_ns.max(now_ns.saturating_sub(1_000_000));
                while wire.babbled_ns < now_ns {
                    let noise = Frame::classic(Id::Standard(0), &[0xff; 8]);
                    wire.bus.enqueue(wire.babbler, noise, wire.babbled_ns);
                    wire.babbled_ns += BABBLE_NS;
                }
            } else {
                wire.babbled_ns = now_ns;
            }
        }
        for axis in &mut self.axes {
            let is_off = self.faults.iter().any(|fault| fault.befalls(FaultKind::Off, axis.entry, now_ns));
            if is_off && !axis.was_off {
                axis.drive.cut_power();
            }
            axis.was_off = is_off;
        }
    }

    /// Moves a bus on to the present: drives hear what is delivered, and their answers are sent in turn.
    fn run_bus(&mut self, index: usize, now_ns: u64) {
        while let Some(event) = self.buses[index].bus.next(now_ns) {
            if let Event::Delivered { sender, frame, time_ns } = event {
                if sender == 0 {
                    self.answer(index, &frame, time_ns);
                } else if self.buses[index].bus.state(0) != ErrorState::Off {
                    self.tell(wire::to_topic(&frame, index, time_ns));
                }
            }
        }
        let wire = &mut self.buses[index];
        let state = wire.bus.state(0);
        if state != wire.state {
            let is_back = wire.state == ErrorState::Off;
            wire.state = state;
            self.tell(wire::report(state, is_back, index, now_ns));
        }
    }

    /// Lets the adapter receive a frame; what its batch has no room for is lost, as with a full buffer.
    fn tell(&mut self, frame: CanFrame) {
        if self.answers.len() < BATCH {
            self.answers.push(frame);
        } else {
            self.lost += 1;
        }
    }

    /// All drives of a bus hear a frame; the one that it is for answers.
    fn answer(&mut self, index: usize, frame: &Frame, time_ns: u64) {
        let (faults, config) = (&self.faults, &self.config);
        for axis in self.axes.iter_mut().filter(|axis| axis.bus == index && !axis.was_off) {
            let Some(answer) = axis.drive.receive(frame, time_ns) else { continue };
            let has = |kind| faults.iter().find(|fault| fault.befalls(kind, axis.entry, time_ns));
            let lost = config.loss > 0.0 && uniform(&mut self.random) < config.loss;
            if has(FaultKind::Silent).is_some() || lost {
                self.lost += 1;
                continue;
            }
            let jitter_ns = match config.jitter.ns {
                0 => 0,
                jitter => (uniform(&mut self.random) * jitter as f64) as u64,
            };
            let late_ns = has(FaultKind::Late).map_or(0, |fault| fault.delay_ns);
            let ready_ns = time_ns + config.delay.ns + jitter_ns + late_ns;
            let answer = if has(FaultKind::WrongLength).is_some() {
                Frame::classic(answer.id, &answer.data()[..5])
            } else if has(FaultKind::Corrupt).is_some() {
                corrupt(answer)
            } else {
                answer
            };
            let bus = &mut self.buses[index].bus;
            bus.enqueue(axis.node, answer, ready_ns);
            if has(FaultKind::Duplicate).is_some() {
                bus.enqueue(axis.node, answer, ready_ns);
            }
        }
    }

    /// Runs the inner loop of every drive on the newest state of its joint.
    fn run_loops(&mut self, now_ns: u64) -> Result<(), StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(()) };
        let joints = self.axes.len();
        if state.count() != joints {
            return Err(StepError::failed("the joint state has another number of joints than the robot"));
        }
        let mut command = self.command.loan()?;
        command.set_count(joints);
        command.position_mut().fill(0.0);
        command.velocity_mut().fill(0.0);
        command.kp_mut().fill(0.0);
        for (i, axis) in self.axes.iter_mut().enumerate() {
            let position = axis.gear.to_drive(state.position()[i]);
            let torque = axis.drive.step(position, state.velocity()[i] * axis.gear.ratio, now_ns);
            command.effort_mut()[i] = torque * axis.gear.ratio;
            let is_braked = self.config.brakes && !axis.drive.is_enabled();
            command.kd_mut()[i] = if is_braked { BRAKE } else { 0.0 };
        }
        command.publish()
    }
}

/// An answer with a device or a state that there is not.
fn corrupt(mut answer: Frame) -> Frame {
    if let Some(first) = answer.data_mut().first_mut() {
        *first ^= 0x70;
    }
    answer
}

/// A number that looks random, from 0 to 1: splitmix64.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z >> 11) as f64 / (1_u64 << 53) as f64
}

fn axes(config: &DriveSimulationConfig, equipped: &Equipped) -> Result<Vec<Axis>, ConfigError> {
    let Equipped { robot, table, order } = equipped;
    let names = robot.model.joint_names();
    for (index, set) in config.set.iter().enumerate() {
        let positive = set.torque.is_none_or(|torque| torque.is_finite() && torque > 0.0);
        if !names.contains(&set.joint) || !positive {
            let message = format!("the drive of `{}`, with a torque of {:?}", set.joint, set.torque);
            return Err(ConfigError::key(format!("set[{index}]"), message)
                .advise("name a joint of the robot, and a torque that is positive"));
        }
    }
    let axis = |(name, &entry): (&String, &usize)| {
        let (mut codec, drive) = (table.drive(entry), &table.drives[entry]);
        let mut watchdog = drive.watchdog.ns;
        for set in config.set.iter().filter(|set| set.joint == *name) {
            watchdog = set.watchdog.map_or(watchdog, |watchdog| watchdog.ns);
            if let Some(torque) = set.torque {
                codec.ranges.torque = crate::Range::symmetric(torque);
            }
        }
        Axis {
            name: name.clone(),
            drive: SimulatedDrive::new(codec, (watchdog > 0).then_some(watchdog)),
            gear: table.transmission(entry),
            bus: table.bus_of(drive).unwrap_or(0),
            node: 0,
            entry,
            was_off: false,
        }
    };
    Ok(names.iter().zip(order).map(axis).collect())
}

fn faults(config: &DriveSimulationConfig, table: &Table) -> Result<Vec<Fault>, ConfigError> {
    config.faults.iter().enumerate().map(|(index, fault)| Fault::of(fault, index, table)).collect()
}
