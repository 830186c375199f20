//! `can.adapter`: the actuator whose drives are on CAN buses.

mod account;
mod config;
mod exchange;
mod hand_over;
mod order;
mod results;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::safety::{CommandGate, Measured, Verdict};
use motorium::state::{BusHealth, CanFrame};
use motorium_robots::{Dynamics, Model};
use nalgebra::Vector3;

use super::wire::BATCH;
use super::{Equipped, interfaces, limits, load};
use crate::Frame;
use crate::adapter::{Adapter, Link, OnTrip, Phase};
use account::BusAccount;
use config::WhenTripped;
pub use config::{CanAdapterConfig, JointHealth};
use config::{check_homing_loads, check_observer, check_watchdogs};
use exchange::{Exchange, Sockets, Topics};
use hand_over::HandOver;
use order::{StepOrder, check_budget};

/// Component that commands drives on CAN buses.
pub struct CanAdapter {
    /// `None` for an adapter that only listens.
    drive: Option<(Input<JointCommand>, CommandGate)>,
    joint_state: Output<JointState>,
    health: Output<JointHealth>,
    exchange: Exchange,
    adapter: Adapter,
    names: Vec<String>,
    buses: Vec<BusAccount>,
    measured: [Vec<f64>; 2],
    weight: Weight,
    clock: RunClock,
    frames: Vec<Frame>,
    hand_over: HandOver,
    order: StepOrder,
    resumes: u32,
    safe: u64,
    /// `true` if joints are being homed, or their positions are not known yet. The gate is reset once all
    /// positions are known.
    awaits_homing: bool,
    leaves_enabled: bool,
    /// Every drive has confirmed at the end that it is off; `None` if no drive was disabled.
    is_released: Option<bool>,
}

/// Efforts that hold the robot against gravity.
struct Weight {
    model: Model,
    dynamics: Dynamics,
    /// Gravitational acceleration, m/s2.
    gravity: Vector3<f64>,
}

impl Weight {
    /// Writes the effort of each joint at these positions. Efforts are zero for a floating base, whose
    /// orientation and contacts the drives do not report.
    fn efforts(&mut self, position: &[f64], effort: &mut [f64]) {
        let Self { model, dynamics, gravity } = self;
        match model.base().floating {
            true => effort.fill(0.0),
            false => dynamics.gravity(model, position, *gravity, effort),
        }
    }
}

impl Component for CanAdapter {
    const KIND: &'static str = "can.adapter";
    const SUMMARY: &'static str = "commands drives on CAN buses";
    const READS_GRAVITY: bool = true;
    type Config = CanAdapterConfig;

    fn declare(config: &CanAdapterConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        if !config.observe {
            declare.actuator();
        }
        let equipped = load(declare.robot(), declare.folder(), &config.source())?;
        check_observer(config, &equipped)?;
        if config.enable_margin.is_some_and(|margin| !margin.is_finite() || margin < 0.0) {
            return Err(ConfigError::key("enable_margin", "expected a number of at least 0 (rad or m)"));
        }
        check_watchdogs(config, &equipped, declare)?;
        if let Some(message) = limits::too_small(&equipped) {
            let advice = "enlarge the range in the drive and in the table, or correct `ratio` and `offset`";
            return Err(ConfigError::key("drives", message).advise(advice));
        }
        let limits = limits::of_joints(&equipped)?;
        if let Some((joint, message)) = limits::unfit_homing(&equipped, &limits) {
            let advice = "homing keeps to the limits of the joint: correct `homing` in the drive table, or the robot's model";
            return Err(
                ConfigError::key("drives", format!("the homing of `{joint}`: {message}")).advise(advice)
            );
        }
        if let Some(number) = config.gravity.into_iter().find(|number| !(-1000.0..=1000.0).contains(number)) {
            let message = format!("{number}, expected from -1000 to 1000 m/s2");
            return Err(ConfigError::key("gravity", message));
        }
        check_homing_loads(config, &equipped, declare)?;
        let is_real = interfaces::are_real(&equipped.table, declare.clock())?;
        let order = StepOrder::from_config(config, &equipped.table, is_real, declare.period())?;
        for (index, bus) in equipped.table.buses.iter().enumerate() {
            if let Some(period) = declare.period() {
                let budget = equipped.table.budget(index, period.as_nanos() as u64);
                check_budget(&bus.name, &budget, &order, declare)?;
            }
        }
        if !config.observe {
            declare.input::<JointCommand>("joint_command", "commands of the joints");
        }
        declare.output::<JointState>("joint_state", "newest state of every joint");
        declare.waits(order.waits());
        if !is_real {
            declare.slice_input::<CanFrame>("frames_received", 16, "frames received from the buses");
            let sent = "frames sent to the buses, one batch a cycle";
            declare.slice_output::<CanFrame>("frames_sent", BATCH, 16, sent);
        }
        declare.output::<JointHealth>("joint_health", "age, flags and temperature of every drive");
        for bus in &equipped.table.buses {
            declare.output::<BusHealth>(&format!("{}_health", bus.name), "state and counts of this bus");
        }
        Ok(())
    }

