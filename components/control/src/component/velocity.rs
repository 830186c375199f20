//! `control.qp` that computes velocities: differential inverse kinematics.

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::ControlDiagnostics;
use motorium_robots::{Gains, Kinematics, Model};
use nalgebra::DVector;

use super::config::{Feedback, QpControllerConfig};
use super::conflicts::ConstraintRows;
use super::diagnostics_output::{DiagnosticsOutput, push_bounds, push_conflict};
use super::dynamics_config::InfeasiblePolicy;
use super::objects::MovingObjects;
use super::setup::{ControllerSetup, RowLimits};
use super::tasks::{Fades, Held, TaskBounds};
use super::velocity_figures::VelocityFigures;
use super::{period_ns, results};
use crate::{
    DifferentialIk, FeedForward, IkRows, IkSettings, JointSetpoint, RobotState,
    limits::{AccelerationLimit, PositionLimit, RowLimit, VelocityLimit},
};

/// Cost of violating a constraint task when it is relaxed, 1/(m/s) or 1/(rad/s).
const RELAXATION: f64 = 100.0;

/// A controller that converts targets to joint commands once per step; see [`DifferentialIk`].
///
/// It starts at the measured positions of the first joint state. After a crash it continues from the previous
/// setpoint if the robot is still near it. Without a fresh joint state it commands nothing, so the drives
/// enter their safe state; it restarts with the next joint state. Contradictory constraints are handled by
/// its policy.
pub(super) struct VelocityController {
    joint_state: Input<JointState>,
    joint_command: Output<JointCommand>,
    diagnostics: DiagnosticsOutput,
    model: Model,
    /// Kinematics at the joint positions where the tasks are evaluated.
    kinematics: Kinematics,
    /// At the measured joint positions.
    measured: Kinematics,
    q: DVector<f64>,
    /// Tasks in the order of the configuration.
    tasks: Vec<Held>,
    fades: Fades,
    position: PositionLimit,
    velocity: VelocityLimit,
    acceleration: Option<AccelerationLimit>,
    rows: RowLimits,
    objects: MovingObjects,
    ik: DifferentialIk,
    setpoint: JointSetpoint,
    gains: Gains,
    feed_forward: FeedForward,
    feedback: Feedback,
    max_lead: f64,
    state_timeout_ns: u64,
    target_timeout_ns: u64,
    task_ramp: f64,
    kp_scale: Parameter<f64>,
    kd_scale: Parameter<f64>,
    velocity_fraction: Parameter<f64>,
    checkpoint: Checkpoint,
    /// The setpoint before a crash.
    remembered: Option<Vec<f64>>,
    clock: RunClock,
    /// Time of the newest joint state, ns since the start of the run.
    state_ns: u64,
    /// Time of the last step with a command, ns since the start of the run.
    last_ns: Option<u64>,
    policy: InfeasiblePolicy,
    figures: VelocityFigures,
}

