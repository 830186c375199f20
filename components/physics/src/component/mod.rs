//! `physics.rapier`: the rapier simulation as a component of a graph.

mod config;
mod engine;
mod safe;

use motorium::component::{Checkpoint, Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::safety::{CommandGuard, Judgement};
use motorium::state::{BaseState, JointCommand as CommandBuffer, JointState as StateBuffer};
use motorium::transport::{Input, Output};
use motorium_robots::Dynamics;
use serde_json::json;

use crate::{JointCommand, StepReport};
pub use config::RapierConfig;
use engine::{Engine, build};
use safe::SafeStates;

/// A simulated robot that publishes its joint state and obeys joint commands.
///
/// Every step judges the newest command, moves the world on by the time since the last step, and publishes the state at
/// its end. A command that is stale, has another number of joints, or asks for a negative gain is not applied: the safe
/// state is, as it is before the first command. When steps were skipped the simulation makes up for up to four of them,
/// so that the robot does not stand still while its clock goes on.
///
/// A robot with a fixed base is moved by [`Rapier`](crate::Rapier), one whose base floats by
/// [`Floating`](crate::Floating); the latter's base state is published, too.
///
/// After a crash the robot goes on from where it was, the objects from the start.
///
/// Heap allocations inside rapier (see [`Contacts`](crate::Contacts)) are counted apart.
pub struct RapierPhysics {
    command: Input<CommandBuffer>,
    state: Output<StateBuffer>,
    base_state: Option<Output<BaseState>>,
    guard: CommandGuard,
    simulation: Engine,
    dynamics: Dynamics,
    safe: SafeStates,
    checkpoint: Checkpoint,
    last_ns: Option<u64>,
    /// Where the base started \[m\].
    start: [f64; 3],
    totals: Totals,
}

/// What the whole run saw.
#[derive(Clone, Copy, Debug)]
struct Totals {
    steps: u64,
    saturated: u64,
    at_limit: u64,
    overspeed: u64,
    near_contact: u64,
    refused: u64,
    safe: u64,
    /// Height of the base \[m\].
    lowest: f64,
    highest: f64,
}

/// Skipped steps made up for at once.
const CATCH_UP: u64 = 4;

impl Component for RapierPhysics {
    const KIND: &'static str = "physics.rapier";
    const SUMMARY: &'static str = "simulates a robot in a world of simple objects, with contacts";
    type Config = RapierConfig;

    fn declare(config: &RapierConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.actuator();
        declare.input::<CommandBuffer>("joint_command", "what the drives are told to do");
        declare.output::<StateBuffer>("joint_state", "positions, velocities and efforts after the step");
        let robot = declare.robot().ok_or_else(|| {
            ConfigError::new("it simulates a robot, but the component names none")
                .advise("add `robot = \"NAME\"`")
        })?;
        // Everything that could be refused later is refused now.
        let (_, robot) = build(config, robot)?;
        if robot.model.base().floating {
            declare.output::<BaseState>("base_state", "where the base is after the step, and how it moves");
        }
        Ok(())
    }

    fn configure(config: RapierConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let (mut simulation, robot) = build(&config, &robot)?;
        let (nq, nv) = (simulation.model().nq(), simulation.model().nv());
        let mut checkpoint = setup.checkpoint(nq + nv)?;
        if let Some(state) = checkpoint.resume() {
            let (q, v) = state.split_at(nq);
            simulation.reset(q, v).map_err(ConfigureError::failed)?;
        }
        let floating = simulation.model().base().floating;
        Ok(Self {
            command: setup.input("joint_command")?,
            state: setup.output("joint_state")?,
            base_state: if floating { Some(setup.output("base_state")?) } else { None },
            guard: setup.command_guard(),
            dynamics: Dynamics::new(simulation.model()),
            safe: SafeStates::new(&*simulation, robot.profile.as_ref()),
            start: simulation.base_pose().translation.vector.into(),
            simulation,
            checkpoint,
            last_ns: None,
            totals: Totals::NONE,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.obey();
        let steps = self.steps_due(tick);
        for _ in 0..steps {
            let report =
                self.simulation.step(tick.dt()).map_err(|error| StepError::failed(error.to_string()))?;
            self.totals.add(&report, self.simulation.base_pose().translation.z);
        }
        let (q, v) = (self.simulation.configuration(), self.simulation.velocity());
        self.checkpoint.save(q.iter().chain(v).copied());
        if let Some(output) = &mut self.base_state {
            let mut base = output.loan()?;
            base.position.copy_from_slice(&q[..3]);
            base.orientation.copy_from_slice(&q[3..7]);
            base.linear_velocity.copy_from_slice(&v[..3]);
            base.angular_velocity.copy_from_slice(&v[3..6]);
            base.publish()?;
        }
        let mut state = self.state.loan()?;
        let positions = self.simulation.positions();
        state.set_count(positions.len());
        state.position_mut().copy_from_slice(positions);
        state.velocity_mut().copy_from_slice(self.simulation.velocities());
        state.effort_mut().copy_from_slice(self.simulation.efforts());
        state.publish()?;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let totals = &self.totals;
        let mut result = json!({
            "steps": totals.steps,
            "steps_in_safe_state": totals.safe,
            "commands_refused": totals.refused,
            "steps_with_saturated_drives": totals.saturated,
            "steps_at_a_joint_limit": totals.at_limit,
            "steps_beyond_a_velocity_limit": totals.overspeed,
            "steps_near_contact": totals.near_contact,
            "joint_position": self.simulation.positions(),
            "warnings": self.simulation.warnings().iter().map(ToString::to_string).collect::<Vec<_>>(),
        });
        if self.base_state.is_some() {
            let pose = self.simulation.base_pose();
            let place = pose.translation.vector;
            let (roll, pitch, yaw) = pose.rotation.euler_angles();
            let (dx, dy) = (place.x - self.start[0], place.y - self.start[1]);
            result["base_position"] = json!([place.x, place.y, place.z]);
            result["base_rpy"] = json!([roll, pitch, yaw]);
            result["base_height_lowest_m"] = json!(totals.lowest);
            result["base_height_highest_m"] = json!(totals.highest);
            result["base_travel_x_m"] = json!(dx);
            result["base_travel_y_m"] = json!(dy);
        }
        Some(result)
    }
}

impl RapierPhysics {
    /// Gives the drives the newest command, or the safe state.
    fn obey(&mut self) {
        let judgement = self.guard.judge(&mut self.command);
        let state = match judgement {
            Judgement::Apply(command) => {
                if apply(&command, self.simulation.commands_mut()) {
                    self.safe.leave();
                    return;
                }
                self.totals.refused += 1;
                None
            }
            Judgement::Safe { state, .. } => Some(state),
        };
        self.totals.safe += 1;
        self.safe.apply(state, &mut *self.simulation, &mut self.dynamics);
    }

    /// How many periods have passed since the last step.
    fn steps_due(&mut self, tick: &Tick) -> u64 {
        let period = tick.period.as_nanos().max(1) as u64;
        let elapsed = self.last_ns.map_or(period, |last| tick.time_ns.saturating_sub(last));
        self.last_ns = Some(tick.time_ns);
        // Rounded: triggered components see the publish times of others, which jitter.
        ((elapsed + period / 2) / period).clamp(1, 1 + CATCH_UP)
    }
}

impl Totals {
    const NONE: Self = Self {
        steps: 0,
        saturated: 0,
        at_limit: 0,
        overspeed: 0,
        near_contact: 0,
        refused: 0,
        safe: 0,
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

/// Copies the command, if the drives can follow it as a whole.
fn apply(buffer: &CommandBuffer, commands: &mut [JointCommand]) -> bool {
    let gains = buffer.kp().iter().chain(buffer.kd());
    if buffer.count() != commands.len() || gains.clone().any(|gain| *gain < 0.0) {
        return false;
    }
    for (i, command) in commands.iter_mut().enumerate() {
        *command = JointCommand {
            position: buffer.position()[i],
            velocity: buffer.velocity()[i],
            effort: buffer.effort()[i],
            kp: buffer.kp()[i],
            kd: buffer.kd()[i],
        };
    }
    true
}
