//! `control.qp` that computes torques: whole-body inverse dynamics.

mod diagnostics;
mod solve;
mod switches;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::ControlDiagnostics;
use motorium_robots::Gains;

use super::config::QpControllerConfig;
use super::conflicts::ConstraintRows;
use super::diagnostics_output::{DiagnosticsOutput, push_name};
use super::dynamics_config::{InfeasiblePolicy, InverseDynamicsConfig};
use super::measured::{Freshness, MeasuredState};
use super::objects::MovingObjects;
use super::setup::{ControllerSetup, RowLimits};
use super::tasks::{Fades, Held, TaskBounds};
use super::{period_ns, results};
use crate::JointSetpoint;
use crate::inverse_dynamics::{Conflicting, DynamicsRows, InverseDynamics, JointAccelerationLimits};
use diagnostics::Diagnostics;
use switches::ContactSwitches;

/// A controller of torques, see [`InverseDynamics`].
pub(super) struct TorqueController {
    measured: MeasuredState,
    joint_command: Output<JointCommand>,
    output: DiagnosticsOutput,
    /// Tasks in the order of the configuration.
    tasks: Vec<Held>,
    fades: Fades,
    control: InverseDynamics,
    contacts: ContactSwitches,
    limits: RowLimits,
    rows: ConstraintRows,
    objects: MovingObjects,
    /// The integrated accelerations.
    reference: JointSetpoint,
    reference_velocity: Vec<f64>,
    torque: Vec<f64>,
    gains: Gains,
    impedance: f64,
    stiff_start: f64,
    /// Time since it began, s.
    began_for: f64,
    policy: InfeasiblePolicy,
    max_lead: f64,
    state_timeout_ns: u64,
    target_timeout_ns: u64,
    task_ramp: f64,
    kp_scale: Parameter<f64>,
    kd_scale: Parameter<f64>,
    /// `None` if only forces are decided.
    velocity_fraction: Option<Parameter<f64>>,
    joints: JointAccelerationLimits,
    clock: RunClock,
    last_ns: Option<u64>,
    /// `true` while the last step had no solution.
    failing: bool,
    /// The constraints that left the last step without a solution.
    conflict: Option<Conflicting>,
    diagnostics: Diagnostics,
}

impl TorqueController {
    pub(super) fn declare(
        config: &InverseDynamicsConfig,
        parts: &ControllerSetup,
        declare: &mut Declare,
    ) -> Result<(), ConfigError> {
        let QpControllerConfig { gravity, damping, limits, .. } = QpControllerConfig::default();
        config.settings(gravity, damping, &limits)?;
        let contacts = config.contacts(&parts.model, parts.profile.as_ref())?;
        ContactSwitches::declare(&contacts, parts, declare);
        Ok(())
    }

    pub(super) fn configure(config: &QpControllerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let parts = ControllerSetup::new(config, &robot, setup.folder())?;
        let table = config.inverse_dynamics.clone().unwrap_or_default();
        let mut tasks = parts
            .tasks(setup.period().as_secs_f64())
            .map(|(place, task)| {
                let head = task.head();
                let level = parts.levels().filter(|level| *level < head.level).count();
                Ok(Held { name: head.name.to_owned(), level, task: task.configure(&place, setup)? })
            })
            .collect::<Result<Vec<_>, ConfigureError>>()?;
        let mut rows = vec![0; parts.levels().count()];
        let limits = parts.row_limits(config)?;
        let mut room = DynamicsRows { limits: limits.count(), constrained: 0 };
        for Held { level, task, .. } in &mut tasks {
            let of = if task.is_constraint() { &mut room.constrained } else { &mut rows[*level] };
            *of += task.rows();
        }
        let contacts = table.contacts(&parts.model, parts.profile.as_ref())?;
        let settings = table.settings(config.gravity, config.damping, &config.limits)?;
        let objects = MovingObjects::configure(config, &parts, setup)?;
        let (damping, fades) = (parts.level_damping(config)?, Fades::new(parts.parameter_count()));
        let loads = (parts.model.mass() * settings.gravity.norm(), table.contact_ramp.as_secs_f64());
        let switches = ContactSwitches::configure(&contacts, &parts, loads, setup)?;
        let velocity_fraction =
            parts.limits_velocities().then(|| setup.parameter("velocity_fraction")).transpose()?;
        let ControllerSetup { model, gains, .. } = parts;
        let control = InverseDynamics::with_room(&model, contacts, settings, room)
            .levels(&rows)
            .level_damping(&damping);
        Ok(Self {
            joint_command: setup.output("joint_command")?,
            output: DiagnosticsOutput::configure(setup)?,
            diagnostics: Diagnostics::new(tasks.len()),
            fades,
            joints: control.settings().joints,
            control,
            contacts: switches,
            rows: ConstraintRows::new(&mut tasks, &limits),
            limits,
            tasks,
            objects,
            reference: JointSetpoint::of_joints(&model),
            reference_velocity: vec![0.0; model.joint_count()],
            torque: vec![0.0; model.joint_count()],
            gains,
            impedance: table.impedance(),
            stiff_start: table.stiff_start.as_secs_f64(),
            began_for: 0.0,
            policy: table.on_infeasible,
            max_lead: config.max_lead,
            state_timeout_ns: config.state_timeout.ns,
            target_timeout_ns: config.target_timeout.ns,
            task_ramp: config.task_ramp.as_secs_f64(),
            kp_scale: setup.parameter("kp_scale")?,
            kd_scale: setup.parameter("kd_scale")?,
            velocity_fraction,
            clock: setup.clock(),
            last_ns: None,
            failing: false,
            conflict: None,
            measured: MeasuredState::configure(model, setup)?,
        })
    }