impl VelocityController {
    pub(super) fn configure(config: QpControllerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let parts = ControllerSetup::new(&config, &robot, setup.folder())?;
        let mut tasks = parts
            .tasks(setup.period().as_secs_f64())
            .map(|(place, task)| {
                let head = task.head();
                let level = parts.levels().filter(|level| *level < head.level).count();
                Ok(Held { name: head.name.to_owned(), level, task: task.configure(&place, setup)? })
            })
            .collect::<Result<Vec<_>, ConfigureError>>()?;
        let mut rows = vec![0; parts.levels().count()];
        let (limits, acceleration) = (parts.row_limits(&config)?, parts.acceleration_limit(&config)?);
        let mut room = IkRows { limits: limits.count(), ..IkRows::default() };
        for Held { level, task, .. } in &mut tasks {
            if task.is_constraint() {
                room.held += task.rows();
                continue;
            }
            let soft = task.limits().map_or(0, |(limits, _)| limits.iter().map(|limit| limit.rows()).sum());
            room.soft += soft;
            rows[*level] += task.rows() + soft;
        }
        let objects = MovingObjects::configure(&config, &parts, setup)?;
        let (damping, fades) = (parts.level_damping(&config)?, Fades::new(parts.parameter_count()));
        let policy = config.on_infeasible.unwrap_or(InfeasiblePolicy::Hold);
        let relaxation = (policy == InfeasiblePolicy::Relax).then_some(RELAXATION);
        let ControllerSetup { model, gains, feed_forward, .. } = parts;
        let mut checkpoint = setup.checkpoint(model.nv())?;
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            joint_command: setup.output("joint_command")?,
            diagnostics: DiagnosticsOutput::configure(setup)?,
            kinematics: Kinematics::new(&model),
            measured: Kinematics::new(&model),
            q: DVector::zeros(model.nv()),
            figures: VelocityFigures::new(ConstraintRows::new(&mut tasks, &limits)),
            tasks,
            fades,
            position: config.limits.position,
            velocity: config.limits.velocity,
            acceleration,
            rows: limits,
            objects,
            ik: DifferentialIk::with_room(&model, room, IkSettings { damping: config.damping, relaxation })
                .levels(&rows)
                .level_damping(&damping),
            setpoint: JointSetpoint::new(&model, &vec![0.0; model.nv()]),
            gains,
            feed_forward,
            feedback: config.feedback,
            max_lead: config.max_lead,
            state_timeout_ns: config.state_timeout.ns,
            target_timeout_ns: config.target_timeout.ns,
            task_ramp: config.task_ramp.as_secs_f64(),
            kp_scale: setup.parameter("kp_scale")?,
            kd_scale: setup.parameter("kd_scale")?,
            velocity_fraction: setup.parameter("velocity_fraction")?,
            remembered: checkpoint.resume(),
            checkpoint,
            clock: setup.clock(),
            state_ns: 0,
            last_ns: None,
            policy,
            model,
        })
    }

    pub(super) fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if !self.read_state()? {
            return Ok(());
        }
        let longest = self.state_timeout_ns.max(2 * period_ns(tick));
        let now_ns = self.clock.grid_ns(tick, self.state_ns);
        let unbroken = self.last_ns.replace(now_ns);
        let unbroken = unbroken.filter(|last| now_ns.saturating_sub(*last) <= longest);
        if unbroken.is_none() {
            self.begin();
        }
        // after missed steps the setpoints advance by the elapsed time; otherwise they would fall behind the
        // robot
        let dt = tick.dt() * f64::from(tick.periods_since(unbroken, now_ns));
        let bounds = self.prepare(dt, unbroken.is_none())?;
        let solved = self.solve(&bounds);
        let measured = RobotState { model: &self.model, kinematics: &self.measured, q: self.q.as_slice() };
        for held in &mut self.tasks {
            held.task.record(&measured, dt);
        }
        self.checkpoint.save(self.setpoint.position().iter().copied());
        match (solved, self.policy) {
            // the drives move on their own, so the next setpoint starts from there
            (false, InfeasiblePolicy::SafeStop) => {
                self.setpoint.reset(self.q.as_slice());
                self.feed_forward.reset();
            }
            _ => self.publish(dt)?,
        }
        self.publish_diagnostics(solved)
    }

    pub(super) fn reset(&mut self) {
        self.tasks.iter_mut().for_each(|held| held.task.reset());
        let Self { objects, rows, tasks, .. } = self;
        rows.reset();
        objects.reset(|visit| visit_limits(rows, tasks, visit));
        self.ik.reset();
        (self.last_ns, self.remembered) = (None, None);
        self.figures.reset();
    }

    pub(super) fn result(&self) -> serde_json::Value {
        let mut result = results(&self.tasks);
        self.rows.add_to(&mut result);
        self.objects.add_to(&mut result);
        self.figures.add_to(&mut result, &self.model);
        result
    }

    /// Reads the newest joint state. False without a fresh one.
    fn read_state(&mut self) -> Result<bool, StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(false) };
        self.state_ns = state.time_ns();
        if state.age_ns() > self.state_timeout_ns {
            self.figures.stale += 1;
            self.last_ns = None;
            return Ok(false);
        }
        if state.count() != self.model.nv() {
            return Err(StepError::failed(
                "the joint state has another number of joints than the robot's model",
            ));
        }
        self.q.copy_from_slice(state.position());
        self.measured.update(&self.model, self.q.as_slice());
        Ok(true)
    }

    /// Starts at the measured positions, or at the setpoint before a crash.
    fn begin(&mut self) {
        let near = |setpoint: &Vec<f64>| {
            setpoint.iter().zip(&self.q).all(|(setpoint, q)| (setpoint - q).abs() <= self.max_lead)
        };
        let remembered = self.remembered.as_ref().filter(|setpoint| near(setpoint));
        self.setpoint.reset(remembered.map_or(self.q.as_slice(), Vec::as_slice));
        // it becomes stale now; emptied in place, because memory must not be freed within a step
        if let Some(remembered) = &mut self.remembered {
            remembered.fill(f64::NAN);
        }
        self.feed_forward.reset();
        let start = RobotState { model: &self.model, kinematics: &self.measured, q: self.q.as_slice() };
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
        self.velocity.fraction = self.velocity_fraction.get();
        let Self { objects, rows, tasks, .. } = self;
        objects.update(|visit| visit_limits(rows, tasks, visit))?;
        Ok(bounds)
    }

    /// Moves the setpoint by one tick. False without a solution.
    fn solve(&mut self, bounds: &TaskBounds) -> bool {
        let dt = bounds.dt;
        if self.feedback == Feedback::Setpoint {
            self.kinematics.update(&self.model, self.setpoint.position());
        }
        let solved = self.solve_parts(bounds);
        self.figures.count(solved, &self.ik);
        match solved {
            true => {
                self.setpoint.integrate(self.ik.velocity(), dt);
                self.tasks.iter_mut().for_each(|held| held.task.solved(self.ik.velocity()));
            }
            false => self.setpoint.hold(),
        }
        self.setpoint.limit_tracking_error(self.q.as_slice(), self.max_lead);
        solved
    }

    /// Decides the velocity: by one solution, or while tasks fade by a mixture of some. False without one.
    fn solve_parts(&mut self, bounds: &TaskBounds) -> bool {
        let parts = self.fades.parts();
        self.diagnostics.begin_step();
        self.figures.begin_step();
        let mut solved = true;
        if parts == 1 {
            solved = self.solve_tasks(bounds.dt);
        } else {
            for part in 0..parts {
                let share = self.fades.part(part);
                for held in &mut self.tasks {
                    held.task.weigh(bounds, &mut self.fades);
                }
                solved &= self.solve_tasks(bounds.dt);
                self.ik.mix(share);
            }
            match solved {
                true => _ = self.ik.take_mixture(),
                false => self.ik.drop_mixture(),
            }
        }
        solved
    }

    /// Solves the task stack with the current weights.
    fn solve_tasks(&mut self, dt: f64) -> bool {
        let (kinematics, q) = match self.feedback {
            Feedback::Measured => (&self.measured, self.q.as_slice()),
            Feedback::Setpoint => (&self.kinematics, self.setpoint.position()),
        };
        let state = RobotState { model: &self.model, kinematics, q };
        self.ik.begin();
        for held in &mut self.tasks {
            let constraint = held.task.is_constraint();
            if let Some((limits, weight)) = held.task.limits() {
                for limit in limits {
                    self.ik.add_soft_limit(&state, held.level, limit.as_mut(), weight, dt);
                }
            }
            match held.task.task() {
                Some(task) if constraint => self.ik.constrain(&state, task),
                Some(task) => self.ik.add_task(&state, held.level, task),
                None => {}
            }
        }
        self.ik.add_limit(&state, &self.position, dt);
        self.ik.add_limit(&state, &self.velocity, dt);
        if let Some(limit) = &self.acceleration {
            self.ik.add_acceleration_limit(&state, limit, self.setpoint.velocity(), dt);
        }
        for limit in &mut self.rows.rows {
            self.ik.add_row_limit(&state, limit.as_mut(), dt);
        }
        if let Some(support) = &mut self.rows.support {
            self.ik.add_row_limit(&state, &mut support.limit, dt);
        }
        self.rows.observe();
        self.diagnostics.begin_solve();
        let solved = self.ik.solve().is_ok();
        self.diagnostics.end_solve();
        self.figures.observe(&self.ik);
        solved
    }

    fn publish_diagnostics(&mut self, solved: bool) -> Result<(), StepError> {
        let Self { diagnostics, tasks, ik, model, figures, .. } = self;
        let base = model.nv() - model.joint_count();
        diagnostics.publish(tasks.len(), |message| {
            for constraint in ik.conflict().iter().flat_map(|conflict| conflict.constraints()) {
                push_conflict(message, constraint, base);
            }
            if !solved {
                return;
            }
            let solution = ik.solver().solution();
            message.status = match ik.conflict() {
                Some(_) => ControlDiagnostics::RELAXED,
                None => ControlDiagnostics::SOLVED,
            };
            (message.iterations, message.undecided) = (figures.step_iterations, figures.step_undecided);
            for (residual, held) in message.residual_mut().iter_mut().zip(tasks) {
                *residual = held.task.task().map_or(0.0, |task| task.residual(ik.velocity()));
            }
            if ik.conflict().is_none() {
                push_bounds(message, solution);
            }
        })
    }

    fn publish(&mut self, dt: f64) -> Result<(), StepError> {
        let setpoint = &self.setpoint;
        self.feed_forward.update(setpoint, dt);
        let mut command = self.joint_command.loan()?;
        command.set_count(self.model.nv());
        command.position_mut().copy_from_slice(setpoint.position());
        command.velocity_mut().copy_from_slice(setpoint.velocity());
        command.effort_mut().copy_from_slice(self.feed_forward.effort(
            &self.model,
            self.q.as_slice(),
            setpoint,
        ));
        let scale = |gains: &DVector<f64>, scale: f64, scaled: &mut [f64]| {
            scaled.iter_mut().zip(gains).for_each(|(scaled, gain)| *scaled = scale * gain);
        };
        scale(&self.gains.kp, self.kp_scale.get(), command.kp_mut());
        scale(&self.gains.kd, self.kd_scale.get(), command.kd_mut());
        command.publish()
    }
}

/// Visits all limits of velocity combinations, including soft ones.
fn visit_limits(rows: &mut RowLimits, tasks: &mut [Held], visit: &mut dyn FnMut(&mut dyn RowLimit)) {
    rows.rows.iter_mut().for_each(|limit| visit(limit.as_mut()));
    for (limits, _) in tasks.iter_mut().filter_map(|held| held.task.limits()) {
        limits.iter_mut().for_each(|limit| visit(limit.as_mut()));
    }
}
