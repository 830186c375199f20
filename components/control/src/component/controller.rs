//! `control.qp`: one controller for every formulation.

use motorium::prelude::*;
use motorium::state::ControlDiagnostics;
use motorium_robots::Gains;
use nalgebra::DVector;

use super::config::QpControllerConfig;
use super::conflicts::ConstraintRows;
use super::diagnostics_output::DiagnosticsOutput;
use super::dynamics_config::InfeasiblePolicy;
use super::figures::Figures;
use super::fingers::FingerGoals;
use super::formulation::{Formulation, Parts, Room, SolveStats, Torque, Velocity};
use super::measured::{FreshStep, MeasuredState, required_robot};
use super::objects::MovingObjects;
use super::setup::{ControllerSetup, RowLimits};
use crate::inverse_dynamics::Conflicting;
use crate::limits::RowLimit;
use crate::tasks::{Fades, Held, TaskBounds};
use crate::{GoalSummary, Mixture, SetpointIntegrator};

/// A controller that converts targets to joint commands once per step, by differential inverse kinematics
/// ([`DifferentialIk`](crate::DifferentialIk)) or, with `inverse_dynamics`, by whole-body inverse dynamics
/// ([`InverseDynamics`](crate::inverse_dynamics::InverseDynamics)).
///
/// The controller starts at the measured positions of the first joint state. After a crash, the controller
/// continues from the previous setpoint if the robot is still near that setpoint. Without a fresh joint
/// state, the controller publishes no command, so the drives enter their safe state; it restarts with the
/// next joint state. If constraints contradict each other, the configured policy applies: by default velocity
/// control holds the setpoint, and torque control relaxes constraints.
pub struct QpController(Selected);

/// The controller of the configured formulation.
enum Selected {
    Velocity(Box<Controller<Velocity>>),
    Torque(Box<Controller<Torque>>),
}

impl Component for QpController {
    const KIND: &'static str = "control.qp";
    const SUMMARY: &'static str = "whole-body control: converts task targets to joint commands by inverse kinematics or inverse dynamics";
    const READS_WORLD: bool = true;
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = QpControllerConfig;

    fn declare(config: &QpControllerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let robot = required_robot(declare)?;
        let setup = ControllerSetup::new(config, robot, declare.folder())?;
        declare.input::<JointState>("joint_state", "measured joint state of the robot");
        if setup.model.base().floating {
            declare.input::<BaseState>("base_state", "measured or estimated pose and velocity of the base");
        }
        declare.output::<JointCommand>(
            "joint_command",
            "setpoints, feed-forward efforts and gains of all joints",
        );
        DiagnosticsOutput::declare(declare);
        setup.row_limits(config)?;
        setup.acceleration_limit(config)?;
        MovingObjects::declare(config, &setup, declare);
        FingerGoals::declare(&setup, declare);
        // checks and parameter defaults do not depend on the period
        for (context, task) in setup.tasks(0.0) {
            task.declare(&context, declare)?;
        }
        declare.float("kp_scale", 1.0, 0.0..=2.0, "", "factor of kp of all joints");
        declare.float("kd_scale", 1.0, 0.0..=2.0, "", "factor of kd of all joints");
        if setup.limits_velocities() {
            let (fraction, doc) = (config.limits.velocity.fraction, "fraction of the velocity limits to use");
            declare.float("velocity_fraction", fraction, 0.0..=1.0, "", doc);
        }
        if let Some(dynamics) = &config.inverse_dynamics {
            Torque::declare(dynamics, &setup, declare)?;
        }
        Ok(())
    }

    fn configure(config: QpControllerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self(match &config.inverse_dynamics {
            None => Selected::Velocity(Box::new(Controller::configure(&config, setup)?)),
            Some(_) => Selected::Torque(Box::new(Controller::configure(&config, setup)?)),
        }))
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        match &mut self.0 {
            Selected::Velocity(controller) => controller.step(tick),
            Selected::Torque(controller) => controller.step(tick),
        }
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        match &mut self.0 {
            Selected::Velocity(controller) => controller.reset(),
            Selected::Torque(controller) => controller.reset(),
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(match &self.0 {
            Selected::Velocity(controller) => controller.result(),
            Selected::Torque(controller) => controller.result(),
        })
    }
}

