//! `control.qp`: a controller that moves a robot towards the targets of its tasks, by velocities or by
//! torques.

mod acceleration_limit;
mod centre_of_mass_limit;
mod checks;
mod collision_limits;
mod config;
mod conflicts;
mod diagnostics_output;
mod dynamics_config;
mod frame_limits;
mod limits_config;
mod measured;
mod mpc;
mod multirotor;
mod objects;
mod setup;
mod support_limits;
mod tasks;
mod torque;
mod velocity;
mod velocity_figures;
mod wheels;

pub use acceleration_limit::AccelerationConfig;
pub use centre_of_mass_limit::CentreOfMassLimitConfig;
pub use collision_limits::{AllObjects, CollisionConfig, LevelGround, OfWorld, WorldObjects};
pub use config::{Feedback, LevelConfig, QpControllerConfig};
pub use dynamics_config::{ContactConfig, InfeasiblePolicy, InverseDynamicsConfig, WrenchConfig};
pub use frame_limits::FrameLimitConfig;
pub use limits_config::LimitsConfig;
pub use mpc::{
    FittedConfig, GaitConfig, GroundConfig, HorizonConfig, LandingConfig, MpcConfig, MpcPlanner,
    WeightsConfig,
};
pub use multirotor::{MultirotorConfig, MultirotorController};
pub use support_limits::{SupportConfig, SupportedPoint};
pub use tasks::*;
pub use wheels::{StartConfig, WheelController, WheelsConfig};

use motorium::prelude::*;
use motorium::worker::Kind;

use crate::GoalSummary;
use diagnostics_output::DiagnosticsOutput;
use objects::MovingObjects;
use setup::ControllerSetup;
use torque::TorqueController;
use velocity::VelocityController;

/// A controller that converts targets to joint commands once per step, by differential inverse kinematics
/// ([`DifferentialIk`](crate::DifferentialIk)) or, with `inverse_dynamics`, by whole-body inverse dynamics
/// ([`InverseDynamics`](crate::inverse_dynamics::InverseDynamics)).
///
/// It starts at the measured positions of the first joint state. After a crash it continues from the previous
/// setpoint if the robot is still near it. Without a fresh joint state it commands nothing, so the drives
/// enter their safe state; it restarts with the next joint state. For contradictory constraints the graph
/// selects a policy: by default velocity control holds the setpoint, and torque control relaxes constraints.
pub struct QpController(Formulation);

/// Level at which it computes.
enum Formulation {
    Velocity(Box<VelocityController>),
    Torque(Box<TorqueController>),
}

impl Component for QpController {
    const KIND: &'static str = "control.qp";
    const SUMMARY: &'static str =
        "whole-body control: targets of tasks to joint commands, by inverse kinematics or inverse dynamics";
    const READS_WORLD: bool = true;
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = QpControllerConfig;

    fn declare(config: &QpControllerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let robot = declare.robot().ok_or_else(|| {
            ConfigError::new("the component names no robot to control")
                .advise("add `robot = \"NAME\"` to the component")
        })?;
        let parts = ControllerSetup::new(config, robot, declare.folder())?;
        declare.input::<JointState>("joint_state", "measured joint state of the robot");
        if parts.model.base().floating {
            declare.input::<BaseState>("base_state", "measured or estimated pose and velocity of the base");
        }
        declare.output::<JointCommand>(
            "joint_command",
            "setpoints, feed-forward efforts and gains of all joints",
        );
        DiagnosticsOutput::declare(declare);
        parts.row_limits(config)?;
        parts.acceleration_limit(config)?;
        MovingObjects::declare(config, &parts, declare);
        // checks and parameter defaults do not depend on the period
        for (place, task) in parts.tasks(0.0) {
            task.declare(&place, declare)?;
            task.parameters().into_iter().for_each(|parameter| parameter.declare(task.head().name, declare));
        }
        declare.float("kp_scale", 1.0, 0.0..=2.0, "", "factor of kp of all joints");
        declare.float("kd_scale", 1.0, 0.0..=2.0, "", "factor of kd of all joints");
        if parts.limits_velocities() {
            let (fraction, doc) = (config.limits.velocity.fraction, "fraction of the velocity limits to use");
            declare.float("velocity_fraction", fraction, 0.0..=1.0, "", doc);
        }
        if let Some(dynamics) = &config.inverse_dynamics {
            TorqueController::declare(dynamics, &parts, declare)?;
        }
        Ok(())
    }

    fn configure(config: QpControllerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let formulation = match &config.inverse_dynamics {
            None => Formulation::Velocity(Box::new(VelocityController::configure(config, setup)?)),
            Some(_) => Formulation::Torque(Box::new(TorqueController::configure(&config, setup)?)),
        };
        Ok(Self(formulation))
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        match &mut self.0 {
            Formulation::Velocity(controller) => controller.step(tick),
            Formulation::Torque(controller) => controller.step(tick),
        }
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        match &mut self.0 {
            Formulation::Velocity(controller) => controller.reset(),
            Formulation::Torque(controller) => controller.reset(),
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(match &self.0 {
            Formulation::Velocity(controller) => controller.result(),
            Formulation::Torque(controller) => controller.result(),
        })
    }
}

/// The goals of the tasks, and the result of each.
fn results(held: &[Held]) -> serde_json::Value {
    let mut goals = GoalSummary::default();
    let mut tasks = serde_json::Map::new();
    for Held { name, task, .. } in held {
        if let Some(record) = task.goals() {
            goals = goals.merge(record.summary());
        }
        if let Some(result) = task.result() {
            tasks.insert(name.clone(), result);
        }
    }
    serde_json::json!({
        "position_error_m": goals.worst.map(|error| error.position),
        "orientation_error_rad": goals.worst.and_then(|error| error.orientation),
        "goals_reached": goals.reached,
        "goals_missed": goals.missed,
        "tasks": tasks,
    })
}

fn period_ns(tick: &Tick) -> u64 {
    u64::try_from(tick.period.as_nanos()).unwrap_or(u64::MAX)
}

/// Returns the component kinds of this crate, for a host program.
///
/// ```
/// let names: Vec<_> = motorium_control::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"control.qp"));
/// ```
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn kinds() -> [Kind; 4] {
    [
        Kind::of::<QpController>(),
        Kind::of::<MpcPlanner>(),
        Kind::of::<WheelController>(),
        Kind::of::<MultirotorController>(),
    ]
}
