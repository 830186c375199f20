//! The robots of a component: their ports, commands and reports.

use core::ops::Range;

use motorium::component::{ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, StepError};
use motorium::safety::{CommandGate, Measured, Verdict};
use motorium::state::{self, BaseState, JointState};
use motorium::transport::{Input, Output};
use motorium_robots::{Dynamics, Model};
use nalgebra::Vector3;
use serde_json::{Value, json};

use super::build::BuiltRobot;
use super::config::PhysicsConfig;
use super::follow::{self, Follower};
use super::limits;
use crate::{Engine, JointSetpoint, Simulation, Simulator};

/// Default age beyond which a followed state is stale, ns.
const FOLLOW_STALE_AFTER_NS: u64 = 20_000_000;

/// One robot of the simulation, with its ports.
pub(super) struct Actuated {
    /// Name in the graph, if there are several robots.
    name: Option<String>,
    articulation: usize,
    /// Range of the robot's drives in the simulation.
    drives: Range<usize>,
    /// `None` for a robot that follows.
    command: Option<Input<state::JointCommand>>,
    /// Set for a robot that follows a state.
    follower: Option<Follower>,
    state: Output<JointState>,
    base_state: Option<Output<BaseState>>,
    /// `None` if the commands come from simulated drives, which check them elsewhere, and for a robot that
    /// follows.
    gate: Option<CommandGate>,
    /// Steps in the safe state.
    pub(super) safe: u64,
    /// Steps spent returning from the safe state.
    pub(super) resuming: u64,
    /// True if the robot has rotors; no safe state keeps such a robot in the air.
    has_rotors: bool,
    /// Position of the base at the start \[m\].
    start: [f64; 3],
    /// Range of the base's height \[m\].
    lowest: f64,
    highest: f64,
}

/// The gravity compensation of safe states. It uses the models from the robot files, regardless of sampled
/// properties.
pub(super) struct SafeStates {
    models: Vec<Model>,
    gravity: Vector3<f64>,
    /// One entry for each model.
    dynamics: Vec<Dynamics>,
    efforts: Vec<Vec<f64>>,
}

impl SafeStates {
    pub(super) fn new<E: Engine>(simulation: &Simulation<E>) -> Self {
        let models: Vec<Model> = simulation.articulations().iter().map(|own| own.model().clone()).collect();
        Self {
            gravity: simulation.gravity(),
            dynamics: models.iter().map(Dynamics::new).collect(),
            efforts: models.iter().map(|model| vec![0.0; model.nv()]).collect(),
            models,
        }
    }

    /// Returns the joint efforts of an articulation in its configuration `q`.
    fn efforts(&mut self, articulation: usize, q: &[f64]) -> &[f64] {
        let (model, efforts) = (&self.models[articulation], &mut self.efforts[articulation]);
        self.dynamics[articulation].gravity(model, q, self.gravity, efforts);
        model.joints_of_v(efforts)
    }
}

impl Actuated {
    /// Opens the ports of all robots, whose bases start at `starts`.
    pub(super) fn open<E: Engine>(
        robots: Vec<BuiltRobot>,
        (simulation, starts): (&Simulation<E>, &[[f64; 3]]),
        config: &PhysicsConfig,
        setup: &mut Setup,
    ) -> Result<Vec<Self>, ConfigureError> {
        let names = simulation.joint_names();
        let driven = robots.iter().filter(|robot| !robot.follows && !config.plant);
        let limits = driven.map(|robot| limits::of_drives(&robot.loaded, &names[robot.drives.clone()]));
        let limits: Result<Vec<_>, ConfigError> = limits.collect();
        let limits = limits.map_err(ConfigureError::Config)?;
        let gates = if limits.is_empty() { Vec::new() } else { setup.command_gates(limits)? };
        let mut gates = gates.into_iter();
        let stale_after_ns = config.follow_stale_after.map_or(FOLLOW_STALE_AFTER_NS, |time| time.ns);
        let mut actuated = Vec::new();
        for (robot, start) in robots.into_iter().zip(starts) {
            let (mut command, mut follower, mut gate) = (None, None, None);
            if robot.follows {
                follower = Some(Follower::open(&robot, (simulation, stale_after_ns), setup)?);
            } else {
                command = Some(setup.input(&robot.port(follow::COMMAND))?);
                // Gates are in the order of the robots that have one.
                gate = if config.plant { None } else { gates.next() };
            }
            let floating = robot.loaded.model.base().floating;
            let base_state =
                if floating { Some(setup.named_output(&robot.port("base_state"))?) } else { None };
            actuated.push(Self {
                command,
                follower,
                state: setup.named_output(&robot.port("joint_state"))?,
                base_state,
                name: robot.name,
                articulation: robot.articulation,
                has_rotors: robot.drives.len() > robot.loaded.model.joint_count(),
                drives: robot.drives,
                gate,
                safe: 0,
                resuming: 0,
                start: *start,
                lowest: f64::INFINITY,
                highest: f64::NEG_INFINITY,
            });
        }
        Ok(actuated)
    }

