//! `physics.articulated`, `physics.rapier` and `physics.mujoco`: simulations as components of a graph.

mod actuators;
mod build;
mod config;
mod limits;
mod objects;
mod pushes;
mod randomise;
mod truth;

use core::ops::Range;

use motorium::component::{Checkpoint, Component, ConfigureError, Episode, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::safety::{CommandGate, JointSetpoint, Measured, Verdict};
use motorium::state::{self, BaseState, JointState};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use motorium_robots::{Dynamics, Model};
use nalgebra::Vector3;
use serde_json::json;

use crate::{Articulated, BuildWarning, JointCommand, Mujoco, Rapier, Simulation, Simulator, StepReport};
pub use actuators::ActuatorConfig;
pub use build::PhysicsEngine;
use build::{Built, build};
pub use config::{PhysicsConfig, SurfaceConfig};
pub use pushes::PushConfig;
use pushes::Pushes;
use randomise::Randomiser;
pub use randomise::{
    Interval, ObjectIntervals, PlaceIntervals, RandomiseConfig, RobotIntervals, SurfaceIntervals,
    TerrainIntervals,
};
use truth::Truth;

/// `physics.articulated`: a simulation by the [`Articulated`] engine, for robots with a fixed or a floating base.
pub type ArticulatedPhysics = PhysicsComponent<Articulated>;

/// `physics.rapier`: a simulation by the [`Rapier`] engine, for robots with a fixed base. Heap allocations inside
/// rapier are counted apart.
pub type RapierPhysics = PhysicsComponent<Rapier>;

/// `physics.mujoco`: a simulation by the [`Mujoco`] engine, for robots with a fixed or a floating base, where MuJoCo's
/// library is installed.
pub type MujocoPhysics = PhysicsComponent<Mujoco>;

/// A simulated robot that publishes its joint state and follows joint commands; with a floating base, its base state,
/// too. Or several robots with fixed bases in one world, each with ports and a command gate of its own.
///
/// Every step passes the newest command through the [`CommandGate`], advances the simulation by the time since the last
/// step, and publishes the state at its end. When steps were skipped the simulation makes up for up to
/// four of them, so that the robot does not stand still while its clock goes on.
///
/// After a crash the robot goes on from its last published state, the objects from the start.
pub struct PhysicsComponent<E> {
    robots: Vec<Actuated>,
    base_state: Option<Output<BaseState>>,
    truth: Truth,
    simulation: Simulation<E>,
    pushes: Pushes,
    randomiser: Option<Randomiser>,
    /// The robot and the gravity that its safe states reckon with: those of its files, whatever is drawn.
    nominal: (Model, Vector3<f64>),
    dynamics: Dynamics,
    gravity: Vec<f64>,
    checkpoint: Checkpoint,
    last_ns: Option<u64>,
    /// Initial configuration (nq) and velocity (nv), for every episode.
    start_q: Vec<f64>,
    start_v: Vec<f64>,
    /// Initial position of the base \[m\].
    start: [f64; 3],
    totals: Totals,
}

/// One robot of the simulation, with its ports.
struct Actuated {
    /// Its name in the graph, where there are several.
    name: Option<String>,
    /// Its drives among those of the simulation.
    drives: Range<usize>,
    command: Input<state::JointCommand>,
    state: Output<JointState>,
    /// `None` where the commands are those of simulated drives, which are checked elsewhere.
    gate: Option<CommandGate>,
    /// Steps in the safe state.
    safe: u64,
    /// Steps on the way back from it.
    resuming: u64,
}

/// Counts of the whole run.
#[derive(Clone, Copy, Debug)]
struct Totals {
    steps: u64,
    saturated: u64,
    at_limit: u64,
    overspeed: u64,
    near_contact: u64,
    /// Height of the base \[m\].
    lowest: f64,
    highest: f64,
}

impl<E: PhysicsEngine> Component for PhysicsComponent<E> {
    const KIND: &'static str = E::KIND;
    const SUMMARY: &'static str = E::SUMMARY;
    const READS_WORLD: bool = true;
    const RESETS: bool = true;
    type Config = PhysicsConfig;

    fn declare(config: &PhysicsConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        if !config.plant {
            declare.actuator();
        }
        // Everything that could be refused later is refused now.
        let built = build::<E>(config, declare.robot(), declare.robots(), declare.folder())?;
        randomise::declare(&config.randomise, &built, declare)?;
        let Built { simulation, robots, .. } = built;
        Pushes::new(&config.pushes, simulation.model())?;
        for warning in simulation.warnings() {
            // Links that are always close are how the robot is built: nothing that its user could mend.
            if !matches!(warning, BuildWarning::SelfCollisionOff { .. }) {
                declare.warn(warning.to_string());
            }
        }
        for robot in &robots {
            declare.input::<state::JointCommand>(&robot.port("joint_command"), "commands of the drives");
            let doc = "positions, velocities and efforts after the step";
            declare.output::<JointState>(&robot.port("joint_state"), doc);
        }
        if simulation.model().base().floating {
            declare.output::<BaseState>("base_state", "pose and velocity of the base after the step");
        }
        truth::declare(robots.len(), &config.world, declare);
        Ok(())
    }

    fn configure(config: PhysicsConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (one, several) = (setup.robot().ok().cloned(), setup.robots().to_vec());
        let Built { mut simulation, robots, on_ground } =
            build::<E>(&config, one.as_ref(), &several, setup.folder())?;
        let (nq, nv) = (simulation.model().nq(), simulation.model().nv());
        let (start_q, start_v) = (simulation.configuration().to_vec(), simulation.velocity().to_vec());
        let nominal = (simulation.model().clone(), simulation.gravity());
        let mut randomiser = Randomiser::open(&config.randomise, (&simulation, &robots, on_ground), setup)?;
        let mut checkpoint = setup.checkpoint(nq + nv + if randomiser.is_some() { 3 } else { 0 })?;
        let state = checkpoint.resume();
        if let Some(randomiser) = &mut randomiser {
            let drawn = state.as_ref().map(|state| [0, 1, 2].map(|place| state[nq + nv + place]));
            let episode = drawn.map_or((0, setup.seed()), Randomiser::episode);
            randomiser.start(&mut simulation, episode).map_err(ConfigureError::failed)?;
        }
        let start = simulation.base_pose().translation.vector.into();
        if let Some(state) = state {
            simulation.reset(&state[..nq], &state[nq..nq + nv]).map_err(ConfigureError::failed)?;
        }
        let pushes = Pushes::new(&config.pushes, simulation.model())?;
        let floating = simulation.model().base().floating;
        let names = simulation.joint_names();
        let limits =
            robots.iter().map(|robot| limits::of_drives(&robot.loaded, &names[robot.drives.clone()]));
        let limits: Result<Vec<_>, ConfigError> = limits.collect();
        let limits = limits.map_err(ConfigureError::Config)?;
        let gates: Vec<_> = if config.plant {
            limits.iter().map(|_| None).collect()
        } else {
            setup.command_gates(limits)?.into_iter().map(Some).collect()
        };
        let mut actuated = Vec::new();
        for (robot, gate) in robots.into_iter().zip(gates) {
            actuated.push(Actuated {
                command: setup.input(&robot.port("joint_command"))?,
                state: setup.named_output(&robot.port("joint_state"))?,
                name: robot.name,
                drives: robot.drives,
                gate,
                safe: 0,
                resuming: 0,
            });
        }
        let truth = Truth::open(actuated.len(), &simulation, setup)?;
        Ok(Self {
            robots: actuated,
            truth,
            base_state: if floating { Some(setup.output("base_state")?) } else { None },
            dynamics: Dynamics::new(simulation.model()),
            gravity: vec![0.0; nv],
            start,
            start_q,
            start_v,
            simulation,
            pushes,
            randomiser,
            nominal,
            checkpoint,
            last_ns: None,
            totals: Totals::NONE,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let periods = tick.periods_since(self.last_ns.replace(tick.time_ns), tick.time_ns);
        for _ in 0..periods {
            self.apply_commands(tick);
            if !tick.settling {
                self.pushes.apply(&mut self.simulation, tick.time_ns);
            }
            let report =
                self.simulation.step(tick.dt()).map_err(|error| StepError::failed(error.to_string()))?;
            let pushed_until = if tick.settling { u64::MAX } else { tick.time_ns };
            self.truth.accumulate(&self.simulation, self.pushes.forces(pushed_until), tick.dt());
            if !tick.settling {
                self.totals.add(&report, self.simulation.base_pose().translation.z);
            }
        }
        let (q, v) = (self.simulation.configuration(), self.simulation.velocity());
        let drawn = self.randomiser.as_ref().map(Randomiser::checkpoint);
        self.checkpoint.save(q.iter().chain(v).copied().chain(drawn.into_iter().flatten()));
        if let Some(randomiser) = &mut self.randomiser {
            randomiser.publish()?;
        }
        if let Some(output) = &mut self.base_state {
            let mut base = output.loan()?;
            base.position.copy_from_slice(&q[..3]);
            base.orientation.copy_from_slice(&q[3..7]);
            base.linear_velocity.copy_from_slice(&v[..3]);
            base.angular_velocity.copy_from_slice(&v[3..6]);
            base.publish()?;
        }
        let now = if tick.settling { u64::MAX } else { tick.time_ns };
        self.truth.publish(&self.simulation, self.pushes.forces(now))?;
        for robot in &mut self.robots {
            let (simulation, drives) = (&self.simulation, robot.drives.clone());
            let mut state = robot.state.loan()?;
            state.set_count(drives.len());
            state.position_mut().copy_from_slice(&simulation.positions()[drives.clone()]);
            state.velocity_mut().copy_from_slice(&simulation.velocities()[drives.clone()]);
            state.effort_mut().copy_from_slice(&simulation.efforts()[drives]);
            state.publish()?;
        }
        Ok(())
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let reset = match &mut self.randomiser {
            Some(randomiser) => randomiser.start(&mut self.simulation, (episode.index, episode.seed)),
            None => self.simulation.reset(&self.start_q, &self.start_v),
        };
        reset.map_err(|error| StepError::failed(error.to_string()))?;
        self.start = self.simulation.base_pose().translation.vector.into();
        self.robots.iter_mut().for_each(|robot| {
            if let Some(gate) = &mut robot.gate {
                gate.reset();
            }
            (robot.safe, robot.resuming) = (0, 0);
        });
        self.truth.reset();
        (self.last_ns, self.totals) = (None, Totals::NONE);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let totals = &self.totals;
        let mut result = json!({
            "steps": totals.steps,
            "steps_in_safe_state": self.robots.iter().map(|robot| robot.safe).max(),
            "steps_resuming": self.robots.iter().map(|robot| robot.resuming).max(),
            "steps_with_saturated_drives": totals.saturated,
            "steps_at_a_joint_limit": totals.at_limit,
            "steps_beyond_a_velocity_limit": totals.overspeed,
            "steps_near_contact": totals.near_contact,
            "joints": self.simulation.joint_names(),
            "joint_position": self.simulation.positions(),
            "warnings": self.simulation.warnings().iter().map(ToString::to_string).collect::<Vec<_>>(),
        });
        if let Some(objects) = objects::report(&self.simulation) {
            result["objects"] = objects;
        }
        if let Some(randomiser) = &self.randomiser {
            result["randomised"] = randomiser.report();
        }
        for robot in &self.robots {
            let Some(name) = &robot.name else { continue };
            result["robots"][name] = json!({
                "steps_in_safe_state": robot.safe,
                "joints": robot_joints(&self.simulation.joint_names()[robot.drives.clone()], name),
                "joint_position": self.simulation.positions()[robot.drives.clone()],
            });
        }
        if self.base_state.is_some() {
            let pose = self.simulation.base_pose();
            let position = pose.translation.vector;
            let (roll, pitch, yaw) = pose.rotation.euler_angles();
            let (dx, dy) = (position.x - self.start[0], position.y - self.start[1]);
            result["base_position"] = json!([position.x, position.y, position.z]);
            result["base_rpy"] = json!([roll, pitch, yaw]);
            result["base_height_lowest_m"] = json!(totals.lowest);
            result["base_height_highest_m"] = json!(totals.highest);
            result["base_travel_x_m"] = json!(dx);
            result["base_travel_y_m"] = json!(dy);
        }
        Some(result)
    }
}

/// The names of the joints of one of several robots, without that of the robot in front of them.
fn robot_joints(names: &[String], robot: &str) -> Vec<String> {
    let own = |name: &String| name.strip_prefix(robot)?.strip_prefix('/').map(str::to_string);
    names.iter().map(|name| own(name).unwrap_or_else(|| name.clone())).collect()
}

impl<E: PhysicsEngine> PhysicsComponent<E> {
    /// Applies the newest command of each robot as far as its gate lets it pass, or the safe state.
    fn apply_commands(&mut self, tick: &Tick) {
        let Self { simulation, dynamics, gravity, robots, nominal: (model, g), .. } = self;
        for robot in robots {
            let Some(gate) = &mut robot.gate else {
                apply_as_given(&mut robot.command, &mut simulation.commands_mut()[robot.drives.clone()]);
                continue;
            };
            let (drives, q) = (robot.drives.clone(), simulation.configuration());
            let mut of_drives = |effort: &mut [f64]| {
                dynamics.gravity(model, q, *g, gravity);
                let joints = model.joints_of_v(gravity);
                for (effort, drive) in effort.iter_mut().zip(drives.clone()) {
                    // A rotor holds nothing.
                    *effort = joints.get(drive).copied().unwrap_or(0.0);
                }
            };
            let measured = Measured {
                position: &simulation.positions()[drives.clone()],
                velocity: &simulation.velocities()[drives.clone()],
                gravity: &mut of_drives,
            };
            let verdict = gate.check_for(&mut robot.command, measured, tick.dt());
            robot.safe += u64::from(!tick.settling && matches!(verdict, Verdict::Safe { .. }));
            robot.resuming += u64::from(verdict == Verdict::Resuming);
            let commands = &mut simulation.commands_mut()[drives];
            for (command, setpoint) in commands.iter_mut().zip(gate.setpoints()) {
                let JointSetpoint { position, velocity, effort, kp, kd, min_velocity, max_velocity } =
                    *setpoint;
                *command = JointCommand { position, velocity, effort, kp, kd, min_velocity, max_velocity };
            }
        }
    }
}

/// Applies the newest command of simulated drives as it is; one for another number of drives is no command.
fn apply_as_given(input: &mut Input<state::JointCommand>, commands: &mut [JointCommand]) {
    let Some(newest) = input.latest().filter(|newest| newest.count() == commands.len()) else { return };
    for (i, command) in commands.iter_mut().enumerate() {
        let given = JointCommand {
            position: newest.position()[i],
            velocity: newest.velocity()[i],
            effort: newest.effort()[i],
            kp: newest.kp()[i],
            kd: newest.kd()[i],
            ..JointCommand::default()
        };
        if given.is_valid() {
            *command = given;
        }
    }
}

impl Totals {
    const NONE: Self = Self {
        steps: 0,
        saturated: 0,
        at_limit: 0,
        overspeed: 0,
        near_contact: 0,
        lowest: f64::INFINITY,
        highest: f64::NEG_INFINITY,
    };

    fn add(&mut self, report: &StepReport, height: f64) {
        self.lowest = self.lowest.min(height);
        self.highest = self.highest.max(height);
        self.steps += 1;
        self.saturated += u64::from(report.saturated > 0);
        self.at_limit += u64::from(report.at_limit > 0);
        self.overspeed += u64::from(report.overspeed > 0);
        self.near_contact += u64::from(report.near_contact);
    }
}

/// The kinds of this crate, for a program that hosts them.
///
/// ```
/// let names: Vec<_> = motorium_physics::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"physics.articulated"));
/// ```
pub fn kinds() -> [Kind; 3] {
    [Kind::of::<ArticulatedPhysics>(), Kind::of::<MujocoPhysics>(), Kind::of::<RapierPhysics>()]
}
