//! `control.qp` that computes torques: whole-body inverse dynamics.

mod config;
mod diagnostics;
mod solve;

pub use config::{ContactConfig, InfeasiblePolicy, InverseDynamicsConfig, WrenchConfig};

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::ControlDiagnostics;
use motorium_robots::{Gains, Kinematics, Model};

use super::config::QpControllerConfig;
use super::diagnostics_output::{DiagnosticsOutput, push_name};
use super::objects::MovingObjects;
use super::setup::{ControllerSetup, RowLimits};
use super::tasks::{Fades, Held, TaskBounds};
use super::{period_ns, results};
use crate::inverse_dynamics::{
    Conflicting, DynamicsRows, InverseDynamics, InverseDynamicsSettings, JointAccelerationLimits,
};
use crate::{JointSetpoint, RobotState};
use diagnostics::Diagnostics;

/// Normal force at each point of a contact up to which it is loaded, as a multiple of the robot's weight.
const LOADED: f64 = 2.0;

/// A controller of torques, see [`InverseDynamics`].
pub(super) struct TorqueController {
    joint_state: Input<JointState>,
    base_state: Option<Input<BaseState>>,
    joint_command: Output<JointCommand>,
    output: DiagnosticsOutput,
    model: Model,
    /// At the measured state.
    kinematics: Kinematics,
    q: Vec<f64>,
    v: Vec<f64>,
    /// In the order of the configuration.
    tasks: Vec<Held>,
    fades: Fades,
    control: InverseDynamics,
    contacts: Vec<ContactSwitch>,
    limits: RowLimits,
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
    contact_ramp: f64,
    state_timeout_ns: u64,
    target_timeout_ns: u64,
    task_ramp: f64,
    kp_scale: Parameter<f64>,
    kd_scale: Parameter<f64>,
    velocity_fraction: Parameter<f64>,
    joints: JointAccelerationLimits,
    clock: RunClock,
    state_ns: u64,
    last_ns: Option<u64>,
    /// True while the last step had no solution.
    failing: bool,
    /// The constraints that left the last step without a solution.
    conflict: Option<Conflicting>,
    diagnostics: Diagnostics,
}

/// The share of its load that a contact may carry, which follows a parameter.
struct ContactSwitch {
    parameter: Parameter<f64>,
    load: f64,
    /// Largest normal force at each point under full load \[N\], and while it is ramped.
    max_force: f64,
    ramped: f64,
}

impl TorqueController {
    pub(super) fn declare(
        config: &InverseDynamicsConfig,
        parts: &ControllerSetup,
        declare: &mut Declare,
    ) -> Result<(), ConfigError> {
        config.settings(&QpControllerConfig::default())?;
        for contact in config.contacts(&parts.model, parts.profile.as_ref())? {
            let doc = "share of its load that the contact may carry: 0 lifts it, ramped";
            declare.float(&format!("{}_contact", contact.name), 1.0, 0.0..=1.0, "", doc);
        }
        Ok(())
    }

    pub(super) fn configure(config: &QpControllerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let parts = ControllerSetup::new(config, &robot)?;
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
        let settings: InverseDynamicsSettings = table.settings(config)?;
        let objects = MovingObjects::configure(config, &parts, setup)?;
        let (damping, fades) = (parts.level_damping(config)?, Fades::new(parts.parameter_count()));
        let ControllerSetup { model, gains, .. } = parts;
        let weight = model.mass() * settings.gravity.norm();
        let switches = contacts
            .iter()
            .map(|contact| {
                let parameter = setup.parameter(&format!("{}_contact", contact.name))?;
                let max_force = contact.max_force;
                Ok(ContactSwitch { parameter, load: 1.0, max_force, ramped: max_force.min(LOADED * weight) })
            })
            .collect::<Result<Vec<_>, ConfigureError>>()?;
        let control = InverseDynamics::with_room(&model, contacts, settings, room)
            .levels(&rows)
            .level_damping(&damping);
        let floating = model.base().floating;
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            base_state: if floating { Some(setup.input("base_state")?) } else { None },
            joint_command: setup.output("joint_command")?,
            output: DiagnosticsOutput::configure(setup)?,
            kinematics: Kinematics::new(&model),
            q: model.neutral(),
            v: vec![0.0; model.nv()],
            diagnostics: Diagnostics::new(tasks.len()),
            tasks,
            fades,
            joints: control.settings().joints,
            control,
            contacts: switches,
            limits,
            objects,
            reference: JointSetpoint::of_joints(&model),
            reference_velocity: vec![0.0; model.joint_count()],
            torque: vec![0.0; model.joint_count()],
            gains,
            impedance: table.impedance,
            stiff_start: table.stiff_start.as_secs_f64(),
            began_for: 0.0,
            policy: table.on_infeasible,
            max_lead: config.max_lead,
            contact_ramp: table.contact_ramp.as_secs_f64(),
            state_timeout_ns: config.state_timeout.ns,
            target_timeout_ns: config.target_timeout.ns,
            task_ramp: config.task_ramp.as_secs_f64(),
            kp_scale: setup.parameter("kp_scale")?,
            kd_scale: setup.parameter("kd_scale")?,
            velocity_fraction: setup.parameter("velocity_fraction")?,
            clock: setup.clock(),
            state_ns: 0,
            last_ns: None,
            failing: false,
            conflict: None,
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
        let dt = tick.dt() * f64::from(tick.periods_since(unbroken, now_ns));
        let bounds = self.prepare(dt, unbroken.is_none())?;
        let solved = self.solve(&bounds);
        let measured = RobotState { model: &self.model, kinematics: &self.kinematics, q: &self.q };
        for held in &mut self.tasks {
            held.task.record(&measured, dt);
        }
        self.diagnostics.place(self.kinematics.centre_of_mass(&self.model).position);
        match (solved, self.policy) {
            (false, InfeasiblePolicy::SafeStop) => {}
            (solved, _) => self.publish(solved)?,
        }
        self.publish_diagnostics(solved)
    }