    /// Applies the newest command within the gate's limits, or the safe state. A robot that follows is moved
    /// along its newest state.
    pub(super) fn apply_command<E: Engine>(
        &mut self,
        simulation: &mut Simulation<E>,
        safe_states: &mut SafeStates,
        (tick, factors): (&Tick, Option<&[[f64; 2]]>),
    ) {
        if let Some(follower) = &mut self.follower {
            follower.apply(simulation, tick.settling);
            return;
        }
        let Some(command) = &mut self.command else { return };
        let factors = factors.map(|factors| &factors[self.drives.clone()]);
        let Some(gate) = &mut self.gate else {
            apply_as_given(command, &mut simulation.commands_mut()[self.drives.clone()], factors);
            return;
        };
        let (drives, own) = (self.drives.clone(), &simulation.articulations()[self.articulation]);
        let (q, first) = (&simulation.configuration()[own.q()], own.drives().start);
        let mut of_drives = |effort: &mut [f64]| {
            let joints = safe_states.efforts(self.articulation, q);
            for (effort, drive) in effort.iter_mut().zip(drives.clone()) {
                // A rotor does not hold a position.
                *effort = joints.get(drive - first).copied().unwrap_or(0.0);
            }
        };
        let measured = Measured {
            position: &simulation.positions()[drives.clone()],
            velocity: &simulation.velocities()[drives.clone()],
            gravity: &mut of_drives,
        };
        gate.note_restrained(&simulation.restrained()[drives.clone()], measured.position, tick.dt());
        let verdict = gate.check_for(command, measured, tick.dt());
        self.safe += u64::from(!tick.settling && matches!(verdict, Verdict::Safe { .. }));
        self.resuming += u64::from(verdict == Verdict::Resuming);
        let commands = &mut simulation.commands_mut()[drives];
        for (index, (command, setpoint)) in commands.iter_mut().zip(gate.setpoints()).enumerate() {
            *command = scaled(*setpoint, factors, index);
        }
    }

    /// Records the position of the base after a step.
    pub(super) fn follow<E: Engine>(&mut self, simulation: &Simulation<E>) {
        let [.., height] = position(simulation, self.articulation);
        (self.lowest, self.highest) = (self.lowest.min(height), self.highest.max(height));
    }

    /// Publishes the state after a step.
    pub(super) fn publish<E: Engine>(&mut self, simulation: &Simulation<E>) -> Result<(), StepError> {
        if let Some(output) = &mut self.base_state {
            let own = &simulation.articulations()[self.articulation];
            let (q, v) = (&simulation.configuration()[own.q()], &simulation.velocity()[own.v()]);
            let mut base = output.loan()?;
            base.position.copy_from_slice(&q[..3]);
            base.orientation.copy_from_slice(&q[3..7]);
            base.linear_velocity.copy_from_slice(&v[..3]);
            base.angular_velocity.copy_from_slice(&v[3..6]);
            base.publish()?;
        }
        let drives = self.drives.clone();
        let mut state = self.state.loan()?;
        state.set_count(drives.len());
        state.position_mut().copy_from_slice(&simulation.positions()[drives.clone()]);
        state.velocity_mut().copy_from_slice(&simulation.velocities()[drives.clone()]);
        let efforts = self.follower.as_ref().map_or(&simulation.efforts()[drives], Follower::efforts);
        state.effort_mut().copy_from_slice(efforts);
        state.publish()?;
        Ok(())
    }