    pub(super) fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        match self.measured.read(self.state_timeout_ns)? {
            Freshness::Fresh => {}
            Freshness::Missing => return Ok(()),
            Freshness::Stale => {
                self.diagnostics.stale += 1;
                self.last_ns = None;
                return Ok(());
            }
        }
        let longest = self.state_timeout_ns.max(2 * period_ns(tick));
        let now_ns = self.clock.grid_ns(tick, self.measured.time_ns);
        let unbroken = self.last_ns.replace(now_ns);
        let unbroken = unbroken.filter(|last| now_ns.saturating_sub(*last) <= longest);
        if unbroken.is_none() {
            self.begin();
        }
        let dt = tick.dt() * f64::from(tick.periods_since(unbroken, now_ns));
        let bounds = self.prepare(dt, unbroken.is_none())?;
        let solved = self.solve(&bounds);
        let measured = self.measured.robot();
        for held in &mut self.tasks {
            held.task.record(&measured, dt);
        }
        self.diagnostics.set_centre_of_mass(measured.kinematics.centre_of_mass(measured.model).position);
        match (solved, self.policy) {
            (false, InfeasiblePolicy::SafeStop) => {}
            (solved, _) => self.publish(solved)?,
        }
        self.publish_diagnostics(solved)
    }

    /// Begins at the measured state.
    fn begin(&mut self) {
        let (q, v) = self.measured.joints();
        self.reference.reset(q);
        self.reference_velocity.copy_from_slice(v);
        self.torque.fill(0.0);
        self.began_for = 0.0;
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
        if let Some(fraction) = &self.velocity_fraction {
            self.joints.velocity_fraction = fraction.get().max(1e-6);
            self.control.set_joint_limits(self.joints);
        }
        self.contacts.apply(&mut self.control, dt, target_timeout_ns);
        let limits = &mut self.limits.rows;
        self.objects.update(|visit| limits.iter_mut().for_each(|limit| visit(limit.as_mut())))?;
        Ok(bounds)
    }

    fn publish_diagnostics(&mut self, solved: bool) -> Result<(), StepError> {
        let Self { output, tasks, control, conflict, .. } = self;
        output.publish(tasks.len(), |message| {
            let solution = control.solution();
            let slack = solution.slack.filter(|_| solved);
            for name in slack.map(|slack| slack.conflict).or(*conflict).iter().flat_map(Conflicting::names) {
                push_name(message, control, name);
            }
            if !solved {
                return;
            }
            (message.iterations, message.undecided) = (solution.iterations, solution.undecided);
            for (residual, held) in message.residual_mut().iter_mut().zip(tasks) {
                *residual = held.counting(control).map_or(0.0, |task| control.residual(task));
            }
            match slack {
                Some(slack) => {
                    message.status = ControlDiagnostics::RELAXED;
                    (message.contact_slack, message.joint_slack) = (slack.contact, slack.joint);
                }
                None => {
                    message.status = ControlDiagnostics::SOLVED;
                    control.visit_active(&mut |name| push_name(message, control, name));
                }
            }
        })
    }

    fn publish(&mut self, solved: bool) -> Result<(), StepError> {
        // held joints are driven by their gains only
        let left = (self.stiff_start - self.began_for) / (0.5 * self.stiff_start).max(1e-9) + 1.0;
        let stiff = left.clamp(0.0, 1.0);
        let share = if solved { self.impedance + stiff * (1.0 - self.impedance) } else { 1.0 };
        let (kp, kd) = (share * self.kp_scale.get(), share * self.kd_scale.get());
        let mut command = self.joint_command.loan()?;
        command.set_count(self.measured.model.joint_count());
        command.position_mut().copy_from_slice(self.reference.position());
        if solved {
            command.velocity_mut().copy_from_slice(self.reference.velocity());
        } else {
            command.velocity_mut().fill(0.0);
        }
        command.effort_mut().copy_from_slice(&self.torque);
        command.kp_mut().iter_mut().zip(&self.gains.kp).for_each(|(out, gain)| *out = kp * gain);
        command.kd_mut().iter_mut().zip(&self.gains.kd).for_each(|(out, gain)| *out = kd * gain);
        command.publish()
    }

    pub(super) fn reset(&mut self) {
        self.tasks.iter_mut().for_each(|held| held.task.reset());
        self.limits.reset();
        let limits = &mut self.limits.rows;
        self.objects.reset(|visit| limits.iter_mut().for_each(|limit| visit(limit.as_mut())));
        self.control.reset();
        self.contacts.reset();
        self.diagnostics.reset();
        (self.last_ns, self.failing) = (None, false);
    }

    pub(super) fn result(&self) -> serde_json::Value {
        let mut result = results(&self.tasks);
        self.limits.add_to(&mut result);
        self.contacts.add_to(&mut result);
        self.objects.add_to(&mut result);
        self.diagnostics.add_to(&mut result, &self.control, &self.tasks, |conflict, contacts| {
            self.rows.describe_torques(conflict, &self.measured.model, contacts)
        });
        result
    }
}
