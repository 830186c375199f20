//! `physics.rapier`: the rapier simulation as a component of a graph.

mod config;
mod safe;

use motorium::component::{Component, ConfigError, ConfigureError, Declare, RobotReference, StepError, Tick};
use motorium::safety::{CommandGuard, Judgement};
use motorium::state::{JointCommand as CommandBuffer, JointState as StateBuffer, MAX_JOINTS};
use motorium::telemetry::set_apart;
use motorium::worker::{Checkpoint, Input, Output, Setup};
use motorium_robots::{Dynamics, Loaded, load};

use crate::{JointCommand, Rapier, Simulator, StepReport};
pub use config::RapierConfig;
use safe::SafeStates;

/// A simulated robot that publishes its joint state and obeys joint commands.
///
/// Every step judges the newest command, moves the world on by the time since the last step, and publishes the state at
/// its end. A command that is stale, has another number of joints, or asks for a negative gain is not applied: the safe
/// state is, as it is before the first command. When steps were skipped the simulation makes up for up to four of them,
/// so that the robot does not stand still while its clock goes on.
///
/// After a crash the robot goes on from where it was, the objects from the start.
///
/// Heap allocations inside rapier (see [`Contacts`](crate::Contacts)) are counted apart.
pub struct RapierPhysics {
    command: Input<CommandBuffer>,
    state: Output<StateBuffer>,
    guard: CommandGuard,
    simulation: Rapier,
    dynamics: Dynamics,
    safe: SafeStates,
    checkpoint: Checkpoint,
    last_ns: Option<u64>,
    totals: Totals,
}

/// What the whole run saw.
#[derive(Clone, Copy, Debug, Default)]
struct Totals {
    steps: u64,
    saturated: u64,
    at_limit: u64,
    overspeed: u64,
    near_contact: u64,
    refused: u64,
    safe: u64,
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
        build(config, robot).map(|_| ())
    }

    fn configure(config: RapierConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let (mut simulation, robot) = build(&config, &robot)?;
        simulation.enclose_rapier(|call| set_apart(call));
        let joints = simulation.model().nv();
        let mut checkpoint = setup.checkpoint(2 * joints)?;
        if let Some(state) = checkpoint.resume() {
            let (q, v) = state.split_at(joints);
            simulation.reset(q, v).map_err(ConfigureError::failed)?;
        }
        Ok(Self {
            command: setup.input("joint_command")?,
            state: setup.output("joint_state")?,
            guard: setup.command_guard(),
            dynamics: Dynamics::new(simulation.model()),
            safe: SafeStates::new(simulation.model(), robot.profile.as_ref()),
            simulation,
            checkpoint,
            last_ns: None,
            totals: Totals::default(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.obey();
        let steps = self.steps_due(tick);
        for _ in 0..steps {
            let report =
                self.simulation.step(tick.dt()).map_err(|error| StepError::failed(error.to_string()))?;
            self.totals.add(&report);
        }
        let (q, v) = (self.simulation.positions(), self.simulation.velocities());
        self.checkpoint.save(q.iter().chain(v).copied());
        let mut state = self.state.loan()?;
        state.set_count(q.len());
        state.position_mut().copy_from_slice(q);
        state.velocity_mut().copy_from_slice(v);
        state.effort_mut().copy_from_slice(self.simulation.efforts());
        state.publish()?;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let totals = &self.totals;
        Some(serde_json::json!({
            "steps": totals.steps,
            "steps_in_safe_state": totals.safe,
            "commands_refused": totals.refused,
            "steps_with_saturated_drives": totals.saturated,
            "steps_at_a_joint_limit": totals.at_limit,
            "steps_beyond_a_velocity_limit": totals.overspeed,
            "steps_near_contact": totals.near_contact,
            "joint_position": self.simulation.positions(),
            "warnings": self.simulation.warnings().iter().map(ToString::to_string).collect::<Vec<_>>(),
        }))
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
        self.safe.apply(state, &mut self.simulation, &mut self.dynamics);
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
    fn add(&mut self, report: &StepReport) {
        self.steps += 1;
        self.saturated += u64::from(report.saturated > 0);
        self.at_limit += u64::from(report.at_limit > 0);
        self.overspeed += u64::from(report.overspeed > 0);
        self.near_contact += u64::from(report.near_contact);
    }
}

/// Copies the command, if the drives can follow it as a whole.
fn apply(buffer: &CommandBuffer, commands: &mut [JointCommand]) -> bool {
    let gains = buffer.stiffness().iter().chain(buffer.damping());
    if buffer.count() != commands.len() || gains.clone().any(|gain| *gain < 0.0) {
        return false;
    }
    for (i, command) in commands.iter_mut().enumerate() {
        *command = JointCommand {
            position: buffer.position()[i],
            velocity: buffer.velocity()[i],
            effort: buffer.effort()[i],
            kp: buffer.stiffness()[i],
            kd: buffer.damping()[i],
        };
    }
    true
}

/// Loads the robot and sets up the simulation.
fn build(config: &RapierConfig, robot: &RobotReference) -> Result<(Rapier, Loaded), ConfigError> {
    let loaded = load(&robot.urdf, &robot.base).map_err(|error| ConfigError::new(error.to_string()))?;
    if loaded.model.base().floating {
        let message =
            format!("robot `{}` has a floating base, and this engine needs a fixed one", robot.name);
        return Err(ConfigError::new(message).advise("fix its base to the world in its URDF"));
    }
    let joints = loaded.model.nv();
    if joints == 0 || joints > MAX_JOINTS {
        let message = format!("robot `{}` has {joints} joints, expected 1 to {MAX_JOINTS}", robot.name);
        return Err(ConfigError::new(message).advise("make joints that need not move fixed in its URDF"));
    }
    let start = config.start(&loaded)?;
    let simulation = Rapier::new(loaded.model.clone(), config.world.clone(), &start, config.solver)
        .map_err(config::refused)?;
    Ok((simulation, loaded))
}
