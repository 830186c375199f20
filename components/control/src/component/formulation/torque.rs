//! Accelerations and contact forces as unknowns: whole-body inverse dynamics, which computes joint torques.

use motorium::prelude::*;
use motorium::state::ControlDiagnostics;
use nalgebra::Vector3;
use serde_json::{Value, json};

use super::contact_switches::ContactSwitches;
use super::{Formulation, Parts, Room, SolveStats};
use crate::SetpointIntegrator;
use crate::component::config::QpControllerConfig;
use crate::component::diagnostics_output::push_name;
use crate::component::dynamics_config::{InfeasiblePolicy, InverseDynamicsConfig};
use crate::component::fingers::JointVelocity;
use crate::component::measured::MeasuredState;
use crate::component::setup::ControllerSetup;
use crate::inverse_dynamics::{
    Conflicting, ConstraintName, Contact, DynamicsRows, InverseDynamics, InverseDynamicsError,
    JointAccelerationLimits,
};
use crate::tasks::{Held, TaskBounds, TaskCost};

/// Time constant with which the integrated accelerations return to the measured motion, s.
const LEAK: f64 = 0.2;

/// Accelerations and contact forces; see [`InverseDynamics`].
pub(in crate::component) struct Torque {
    control: InverseDynamics,
    contacts: ContactSwitches,
    joints: JointAccelerationLimits,
    fingers: Vec<JointVelocity>,
    /// Velocity setpoint, integrated from the accelerations.
    velocity: Vec<f64>,
    torque: Vec<f64>,
    impedance: f64,
    max_lead: f64,
    stiff_start: f64,
    /// Time since the start, s.
    began_for: f64,
    /// `true` while the last step had no solution.
    failing: bool,
    /// Centre of mass at the start and at the last step, and the largest horizontal distance between them.
    centre: Option<(Vector3<f64>, Vector3<f64>)>,
    farthest: f64,
}

impl Torque {
    pub(in crate::component) fn declare(
        config: &InverseDynamicsConfig,
        parts: &ControllerSetup,
        declare: &mut Declare,
    ) -> Result<(), ConfigError> {
        let QpControllerConfig { gravity, damping, limits, .. } = QpControllerConfig::default();
        config.settings(gravity, damping, &limits)?;
        config.profile_acceleration(&parts.model, parts.profile.as_ref())?;
        let contacts = config.contacts(&parts.model, parts.profile.as_ref())?;
        ContactSwitches::declare(&contacts, parts, declare);
        Ok(())
    }
}

impl Formulation for Torque {
    const NEEDS_VELOCITIES: bool = true;

    fn configure(
        config: &QpControllerConfig,
        parts: &ControllerSetup,
        room: &Room,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let table = config.inverse_dynamics.clone().unwrap_or_default();
        let contacts = table.contacts(&parts.model, parts.profile.as_ref())?;
        let settings = table.settings(config.gravity, config.damping, &config.limits)?;
        let loads = (parts.model.mass() * settings.gravity.norm(), table.contact_ramp.as_secs_f64());
        let switches = ContactSwitches::configure(&contacts, parts, loads, setup)?;
        let rows = DynamicsRows { limits: room.limits, constrained: room.constrained };
        let joints = parts.model.joint_count();
        let mut control = InverseDynamics::with_room(&parts.model, contacts, settings, rows)
            .levels(&room.levels)
            .level_damping(&parts.level_damping(config)?);
        if let Some(most) = table.profile_acceleration(&parts.model, parts.profile.as_ref())? {
            control = control.limit_accelerations(most);
        }
        Ok(Self {
            control,
            contacts: switches,
            joints: settings.joints,
            fingers: Vec::with_capacity(joints),
            velocity: vec![0.0; joints],
            torque: vec![0.0; joints],
            impedance: table.impedance(),
            max_lead: config.max_lead,
            stiff_start: table.stiff_start.as_secs_f64(),
            began_for: 0.0,
            failing: false,
            centre: None,
            farthest: 0.0,
        })
    }

    fn begin(&mut self, measured: &MeasuredState, setpoint: &mut SetpointIntegrator) {
        let (q, v) = measured.joints();
        setpoint.reset(q);
        self.velocity.copy_from_slice(v);
        self.torque.fill(0.0);
        self.began_for = 0.0;
    }

    fn prepare(
        &mut self,
        _: &MeasuredState,
        _: &SetpointIntegrator,
        velocity_fraction: Option<f64>,
        fingers: &[JointVelocity],
        bounds: &TaskBounds,
    ) {
        self.fingers.clear();
        self.fingers.extend_from_slice(fingers);
        if let Some(fraction) = velocity_fraction {
            self.joints.velocity_fraction = fraction.max(1e-6);
            self.control.set_joint_limits(self.joints);
        }
        self.contacts.apply(&mut self.control, bounds.dt, bounds.target_timeout_ns);
    }

