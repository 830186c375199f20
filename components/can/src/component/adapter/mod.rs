//! `can.adapter`: the actuator whose drives are on CAN buses.

mod config;
mod results;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::safety::{CommandGate, Measured, Verdict};
use motorium::state::{BusHealth, CanFrame};
use motorium::transport::{SliceInput, SliceOutput};
use motorium_robots::{Dynamics, Model};
use nalgebra::Vector3;

use super::{Equipped, limits, load, wire};
use crate::adapter::{Adapter, OnTrip, Phase, Setpoint};
use crate::bus::Received;
use crate::bus::simulated::ErrorState;
use crate::{Bits, Frame, Rates};
use config::WhenTripped;
pub use config::{CanAdapterConfig, JointHealth};
use config::{check_budget, check_watchdogs};

/// Frames that one batch of all buses holds at most.
pub(super) const BATCH: usize = 128;

/// A component that commands drives on CAN buses.
pub struct CanAdapter {
    command: Input<JointCommand>,
    received: SliceInput<CanFrame>,
    joint_state: Output<JointState>,
    health: Output<JointHealth>,
    sent: SliceOutput<CanFrame>,
    gate: CommandGate,
    adapter: Adapter,
    names: Vec<String>,
    buses: Vec<BusAccount>,
    measured: [Vec<f64>; 2],
    weight: Weight,
    clock: RunClock,
    frames: Vec<Frame>,
    batch: Vec<CanFrame>,
    resumes: u32,
    safe: u64,
}

/// The account of one bus.
struct BusAccount {
    name: String,
    rates: Rates,
    health: Output<BusHealth>,
    counts: BusHealth,
    /// Time that its bits took in the cycle, and in all, ns.
    busy_ns: u64,
    total_ns: u64,
    /// The largest load of a cycle.
    peak: f64,
}

/// The efforts that hold the robot against gravity.
struct Weight {
    model: Model,
    dynamics: Dynamics,
    /// Acceleration of free fall, m/s2.
    gravity: Vector3<f64>,
}

impl Component for CanAdapter {
    const KIND: &'static str = "can.adapter";
    const SUMMARY: &'static str = "commands drives on CAN buses";
    const READS_GRAVITY: bool = true;
    type Config = CanAdapterConfig;

    fn declare(config: &CanAdapterConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.actuator();
        let equipped = load(declare.robot(), declare.folder(), &config.source())?;
        check_watchdogs(config, &equipped)?;
        if let Some(message) = limits::too_small(&equipped) {
            let advice = "enlarge the range in the drive and in the table, or correct `ratio` and `offset`";
            return Err(ConfigError::key("drives", message).advise(advice));
        }
        limits::of_joints(&equipped)?;
        if !config.gravity.iter().all(|number| number.is_finite()) {
            return Err(ConfigError::key("gravity", "expected finite numbers"));
        }
        for (index, bus) in equipped.table.buses.iter().enumerate() {
            if let Some(period) = declare.period() {
                check_budget(&bus.name, &equipped.table.budget(index, period.as_nanos() as u64), declare)?;
            }
        }
        declare.input::<JointCommand>("joint_command", "commands of the joints");
        declare.slice_input::<CanFrame>("frames_received", 16, "frames received from the buses");
        declare.output::<JointState>("joint_state", "newest state of every joint");
        declare.slice_output::<CanFrame>(
            "frames_sent",
            BATCH,
            16,
            "frames sent to the buses, one batch a cycle",
        );
        declare.output::<JointHealth>("joint_health", "age, flags and temperature of every drive");
        for bus in &equipped.table.buses {
            declare.output::<BusHealth>(&format!("{}.health", bus.name), "state and counts of this bus");
        }
        Ok(())
    }