    fn configure(config: CanAdapterConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let equipped =
            load(Some(&robot), setup.folder(), &config.source()).map_err(ConfigureError::Config)?;
        let limits = limits::of_joints(&equipped).map_err(ConfigureError::Config)?;
        let damping: Vec<f64> = limits.iter().map(|joint| joint.kd).collect();
        let stiffness: Vec<f64> = limits.iter().map(|joint| joint.kp).collect();
        let enabling = limits::of_enabling(&equipped, config.enable_margin);
        let Equipped { robot, table, order } = equipped;
        let on_trip = match config.when_tripped {
            WhenTripped::Damp => OnTrip::Damp,
            WhenTripped::Disable => OnTrip::Disable,
        };
        let joints = order.len();
        let drive = match config.observe {
            true => None,
            false => Some((setup.input("joint_command")?, setup.command_gate(limits)?)),
        };
        let mut buses = Vec::new();
        for (index, bus) in table.buses.iter().enumerate() {
            let health = setup.named_output(&format!("{}_health", bus.name))?;
            buses.push(BusAccount::new(index, &bus.name, table.rates(index), health));
        }
        let mut adapter =
            Adapter::new(&table, &order, &damping, on_trip).with_stiffness(&stiffness).with_limits(&enabling);
        if config.observe {
            adapter = adapter.observer();
        }
        adapter.set_cycle(setup.period().as_nanos() as u64);
        let clock = setup.clock();
        let is_real = interfaces::are_real(&table, clock.kind()).map_err(ConfigureError::Config)?;
        let order = StepOrder::from_config(&config, &table, is_real, Some(setup.period()));
        let order = order.map_err(ConfigureError::Config)?;
        let exchange = if is_real {
            let within_ns = order.answer_within.map(|within| within.as_nanos() as u64);
            let sockets = Sockets::open(&table, clock.clone(), within_ns).map_err(ConfigureError::Config)?;
            sockets.prepare(&mut adapter);
            Exchange::Sockets(sockets)
        } else {
            let received = setup.slice_input("frames_received")?;
            let topics = Topics::new(received, setup.slice_output("frames_sent")?);
            Exchange::Topics(Box::new(topics))
        };
        Ok(Self {
            joint_state: setup.output("joint_state")?,
            health: setup.output("joint_health")?,
            exchange,
            adapter,
            names: robot.model.joint_names().to_vec(),
            buses,
            measured: [vec![0.0; joints], vec![0.0; joints]],
            weight: Weight {
                dynamics: Dynamics::new(&robot.model),
                model: robot.model,
                gravity: config.gravity.into(),
            },
            clock,
            frames: Vec::with_capacity(BATCH),
            hand_over: HandOver::default(),
            order,
            resumes: drive.as_ref().map_or(0, |(_, gate)| gate.resumes()),
            drive,
            safe: 0,
            awaits_homing: false,
            leaves_enabled: config.leave_enabled,
            is_released: None,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Self { exchange, adapter, buses, .. } = self;
        // these are late answers if answers are read within the step, otherwise the answers to the previous
        // batch
        exchange.collect(adapter, buses);
        if !self.order.answers_within_step() {
            let waits = self.order.command_within;
            if let (Some(_), Some((command, _))) = (waits, &mut self.drive) {
                // a command that was too late for the previous step was not computed from this step's state
                let _ = command.latest();
            }
            let is_told = self.end_cycle(tick)?;
            if let (true, Some(longest), Some((command, _))) = (is_told, waits, &mut self.drive) {
                command.wait(longest);
            }
        }
        self.apply_command(tick.settling);
        let Self { exchange, adapter, buses, frames, hand_over, clock, .. } = self;
        exchange.send(tick, adapter, buses, frames)?;
        hand_over.sent(clock.stamp_ns(clock.now_ns()));
        exchange.await_answers(adapter, buses);
        if self.order.answers_within_step() {
            self.end_cycle(tick)?;
        }
        self.publish_health(tick)
    }

    /// Disables the drives after their safe state has settled; a drive without a watchdog would otherwise
    /// stay on.
    fn stop(&mut self) {
        let Self { exchange, adapter, buses, frames, .. } = self;
        let is_on =
            self.drive.is_some() && adapter.links().iter().any(|link| link.phase() != Phase::Disabled);
        if self.leaves_enabled || !is_on {
            return;
        }
        if let Exchange::Sockets(sockets) = exchange {
            adapter.release();
            self.is_released = Some(sockets.release(adapter, buses, frames));
        }
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(self.results())
    }
}

impl CanAdapter {
    /// Ends the cycle of commands and answers, and publishes the joint state if it is known. Returns `true`
    /// if it was published.
    fn end_cycle(&mut self, tick: &Tick) -> Result<bool, StepError> {
        // simulated drives stop with the run, even in the middle of a cycle
        self.adapter.end_cycle(!tick.settling && !self.clock.is_settling());
        if let Some((joint, wrong)) = self.adapter.wrong_setting() {
            let name = &self.names[joint];
            return Err(StepError::failed(format!("the drive of `{name}` is not enabled: {wrong}")));
        }
        let is_complete = self.adapter.is_complete();
        if is_complete {
            self.publish_state()?;
        }
        Ok(is_complete)
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
        // the state is as old as its oldest answer
        let oldest_ns = self.adapter.oldest_ns().unwrap_or(0);
        state.publish_from(self.clock.stamp_ns(oldest_ns))
    }

    /// Passes the newest command through the gate to the drives. Nothing is commanded until all joint
    /// positions are known.
    fn apply_command(&mut self, settling: bool) {
        if !self.adapter.is_known() {
            self.await_homing(settling);
            return;
        }
        if core::mem::take(&mut self.awaits_homing) {
            // the safe state was based on readings that were not joint positions
            if let Some((_, gate)) = &mut self.drive {
                gate.relocate();
            }
        }
        let Self { drive: Some((command, gate)), measured, weight, .. } = self else { return };
        let [position, velocity] = measured;
        let mut gravity = |effort: &mut [f64]| weight.efforts(position, effort);
        if self.adapter.has_tripped() {
            gate.trip();
        }
        let verdict = gate.check(command, Measured { position, velocity, gravity: &mut gravity });
        self.safe += u64::from(!settling && matches!(verdict, Verdict::Safe { .. }));
        let is_applied = self.adapter.enabled_in().is_some() && verdict == Verdict::Applied;
        self.hand_over.take(command.current().filter(|_| is_applied).map(|reading| reading.stamp()));
        let resumes = gate.resumes();
        if resumes != self.resumes {
            self.resumes = resumes;
            if self.adapter.has_tripped() {
                // Starts from the current positions, not from the positions held before the joints were
                // damped.
                gate.reset();
                self.adapter.resume();
                return;
            }
        }
        apply(&mut self.adapter, gate);
    }

    /// Runs a step while joints still have to be homed, or while some positions are unknown. Commands are
    /// ignored. While the run is stopped, joints being homed are disabled, and held joints apply the graph's
    /// safe state.
    fn await_homing(&mut self, settling: bool) {
        let is_let_go = |link: &Link| link.is_homed() && link.phase() != Phase::Enabled;
        if self.adapter.links().iter().all(is_let_go) {
            return;
        }
        self.awaits_homing = true;
        let Self { drive: Some((_, gate)), measured: [position, velocity], adapter, clock, .. } = self else {
            return;
        };
        for ((link, position), velocity) in adapter.links().iter().zip(&mut *position).zip(&mut *velocity) {
            (*position, *velocity, _) = link.state();
        }
        // the weight is unknown until the positions of all joints are known
        let mut weightless = |effort: &mut [f64]| effort.fill(0.0);
        if adapter.has_tripped() {
            gate.trip();
        }
        gate.withhold(Measured { position, velocity, gravity: &mut weightless });
        let resumes = gate.resumes();
        if core::mem::replace(&mut self.resumes, resumes) != resumes && adapter.has_tripped() {
            adapter.resume();
        }
        let is_stopped = settling || clock.is_settling() || clock.is_latched() || gate.is_latched();
        if is_stopped && adapter.allows_homing() {
            // starts from the current joint positions
            gate.relocate();
            gate.withhold(Measured { position, velocity, gravity: &mut weightless });
        }
        adapter.allow_homing(!is_stopped);
        if is_stopped {
            apply(adapter, gate);
        }
    }

    fn publish_health(&mut self, tick: &Tick) -> Result<(), StepError> {
        let period_ns = tick.period.as_nanos().max(1) as u64;
        let (now_ns, cycles) = (self.clock.now_ns(), self.adapter.cycles().max(1));
        for (index, bus) in self.buses.iter_mut().enumerate() {
            bus.close(now_ns, cycles, period_ns);
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
                | flag(link.phase() == Phase::Homing, JointHealth::HOMING)
                | flag(!link.is_homed(), JointHealth::NOT_HOMED)
                | flag(matches!(link.phase(), Phase::Checking(_)), JointHealth::CHECKING);
            health.temperature[i] = link.temperature().unwrap_or(0.0);
        }
        health.publish()
    }
}

/// Commands the gate's setpoints.
fn apply(adapter: &mut Adapter, gate: &CommandGate) {
    for (joint, setpoint) in gate.setpoints().iter().enumerate() {
        adapter.set(joint, *setpoint);
    }
}