    fn pose(&mut self, Parts { measured, tasks, limits }: Parts<'_>, dt: f64) {
        let (control, state) = (&mut self.control, measured.motion());
        control.begin(&state, dt);
        self.fingers.iter().for_each(|finger| control.coast(finger.joint));
        for held in tasks {
            let (level, constraint) = (held.level, held.is_constraint);
            let rows = if constraint { held.task.cost().rows().0 } else { 0 };
            match held.acting(control) {
                Some(TaskCost::Motion(mut task)) if constraint => control.constrain(&state, &mut task),
                Some(TaskCost::Motion(mut task)) => control.add_task(&state, level, &mut task),
                Some(TaskCost::Forces(task)) if constraint => control.constrain(&state, task),
                Some(TaskCost::Forces(task)) => control.add_task(&state, level, task),
                Some(TaskCost::Limits(..)) | None => control.skip_constraint(rows),
            }
        }
        if let Some(support) = limits.support.as_mut().filter(|support| support.follows) {
            support.follow(|visit| control.visit_support(&state, visit));
        }
        for limit in limits.iter_mut() {
            control.add_row_limit(&state, limit, dt);
        }
    }

    fn solve(&mut self) -> Result<(), Option<Conflicting>> {
        match self.control.solve() {
            Ok(_) => Ok(()),
            Err(InverseDynamicsError::Infeasible(conflict)) => Err(Some(conflict)),
            Err(InverseDynamicsError::Pose(_) | InverseDynamicsError::Solve(_)) => Err(None),
        }
    }

    fn stats(&self) -> SolveStats {
        let found = self.control.solution();
        SolveStats { iterations: found.iterations, undecided: found.undecided, slack: found.slack }
    }

    fn unknowns(&self) -> &[f64] {
        self.control.unknowns()
    }

    fn set_unknowns(&mut self, unknowns: &[f64]) {
        self.control.set_unknowns(unknowns);
    }

    fn apply(
        &mut self,
        measured: &MeasuredState,
        setpoint: &mut SetpointIntegrator,
        _: &mut [Held],
        dt: f64,
    ) {
        let (solution, model) = (self.control.solution(), &measured.model);
        self.failing = false;
        self.torque.copy_from_slice(solution.torque.as_slice());
        self.began_for += dt;
        let ((q, measured), leak) = (measured.joints(), dt / LEAK.max(dt));
        if self.began_for <= self.stiff_start {
            self.velocity.copy_from_slice(measured);
            return;
        }
        let accelerations = model.joints_of_v(solution.acceleration.as_slice());
        let velocities = self.velocity.iter_mut().zip(model.velocity_limit());
        for (((velocity, limit), measured), a) in velocities.zip(measured).zip(accelerations) {
            *velocity = (*velocity + a * dt + leak * (measured - *velocity)).clamp(-limit, *limit);
        }
        for JointVelocity { joint, velocity } in &self.fingers {
            self.velocity[*joint] = *velocity;
        }
        setpoint.integrate(&self.velocity, dt);
        setpoint.limit_tracking_error(q, self.max_lead);
    }

    fn hold(
        &mut self,
        measured: &MeasuredState,
        setpoint: &mut SetpointIntegrator,
        policy: InfeasiblePolicy,
    ) {
        // the drives move without this controller now, so the next setpoint starts at their position
        if !std::mem::replace(&mut self.failing, true) || policy == InfeasiblePolicy::SafeStop {
            setpoint.reset(measured.joints().0);
        }
        self.velocity.fill(0.0);
        self.control.write_holding_torque(&measured.motion(), &mut self.torque);
    }

    fn record(&mut self, measured: &MeasuredState, _: &SetpointIntegrator) {
        let centre = measured.kinematics.centre_of_mass(&measured.model).position;
        let (start, last) = self.centre.get_or_insert((centre, centre));
        *last = centre;
        self.farthest = self.farthest.max((centre - *start).xy().norm());
    }

    fn gain_share(&self) -> f64 {
        let left = (self.stiff_start - self.began_for) / (0.5 * self.stiff_start).max(1e-9) + 1.0;
        self.impedance + left.clamp(0.0, 1.0) * (1.0 - self.impedance)
    }

    fn torque(&mut self, _: &MeasuredState, _: &SetpointIntegrator, _: f64) -> &[f64] {
        &self.torque
    }

    fn residual(&self, held: &mut Held) -> Option<f64> {
        held.acting(&self.control).and_then(|cost| cost.residual(self.control.unknowns()))
    }

    fn visit_active(&self, visit: &mut dyn FnMut(ConstraintName)) {
        self.control.visit_active(visit);
    }

    fn active(&self) -> usize {
        self.control.solution().active
    }

    fn push(&self, message: &mut ControlDiagnostics, name: ConstraintName) {
        push_name(message, name, |contact, point| self.control.point_number(contact, point));
    }

    fn contacts(&self) -> Vec<Contact> {
        self.control.contacts().cloned().collect()
    }

    fn reset(&mut self) {
        self.control.reset();
        self.contacts.reset();
        (self.failing, self.centre, self.farthest) = (false, None, 0.0);
    }

    fn add_to(&self, result: &mut Value) {
        self.contacts.add_to(result);
        if let Some((start, last)) = self.centre {
            result["centre_of_mass"] = json!({
                "start": start.as_slice(),
                "end": last.as_slice(),
                "largest_horizontal_distance_m": self.farthest,
            });
        }
    }
}