    /// Reads the newest state of joints and base. False without a fresh one.
    fn read_state(&mut self) -> Result<bool, StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(false) };
        self.state_ns = state.time_ns();
        let mut stale = state.age_ns() > self.state_timeout_ns;
        if state.count() != self.model.joint_count() {
            return Err(StepError::failed(
                "the joint state has another number of joints than the robot's model",
            ));
        }
        let base = self.model.nv() - self.model.joint_count();
        let base_q = self.model.nq() - self.model.joint_count();
        self.q[base_q..].copy_from_slice(state.position());
        self.v[base..].copy_from_slice(state.velocity());
        if let Some(input) = &mut self.base_state {
            let Some(state) = input.latest() else { return Ok(false) };
            stale |= state.age_ns() > self.state_timeout_ns;
            self.q[..3].copy_from_slice(&state.position);
            self.q[3..7].copy_from_slice(&state.orientation);
            self.v[..3].copy_from_slice(&state.linear_velocity);
            self.v[3..6].copy_from_slice(&state.angular_velocity);
            let length = self.q[3..7].iter().map(|part| part * part).sum::<f64>().sqrt();
            // half the length of a unit quaternion is no rounding error
            if !(0.5..2.0).contains(&length) {
                return Err(StepError::failed("the orientation of the base state is no unit quaternion"));
            }
            self.q[3..7].iter_mut().for_each(|part| *part /= length);
        }
        if stale {
            self.diagnostics.stale += 1;
            self.last_ns = None;
            return Ok(false);
        }
        self.kinematics.update_with_velocity(&self.model, &self.q, &self.v);
        Ok(true)
    }

    /// Begins at the measured state.
    fn begin(&mut self) {
        self.reference.reset(self.model.joints_of_q(&self.q));
        self.reference_velocity.copy_from_slice(self.model.joints_of_v(&self.v));
        self.torque.fill(0.0);
        self.began_for = 0.0;
        let start = RobotState { model: &self.model, kinematics: &self.kinematics, q: &self.q };
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
        self.joints.velocity_fraction = self.velocity_fraction.get().max(1e-6);
        self.control.set_joint_limits(self.joints);
        for (index, switch) in self.contacts.iter_mut().enumerate() {
            let (wanted, step) = (switch.parameter.get(), dt / self.contact_ramp.max(dt));
            switch.load += (wanted - switch.load).clamp(-step, step);
            let full = switch.load >= 1.0;
            self.control.set_active(index, switch.load > 0.0);
            let most = if full { switch.max_force } else { switch.load * switch.ramped };
            self.control.set_max_force(index, most);
        }
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
                *residual = held.task.acceleration().map_or(0.0, |task| control.residual(task));
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
        // held, the joints have nothing but their gains
        let left = (self.stiff_start - self.began_for) / (0.5 * self.stiff_start).max(1e-9) + 1.0;
        let stiff = left.clamp(0.0, 1.0);
        let share = if solved { self.impedance + stiff * (1.0 - self.impedance) } else { 1.0 };
        let (kp, kd) = (share * self.kp_scale.get(), share * self.kd_scale.get());
        let mut command = self.joint_command.loan()?;
        command.set_count(self.model.joint_count());
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
        self.contacts.iter_mut().for_each(|switch| switch.load = 1.0);
        self.diagnostics.reset();
        (self.last_ns, self.failing) = (None, false);
    }

    pub(super) fn result(&self) -> serde_json::Value {
        let mut result = results(&self.tasks);
        self.limits.add_to(&mut result);
        self.diagnostics.add_to(&mut result, &self.control, &self.model, &self.tasks);
        result
    }
}