    fn configure(config: CanAdapterConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let equipped =
            load(Some(&robot), setup.folder(), &config.source()).map_err(ConfigureError::Config)?;
        let limits = limits::of_joints(&equipped).map_err(ConfigureError::Config)?;
        let damping: Vec<f64> = limits.iter().map(|joint| joint.kd).collect();
        let Equipped { robot, table, order } = equipped;
        let on_trip = match config.when_tripped {
            WhenTripped::Damp => OnTrip::Damp,
            WhenTripped::Disable => OnTrip::Disable,
        };
        let joints = order.len();
        let gate = setup.command_gate(limits)?;
        let mut buses = Vec::new();
        for (index, bus) in table.buses.iter().enumerate() {
            buses.push(BusAccount {
                name: bus.name.clone(),
                rates: table.rates(index),
                health: setup.named_output(&format!("{}.health", bus.name))?,
                counts: BusHealth { bus: index as u32, state: BusHealth::ACTIVE, ..BusHealth::default() },
                busy_ns: 0,
                total_ns: 0,
                peak: 0.0,
            });
        }
        Ok(Self {
            command: setup.input("joint_command")?,
            received: setup.slice_input("frames_received")?,
            joint_state: setup.output("joint_state")?,
            health: setup.output("joint_health")?,
            sent: setup.slice_output("frames_sent")?,
            adapter: Adapter::new(&table, &order, &damping, on_trip),
            names: robot.model.joint_names().to_vec(),
            buses,
            measured: [vec![0.0; joints], vec![0.0; joints]],
            weight: Weight {
                dynamics: Dynamics::new(&robot.model),
                model: robot.model,
                gravity: config.gravity.into(),
            },
            clock: setup.clock(),
            frames: Vec::with_capacity(BATCH),
            batch: Vec::with_capacity(BATCH),
            resumes: gate.resumes(),
            gate,
            safe: 0,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.collect();
        self.adapter.end_cycle(!tick.settling);
        if let Some((joint, wrong)) = self.adapter.wrong_setting() {
            let name = &self.names[joint];
            return Err(StepError::failed(format!("the drive of `{name}` is not enabled: {wrong}")));
        }
        if self.adapter.is_complete() {
            self.publish_state()?;
        }
        self.apply_command(tick.settling);
        self.send(tick)?;
        self.publish_health(tick)
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(self.results())
    }
}

impl CanAdapter {
    /// Takes all frames that were received since the last step.
    fn collect(&mut self) {
        while let Some((_, frames)) = self.received.next_unread() {
            for frame in frames {
                let Some(bus) = self.buses.get_mut(frame.bus as usize) else { continue };
                if let Some(state) = wire::reported(frame) {
                    bus.report(state);
                    if state == ErrorState::Off {
                        self.adapter.trip();
                    }
                } else if let Some(data) = wire::from_topic(frame) {
                    bus.counts.received += 1;
                    bus.busy_ns += Bits::of(&data).ns(&bus.rates);
                    let received = Received { frame: data, time_ns: frame.receive_time };
                    self.adapter.take(frame.bus as usize, &received);
                } else {
                    bus.counts.dropped += 1;
                }
            }
        }
    }

    fn publish_state(&mut self) -> Result<(), StepError> {
        let links = self.adapter.links();
        let mut state = self.joint_state.loan()?;
        state.set_count(links.len());
        for (i, link) in links.iter().enumerate() {
            let (position, velocity, effort) = link.state();
            (state.position_mut()[i], state.velocity_mut()[i], state.effort_mut()[i]) =
                (position, velocity, effort);
            (self.measured[0][i], self.measured[1][i]) = (position, velocity);
        }
        // as old as the oldest answer in it
        let oldest_ns = self.adapter.oldest_ns().unwrap_or(0);
        state.publish_from(self.clock.stamp_ns(oldest_ns))
    }

    /// Passes the newest command through the gate to the drives. Before every joint is known nothing is commanded.
    fn apply_command(&mut self, settling: bool) {
        if self.adapter.oldest_ns().is_none() {
            return;
        }
        let Self { gate, command, measured, weight, .. } = self;
        let [position, velocity] = measured;
        let mut gravity =
            |effort: &mut [f64]| weight.dynamics.gravity(&weight.model, position, weight.gravity, effort);
        let verdict = gate.check(command, Measured { position, velocity, gravity: &mut gravity });
        self.safe += u64::from(!settling && matches!(verdict, Verdict::Safe { .. }));
        let resumes = self.gate.resumes();
        if resumes != self.resumes {
            self.resumes = resumes;
            if self.adapter.has_tripped() {
                // From where the joints are now, not from where they were held before they were damped.
                self.gate.reset();
                self.adapter.resume();
                return;
            }
        }
        for (joint, setpoint) in self.gate.setpoints().iter().enumerate() {
            let motorium::safety::JointSetpoint { position, velocity, effort, kp, kd, .. } = *setpoint;
            self.adapter.set(joint, Setpoint { position, velocity, effort, kp, kd });
        }
    }

    /// Sends the batch of this cycle. What does not fit is not sent: the next cycle has newer commands.
    fn send(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.batch.clear();
        for (index, bus) in self.buses.iter_mut().enumerate() {
            self.frames.clear();
            self.adapter.write(index, &mut self.frames);
            let is_off = bus.counts.state == BusHealth::BUS_OFF;
            let room = if is_off { 0 } else { BATCH - self.batch.len() };
            let count = self.frames.len().min(room);
            bus.counts.sent += count as u64;
            bus.counts.unsent += (self.frames.len() - count) as u64;
            for frame in &self.frames[..count] {
                bus.busy_ns += Bits::of(frame).ns(&bus.rates);
                self.batch.push(wire::to_topic(frame, index, 0));
            }
            self.adapter.sent(index, count, tick.time_ns);
        }
        let mut out = self.sent.loan(self.batch.len())?;
        out.copy_from_slice(&self.batch);
        out.publish()
    }

    fn publish_health(&mut self, tick: &Tick) -> Result<(), StepError> {
        let period_ns = tick.period.as_nanos().max(1) as f64;
        let cycles = self.adapter.cycles().max(1) as f64;
        for (index, bus) in self.buses.iter_mut().enumerate() {
            let busy_ns = core::mem::take(&mut bus.busy_ns);
            bus.total_ns += busy_ns;
            bus.peak = bus.peak.max(busy_ns as f64 / period_ns);
            bus.counts.load = (bus.total_ns as f64 / (cycles * period_ns)).min(1.0);
            let on_bus = self.adapter.links().iter().filter(|link| link.bus() == index);
            bus.counts.unanswered = on_bus.map(|link| link.counts().missing).sum();
            bus.health.send(&bus.counts)?;
        }
        let mut health = self.health.loan()?;
        let links = self.adapter.links();
        (health.count, health.tripped) = (links.len() as u32, u32::from(self.adapter.has_tripped()));
        for (i, link) in links.iter().enumerate() {
            let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
            health.age[i] = link.silent();
            health.flags[i] = flag(link.phase() == Phase::Enabled, JointHealth::ENABLED)
                | flag(link.silent() > 0, JointHealth::MISSING)
                | flag(link.silent() >= crate::adapter::LOST_AFTER, JointHealth::LOST)
                | flag(link.phase() == Phase::Fault, JointHealth::FAULT)
                | flag(matches!(link.phase(), Phase::Checking(_)), JointHealth::CHECKING);
            health.temperature[i] = link.temperature().unwrap_or(0.0);
        }
        health.publish()
    }
}

impl BusAccount {
    fn report(&mut self, state: ErrorState) {
        let state = match state {
            ErrorState::Active => BusHealth::ACTIVE,
            ErrorState::Passive => BusHealth::PASSIVE,
            ErrorState::Off => BusHealth::BUS_OFF,
        };
        self.counts.errors += u64::from(state != BusHealth::ACTIVE);
        self.counts.bus_off += u64::from(state == BusHealth::BUS_OFF && self.counts.state != state);
        self.counts.state = state;
    }
}
