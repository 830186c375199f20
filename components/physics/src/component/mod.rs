//! `physics.articulated`, `physics.rapier` and `physics.mujoco`: simulations as components of a graph.

mod actuators;
mod build;
mod config;
mod follow;
mod limits;
mod merging;
mod objects;
mod placing;
mod pushes;
mod randomise;
mod robots;
mod touched;
mod truth;

use motorium::component::{Checkpoint, Component, ConfigureError, Episode, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{BaseState, JointState};
use motorium::worker::Kind;
use motorium_robots::degrees_doubt;
use serde_json::json;

use crate::{Articulated, BuildWarning, Mujoco, Rapier, Simulation, Simulator, StepReport};
pub use actuators::ActuatorConfig;
pub use build::PhysicsEngine;
use build::{Built, build};
pub use config::{PhysicsConfig, SpringConfig, SurfaceConfig};
pub use pushes::PushConfig;
use pushes::Pushes;
use randomise::Randomiser;
use robots::{Actuated, SafeStates, position};
use truth::Truth;

/// `physics.articulated`: a simulation with the [`Articulated`] engine, for robots with a fixed or a floating
/// base.
pub type ArticulatedPhysics = PhysicsComponent<Articulated>;

/// `physics.rapier`: a simulation with the [`Rapier`] engine, for robots with a fixed base. The engine's heap
/// allocations are counted separately.
pub type RapierPhysics = PhysicsComponent<Rapier>;

/// `physics.mujoco`: a simulation with the [`Mujoco`] engine, for robots with a fixed or a floating base;
/// requires the MuJoCo library.
pub type MujocoPhysics = PhysicsComponent<Mujoco>;

/// One or more simulated robots in one world. Each robot has separate ports and a command gate: it publishes
/// its joint state and follows joint commands. A robot with a floating base also publishes its base state. A
/// robot whose `follow` or `follow_base` is wired is moved along these states instead of by commands.
///
/// Every step passes the newest command through the [`CommandGate`], advances the simulation by the time
/// since the previous step, and publishes the resulting state. After skipped steps, the simulation performs
/// up to four of the skipped steps, so that the robot does not freeze while the clock advances.
///
/// After a crash the robot continues from its last published state, and the objects return to their start
/// states.
pub struct PhysicsComponent<E> {
    robots: Vec<Actuated>,
    truth: Truth,
    simulation: Simulation<E>,
    pushes: Pushes,
    randomiser: Option<Randomiser>,
    safe_states: SafeStates,
    checkpoint: Checkpoint,
    last_ns: Option<u64>,
    /// Initial configuration (nq) and velocity (nv), for every episode.
    start_q: Vec<f64>,
    start_v: Vec<f64>,
    totals: Totals,
}

/// Counts over the whole run.
#[derive(Clone, Copy, Debug)]
struct Totals {
    steps: u64,
    saturated: u64,
    at_limit: u64,
    overspeed: u64,
    near_contact: u64,
}

impl<E: PhysicsEngine> Component for PhysicsComponent<E> {
    const KIND: &'static str = E::KIND;
    const SUMMARY: &'static str = E::SUMMARY;
    const READS_WORLD: bool = true;
    const RESETS: bool = true;
    type Config = PhysicsConfig;

    fn declare(config: &PhysicsConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        // Report every possible configuration error now rather than later.
        let follows = follow::followers(declare.robots(), |port| declare.subscribes(port));
        let robots = (declare.robots(), follows.as_slice());
        let built = build::<E>(config, declare.robot(), robots, declare.folder())?;
        randomise::declare((&config.randomise, &config.connections), &built, declare)?;
        let Built { simulation, robots, doubts, .. } = built;
        for doubt in doubts {
            declare.warn(doubt);
        }
        let rpy = config.base.map_or([0.0; 3], |base| base.rpy);
        if let Some(doubt) = degrees_doubt(&rpy) {
            declare.warn(doubt).key("base.rpy");
        }
        Pushes::new(&config.pushes, simulation.articulations())?;
        // Links that are always close are part of the robot's design, not a mistake that the user could fix.
        let mut warnings = simulation.warnings().to_vec();
        warnings.retain(|warning| !matches!(warning, BuildWarning::SelfCollisionOff { .. }));
        for warning in BuildWarning::summarise(&warnings) {
            declare.warn(warning);
        }
        if follow::declare(config, &robots, declare)? && !config.plant {
            declare.actuator();
        }
        for robot in &robots {
            let doc = "positions, velocities and efforts after the step";
            declare.output::<JointState>(&robot.port("joint_state"), doc);
            if robot.loaded.model.base().floating {
                let doc = "pose and velocity of the base after the step";
                declare.output::<BaseState>(&robot.port("base_state"), doc);
            }
        }
        truth::declare(&robots, &simulation.world, declare);
        Ok(())
    }

    fn configure(config: PhysicsConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (one, several) = (setup.robot().ok().cloned(), setup.robots().to_vec());
        let follows = follow::followers(&several, |port| setup.subscribes(port));
        let Built { mut simulation, robots, on_ground, .. } =
            build::<E>(&config, one.as_ref(), (&several, &follows), setup.folder())?;
        let (start_q, start_v) = (simulation.configuration().to_vec(), simulation.velocity().to_vec());
        let (nq, nv) = (start_q.len(), start_v.len());
        let safe_states = SafeStates::new(&simulation);
        let mut randomiser = Randomiser::open(&config.randomise, (&simulation, &robots, on_ground), setup)?;
        let mut checkpoint = setup.checkpoint(nq + nv + if randomiser.is_some() { 3 } else { 0 })?;
        let state = checkpoint.resume();
        if let Some(randomiser) = &mut randomiser {
            let drawn = state.as_ref().map(|state| [0, 1, 2].map(|place| state[nq + nv + place]));
            let episode = drawn.map_or((0, setup.seed()), Randomiser::episode);
            randomiser.start(&mut simulation, episode).map_err(ConfigureError::failed)?;
        }
        let starts: Vec<[f64; 3]> =
            robots.iter().map(|robot| position(&simulation, robot.articulation)).collect();
        if let Some(state) = state {
            simulation.reset(&state[..nq], &state[nq..nq + nv]).map_err(ConfigureError::failed)?;
        }
        let pushes = Pushes::new(&config.pushes, simulation.articulations())?;
        let truth = Truth::open(&robots, &simulation, setup)?;
        let robots = Actuated::open(robots, (&simulation, &starts), &config, setup)?;
        Ok(Self {
            robots,
            truth,
            safe_states,
            start_q,
            start_v,
            simulation,
            pushes,
            randomiser,
            checkpoint,
            last_ns: None,
            totals: Totals::NONE,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let periods = tick.periods_since(self.last_ns.replace(tick.time_ns), tick.time_ns);
        if let Some(randomiser) = self.randomiser.as_mut().filter(|_| !tick.settling) {
            let followed = randomiser.follow(&mut self.simulation, tick.time_ns);
            followed.map_err(|error| failed(tick, error))?;
        }
        for _ in 0..periods {
            for robot in &mut self.robots {
                let factors = self.randomiser.as_ref().map(Randomiser::drives);
                robot.apply_command(&mut self.simulation, &mut self.safe_states, (tick, factors));
            }
            if !tick.settling {
                self.pushes.apply(&mut self.simulation, tick.time_ns);
            }
            let report = self.simulation.step(tick.dt()).map_err(|error| failed(tick, error))?;
            let pushed_until = if tick.settling { u64::MAX } else { tick.time_ns };
            self.truth.accumulate(&self.simulation, self.pushes.forces(pushed_until), tick.dt());
            if !tick.settling {
                self.totals.add(&report);
                self.robots.iter_mut().for_each(|robot| robot.follow(&self.simulation));
            }
        }
        let (q, v) = (self.simulation.configuration(), self.simulation.velocity());
        let drawn = self.randomiser.as_ref().map(Randomiser::checkpoint);
        self.checkpoint.save(q.iter().chain(v).copied().chain(drawn.into_iter().flatten()));
        if let Some(randomiser) = &mut self.randomiser {
            randomiser.publish()?;
        }
        let now = if tick.settling { u64::MAX } else { tick.time_ns };
        self.truth.publish(&self.simulation, self.pushes.forces(now))?;
        self.robots.iter_mut().try_for_each(|robot| robot.publish(&self.simulation))
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let reset = match &mut self.randomiser {
            Some(randomiser) => randomiser.start(&mut self.simulation, (episode.index, episode.seed)),
            None => self.simulation.reset(&self.start_q, &self.start_v),
        };
        reset.map_err(|error| StepError::failed(error.to_string()))?;
        self.robots.iter_mut().for_each(|robot| robot.reset(&self.simulation));
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
            "warnings": BuildWarning::summarise(self.simulation.warnings()),
        });
        self.truth.report(&self.simulation, &mut result);
        if let Some(objects) = objects::report(&self.simulation) {
            result["objects"] = objects;
        }
        if let Some(randomiser) = &self.randomiser {
            result["randomised"] = randomiser.report();
        }
        for robot in &self.robots {
            robot.report(&self.simulation, &mut result);
        }
        Some(result)
    }
}

/// Creates the error of a step, with its time.
fn failed(tick: &Tick, error: impl core::fmt::Display) -> StepError {
    let settling = if tick.settling { " of settling" } else { "" };
    StepError::failed(format!("at {:.4} s{settling}: {error}", tick.time_ns as f64 * 1e-9))
}

impl Totals {
    const NONE: Self = Self { steps: 0, saturated: 0, at_limit: 0, overspeed: 0, near_contact: 0 };

    fn add(&mut self, report: &StepReport) {
        self.steps += 1;
        self.saturated += u64::from(report.saturated > 0);
        self.at_limit += u64::from(report.at_limit > 0);
        self.overspeed += u64::from(report.overspeed > 0);
        self.near_contact += u64::from(report.near_contact);
    }
}

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_physics::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"physics.articulated"));
/// ```
// Not inlined, as `Kind::of` requires.
#[inline(never)]
pub fn kinds() -> [Kind; 3] {
    [Kind::of::<ArticulatedPhysics>(), Kind::of::<MujocoPhysics>(), Kind::of::<RapierPhysics>()]
}
