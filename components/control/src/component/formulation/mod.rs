//! Formulations of `control.qp`: the unknowns of a step, and the joint motion computed from them.

mod contact_switches;
mod torque;
mod velocity;

pub(super) use torque::Torque;
pub(super) use velocity::Velocity;

use motorium::prelude::*;
use motorium::state::ControlDiagnostics;

use super::config::QpControllerConfig;
use super::dynamics_config::InfeasiblePolicy;
use super::fingers::JointVelocity;
use super::measured::MeasuredState;
use super::setup::{ControllerSetup, RowLimits};
use crate::SetpointIntegrator;
use crate::inverse_dynamics::{Conflicting, ConstraintName, Contact, Slack};
use crate::tasks::{Held, TaskBounds};

/// A formulation: builds one problem per step from tasks and limits, and moves the joints by its solution.
pub(super) trait Formulation: Sized {
    /// `true` if the kinematics are evaluated with velocities.
    const NEEDS_VELOCITIES: bool;

    /// Builds the problem, and opens its own inputs and parameters. All memory is allocated here.
    fn configure(
        config: &QpControllerConfig,
        parts: &ControllerSetup,
        room: &Room,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError>;

    /// Sets the setpoint to the measured state, or after a crash to the previous setpoint.
    fn begin(&mut self, measured: &MeasuredState, setpoint: &mut SetpointIntegrator);

    /// Applies parameters, inputs and the velocities of fingers with a goal, once per step, after the tasks
    /// have applied theirs.
    fn prepare(
        &mut self,
        measured: &MeasuredState,
        setpoint: &SetpointIntegrator,
        velocity_fraction: Option<f64>,
        fingers: &[JointVelocity],
        bounds: &TaskBounds,
    );

    /// Builds the problem of a step of `dt` seconds with the current weights.
    fn pose(&mut self, parts: Parts<'_>, dt: f64);

    /// Solves the current problem. If constraints contradict each other, the error contains the conflict.
    fn solve(&mut self) -> Result<(), Option<Conflicting>>;

    /// Statistics of the last solution.
    fn stats(&self) -> SolveStats;

    /// The unknowns of the last solution.
    fn unknowns(&self) -> &[f64];

    /// Replaces the solution by these unknowns.
    fn set_unknowns(&mut self, unknowns: &[f64]);

    /// Moves the setpoint by the solution.
    fn apply(
        &mut self,
        measured: &MeasuredState,
        setpoint: &mut SetpointIntegrator,
        tasks: &mut [Held],
        dt: f64,
    );

    /// Reacts to a step without a solution. The setpoint is already stopped.
    fn hold(&mut self, measured: &MeasuredState, setpoint: &mut SetpointIntegrator, policy: InfeasiblePolicy);

    /// Records the step after its setpoint is known.
    fn record(&mut self, measured: &MeasuredState, setpoint: &SetpointIntegrator);

    /// Fraction of the gains of the joints in a step with a solution.
    fn gain_share(&self) -> f64 {
        1.0
    }

    /// Feed-forward torques of the joints.
    fn torque(&mut self, measured: &MeasuredState, setpoint: &SetpointIntegrator, dt: f64) -> &[f64];

    /// Residual of a task in the last solution; `None` if the task is inactive.
    fn residual(&self, held: &mut Held) -> Option<f64>;

    /// Calls `visit` with each constraint that is active in the last solution.
    fn visit_active(&self, visit: &mut dyn FnMut(ConstraintName));

    /// Number of active constraints.
    fn active(&self) -> usize;

    /// Adds the name of a constraint to a message.
    fn push(&self, message: &mut ControlDiagnostics, name: ConstraintName);

    /// The contacts that names of constraints refer to.
    fn contacts(&self) -> Vec<Contact> {
        Vec::new()
    }

    /// Clears the state of the previous step at the start of an episode.
    fn reset(&mut self);

    /// Adds the entries of the formulation to the result of a run.
    fn add_to(&self, result: &mut serde_json::Value);
}

/// Computing effort of one step, summed over its solutions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SolveStats {
    /// Iterations of all solvers.
    pub(super) iterations: u32,
    /// Levels without a solution.
    pub(super) undecided: u32,
    /// Largest violations, if a solution was relaxed.
    pub(super) slack: Option<Slack>,
}

/// Parts of a controller that a problem is built from.
pub(super) struct Parts<'a> {
    pub(super) measured: &'a MeasuredState,
    pub(super) tasks: &'a mut [Held],
    pub(super) limits: &'a mut RowLimits,
}

/// Numbers of rows of the tasks and limits of a controller.
pub(super) struct Room {
    /// Rows of the tasks and soft limits of each level, highest first.
    pub(super) levels: Vec<usize>,
    /// Rows of tasks that are constraints.
    pub(super) constrained: usize,
    /// Rows of soft limits.
    pub(super) soft: usize,
    /// Rows of limits.
    pub(super) limits: usize,
}

impl Room {
    pub(super) fn new(tasks: &mut [Held], limits: &RowLimits, levels: usize) -> Self {
        let mut room = Self { levels: vec![0; levels], constrained: 0, soft: 0, limits: limits.count() };
        for held in tasks {
            let (rows, soft) = held.task.cost().rows();
            if held.is_constraint {
                room.constrained += rows;
            } else {
                room.soft += soft;
                room.levels[held.level] += rows + soft;
            }
        }
        room
    }
}