    /// Starts an episode with the current state of the simulation.
    pub(super) fn reset<E: Engine>(&mut self, simulation: &Simulation<E>) {
        if let Some(gate) = &mut self.gate {
            gate.reset();
        }
        if let Some(follower) = &mut self.follower {
            follower.reset(simulation);
        }
        (self.safe, self.resuming) = (0, 0);
        self.start = position(simulation, self.articulation);
        (self.lowest, self.highest) = (f64::INFINITY, f64::NEG_INFINITY);
    }

    /// Adds the robot's part to the report of a run: at the top level for a single robot, otherwise under its
    /// name.
    pub(super) fn report<E: Engine>(&self, simulation: &Simulation<E>, result: &mut Value) {
        let into = match &self.name {
            None => result,
            Some(name) => {
                let joints = &simulation.joint_names()[self.drives.clone()];
                result["robots"][name] = json!({
                    "steps_in_safe_state": self.safe,
                    "joints": own_names(joints, name),
                    "joint_position": simulation.positions()[self.drives.clone()],
                });
                &mut result["robots"][name]
            }
        };
        if let Some(follower) = &self.follower {
            follower.report(into);
        } else if self.has_rotors {
            into["rotors_in_safe_state"] = json!("no thrust");
        }
        if self.base_state.is_some() {
            let pose = simulation.base_pose_of(self.articulation);
            let position = pose.translation.vector;
            let (roll, pitch, yaw) = pose.rotation.euler_angles();
            let (dx, dy) = (position.x - self.start[0], position.y - self.start[1]);
            into["base_position"] = json!([position.x, position.y, position.z]);
            into["base_rpy"] = json!([roll, pitch, yaw]);
            into["base_height_lowest_m"] = json!(self.lowest);
            into["base_height_highest_m"] = json!(self.highest);
            into["base_travel_x_m"] = json!(dx);
            into["base_travel_y_m"] = json!(dy);
        }
    }
}

/// Returns the position of an articulation's base \[m\].
pub(super) fn position<E: Engine>(simulation: &Simulation<E>, articulation: usize) -> [f64; 3] {
    simulation.base_pose_of(articulation).translation.vector.into()
}

/// Returns the joint names of one of several robots without the robot's prefix.
fn own_names(names: &[String], robot: &str) -> Vec<String> {
    let own = |name: &String| name.strip_prefix(robot)?.strip_prefix('/').map(str::to_string);
    names.iter().map(|name| own(name).unwrap_or_else(|| name.clone())).collect()
}

/// Applies the newest command of simulated drives unchanged. Ignores a command for a different number of
/// drives.
fn apply_as_given(
    input: &mut Input<state::JointCommand>,
    commands: &mut [JointSetpoint],
    factors: Option<&[[f64; 2]]>,
) {
    let Some(newest) = input.latest().filter(|newest| newest.count() == commands.len()) else { return };
    for (i, command) in commands.iter_mut().enumerate() {
        let given = JointSetpoint {
            position: newest.position()[i],
            velocity: newest.velocity()[i],
            effort: newest.effort()[i],
            kp: newest.kp()[i],
            kd: newest.kd()[i],
            ..JointSetpoint::default()
        };
        if given.is_valid() {
            *command = scaled(given, factors, i);
        }
    }
}

/// Scales a command by the gain and strength factors of a drive.
fn scaled(command: JointSetpoint, factors: Option<&[[f64; 2]]>, index: usize) -> JointSetpoint {
    let Some([gain, strength]) = factors.map(|factors| factors[index]) else { return command };
    JointSetpoint {
        effort: command.effort * strength,
        kp: command.kp * gain * strength,
        kd: command.kd * gain * strength,
        ..command
    }
}