/// A controller with one formulation.
struct Controller<F> {
    measured: MeasuredState,
    joint_command: Output<JointCommand>,
    diagnostics: DiagnosticsOutput,
    /// Tasks in the order of the configuration.
    tasks: Vec<Held>,
    fades: Fades,
    /// Sum of the solutions of a step while tasks fade.
    mixture: Mixture,
    limits: RowLimits,
    objects: MovingObjects,
    fingers: FingerGoals,
    formulation: F,
    /// Commanded positions and velocities of the joints.
    setpoint: SetpointIntegrator,
    gains: Gains,
    policy: InfeasiblePolicy,
    target_timeout_ns: u64,
    task_ramp: f64,
    kp_scale: Parameter<f64>,
    kd_scale: Parameter<f64>,
    /// `None` if no joint moves.
    velocity_fraction: Option<Parameter<f64>>,
    rows: ConstraintRows,
    stats: SolveStats,
    figures: Figures,
}

impl<F: Formulation> Controller<F> {
    fn configure(config: &QpControllerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let parts = ControllerSetup::new(config, &robot, setup.folder())?;
        let mut tasks = parts
            .tasks(setup.period().as_secs_f64())
            .map(|(context, task)| {
                let head = task.head();
                let level = parts.levels().filter(|level| *level < head.level).count();
                let (name, is_constraint) = (head.name.to_owned(), context.is_constraint);
                Ok(Held { name, level, is_constraint, task: task.configure(&context, setup)? })
            })
            .collect::<Result<Vec<_>, ConfigureError>>()?;
        let limits = parts.row_limits(config)?;
        let room = Room::new(&mut tasks, &limits, parts.levels().count());
        let objects = MovingObjects::configure(config, &parts, setup)?;
        let fingers = FingerGoals::configure(&parts, setup)?;
        let velocity_fraction =
            parts.limits_velocities().then(|| setup.parameter("velocity_fraction")).transpose()?;
        let formulation = F::configure(config, &parts, &room, setup)?;
        let (setpoint, fades) =
            (SetpointIntegrator::of_joints(&parts.model), Fades::new(parts.parameter_count()));
        let ControllerSetup { model, gains, .. } = parts;
        Ok(Self {
            joint_command: setup.output("joint_command")?,
            diagnostics: DiagnosticsOutput::configure(setup)?,
            rows: ConstraintRows::new(&mut tasks, &limits),
            figures: Figures::new(tasks.len()),
            stats: SolveStats::default(),
            tasks,
            fades,
            mixture: Mixture::new(formulation.unknowns().len()),
            limits,
            objects,
            fingers,
            formulation,
            setpoint,
            gains,
            policy: config.policy(),
            target_timeout_ns: config.target_timeout.ns,
            task_ramp: config.task_ramp.as_secs_f64(),
            kp_scale: setup.parameter("kp_scale")?,
            kd_scale: setup.parameter("kd_scale")?,
            velocity_fraction,
            measured: MeasuredState::configure(model, config.state_timeout.ns, setup)?
                .velocities(F::NEEDS_VELOCITIES),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(FreshStep { begins, dt }) = self.measured.step(tick)? else { return Ok(()) };
        if begins {
            self.begin();
        }
        let bounds = self.prepare(dt, begins)?;
        let solved = self.solve(&bounds);
        let measured = self.measured.robot();
        for held in &mut self.tasks {
            held.task.record(&measured, dt);
        }
        self.formulation.record(&self.measured, &self.setpoint);
        if solved.is_ok() || self.policy != InfeasiblePolicy::SafeStop {
            self.publish(solved.is_ok(), dt)?;
        }
        self.publish_diagnostics(solved)
    }

    /// Starts at the measured state.
    fn begin(&mut self) {
        self.formulation.begin(&self.measured, &mut self.setpoint);
        let start = self.measured.robot();
        for held in &mut self.tasks {
            held.task.begin(&start);
        }
    }

    /// Applies the current parameters, targets and obstacles.
    fn prepare(&mut self, dt: f64, begins: bool) -> Result<TaskBounds, StepError> {
        let (ramp, target_timeout_ns) = (self.task_ramp, self.target_timeout_ns);
        let bounds = TaskBounds { begins, ramp, dt, max_gain: 0.5 / dt, target_timeout_ns };
        self.fades.begin();
        for held in &mut self.tasks {
            held.task.weigh(&bounds, &mut self.fades);
            held.task.prepare(&bounds);
        }
        let fraction = self.velocity_fraction.as_ref().map(Parameter::get);
        let fingers = self.fingers.step(&self.setpoint, fraction.unwrap_or(1.0), dt);
        self.formulation.prepare(&self.measured, &self.setpoint, fraction, fingers, &bounds);
        let Self { objects, limits, tasks, .. } = self;
        objects.update(|visit| visit_limits(limits, tasks, visit))?;
        Ok(bounds)
    }

    /// Moves the setpoint by one step. If contradictory constraints leave the step without a solution, the
    /// error contains the conflict.
    fn solve(&mut self, bounds: &TaskBounds) -> Result<(), Option<Conflicting>> {
        let solved = self.solve_parts(bounds);
        let Self { formulation, measured, setpoint, tasks, figures, .. } = self;
        match solved {
            Ok(()) => {
                figures.solved(&self.stats, formulation, tasks);
                formulation.apply(measured, setpoint, tasks, bounds.dt);
            }
            Err(conflict) => {
                figures.failed(conflict);
                setpoint.hold();
                formulation.hold(measured, setpoint, self.policy);
            }
        }
        solved
    }

    /// Computes the motion from one solution or, while tasks fade, from a mixture of several.
    fn solve_parts(&mut self, bounds: &TaskBounds) -> Result<(), Option<Conflicting>> {
        let parts = self.fades.parts();
        self.diagnostics.begin_step();
        self.stats = SolveStats::default();
        if parts == 1 {
            return self.solve_tasks(bounds.dt);
        }
        self.mixture.clear();
        for part in 0..parts {
            let share = self.fades.part(part);
            for held in &mut self.tasks {
                held.task.weigh(bounds, &mut self.fades);
            }
            self.solve_tasks(bounds.dt)?;
            self.mixture.add(share, self.formulation.unknowns());
        }
        self.formulation.set_unknowns(self.mixture.unknowns());
        Ok(())
    }

    /// Solves the task stack with the current weights.
    fn solve_tasks(&mut self, dt: f64) -> Result<(), Option<Conflicting>> {
        let Self { measured, tasks, limits, formulation, diagnostics, stats, .. } = self;
        formulation.pose(Parts { measured, tasks, limits }, dt);
        limits.observe();
        diagnostics.begin_solve();
        let solved = formulation.solve();
        diagnostics.end_solve();
        let found = formulation.stats();
        stats.iterations += found.iterations;
        stats.undecided += found.undecided;
        stats.slack = match (stats.slack, found.slack) {
            (Some(one), Some(other)) => Some(one.worse(&other)),
            (one, other) => one.or(other),
        };
        solved
    }

    fn publish_diagnostics(&mut self, solved: Result<(), Option<Conflicting>>) -> Result<(), StepError> {
        let Self { diagnostics, tasks, formulation, stats, .. } = self;
        diagnostics.publish(tasks.len(), |message| {
            let slack = stats.slack.filter(|_| solved.is_ok());
            let conflict = solved.err().unwrap_or(slack.map(|slack| slack.conflict));
            for name in conflict.iter().flat_map(Conflicting::names) {
                formulation.push(message, name);
            }
            if solved.is_err() {
                return;
            }
            (message.iterations, message.undecided) = (stats.iterations, stats.undecided);
            for (residual, held) in message.residual_mut().iter_mut().zip(tasks) {
                *residual = formulation.residual(held).unwrap_or(0.0);
            }
            match slack {
                Some(slack) => {
                    message.status = ControlDiagnostics::RELAXED;
                    (message.contact_slack, message.joint_slack) = (slack.contact, slack.joint);
                }
                None => {
                    message.status = ControlDiagnostics::SOLVED;
                    formulation.visit_active(&mut |name| formulation.push(message, name));
                }
            }
        })
    }

    fn publish(&mut self, solved: bool, dt: f64) -> Result<(), StepError> {
        let Self { formulation, measured, setpoint, gains, fingers, .. } = self;
        // held joints are driven only by the gains of their drives
        let share = if solved { formulation.gain_share() } else { 1.0 };
        let mut command = self.joint_command.loan()?;
        command.set_count(measured.model.joint_count());
        command.position_mut().copy_from_slice(setpoint.position());
        command.velocity_mut().copy_from_slice(setpoint.velocity());
        command.effort_mut().copy_from_slice(formulation.torque(measured, setpoint, dt));
        let scale = |gains: &DVector<f64>, scale: f64, scaled: &mut [f64]| {
            scaled.iter_mut().zip(gains).for_each(|(scaled, gain)| *scaled = scale * gain);
        };
        let (kp_scale, kd_scale) = (self.kp_scale.get(), self.kd_scale.get());
        scale(&gains.kp, share * kp_scale, command.kp_mut());
        scale(&gains.kd, share * kd_scale, command.kd_mut());
        // the grip force of a finger with a goal comes from its gains
        for joint in fingers.moved() {
            command.kp_mut()[joint] = kp_scale * gains.kp[joint];
            command.kd_mut()[joint] = kd_scale * gains.kd[joint];
        }
        command.publish()
    }

    fn reset(&mut self) {
        self.tasks.iter_mut().for_each(|held| held.task.reset());
        self.limits.reset();
        let Self { objects, limits, tasks, .. } = self;
        objects.reset(|visit| visit_limits(limits, tasks, visit));
        self.fingers.reset();
        self.formulation.reset();
        self.figures.reset();
        self.measured.reset();
    }

    fn result(&self) -> serde_json::Value {
        let mut result = goals(&self.tasks);
        self.limits.add_to(&mut result);
        self.objects.add_to(&mut result);
        self.fingers.add_to(&mut result);
        let contacts = self.formulation.contacts();
        self.figures.add_to(&mut result, &self.tasks, |conflict| {
            self.rows.describe(conflict, &self.measured.model, &contacts)
        });
        result["steps_without_fresh_state"] = self.measured.stale().into();
        self.formulation.add_to(&mut result);
        result
    }
}

/// The goals of the tasks, and the result of each.
fn goals(tasks: &[Held]) -> serde_json::Value {
    let mut goals = GoalSummary::default();
    let mut results = serde_json::Map::new();
    for Held { name, task, .. } in tasks {
        if let Some(record) = task.goals() {
            goals = goals.merge(record.summary());
        }
        if let Some(result) = task.result() {
            results.insert(name.clone(), result);
        }
    }
    serde_json::json!({
        "position_error_m": goals.worst.map(|error| error.position),
        "orientation_error_rad": goals.worst.and_then(|error| error.orientation),
        "goals_reached": goals.reached,
        "goals_missed": goals.missed,
        "tasks": results,
    })
}

/// Visits all limits of velocity combinations, including soft ones.
fn visit_limits(limits: &mut RowLimits, tasks: &mut [Held], visit: &mut dyn FnMut(&mut dyn RowLimit)) {
    limits.rows.iter_mut().for_each(|limit| visit(limit.as_mut()));
    tasks.iter_mut().flat_map(Held::limits).for_each(|limit| visit(limit.as_mut()));
}
