//! Velocities as unknowns: differential inverse kinematics, whose solution moves the setpoint.

use motorium::prelude::*;
use motorium::state::ControlDiagnostics;
use motorium_robots::Kinematics;
use serde_json::{Value, json};

use super::{Formulation, Parts, Room, SolveStats};
use crate::component::config::{Feedback, QpControllerConfig};
use crate::component::diagnostics_output::push_name;
use crate::component::dynamics_config::InfeasiblePolicy;
use crate::component::fingers::JointVelocity;
use crate::component::measured::MeasuredState;
use crate::component::setup::ControllerSetup;
use crate::inverse_dynamics::{Conflicting, ConstraintName, Slack};
use crate::limits::{AccelerationLimit, PositionLimit, VelocityLimit};
use crate::tasks::{Held, TaskBounds, TaskCost};
use crate::{DifferentialIk, FeedForward, IkRows, IkSettings, RobotState, SetpointIntegrator};

/// Cost of violating a constraint task when it is relaxed, 1/(m/s) or 1/(rad/s).
const RELAXATION: f64 = 100.0;

/// Velocities; see [`DifferentialIk`].
pub(in crate::component) struct Velocity {
    ik: DifferentialIk,
    /// Configuration of the measured base with the setpoint's joints, if the tasks are evaluated there.
    at_setpoint: Option<AtSetpoint>,
    /// Joints of the wheels that move the base; another component commands them.
    wheels: Vec<usize>,
    position: PositionLimit,
    velocity: VelocityLimit,
    acceleration: Option<AccelerationLimit>,
    fingers: Vec<JointVelocity>,
    /// Number of velocities of a floating base, 6 or 0.
    base: usize,
    /// Velocities of the measured base, then of the setpoint.
    before: Vec<f64>,
    feed_forward: FeedForward,
    max_lead: f64,
    checkpoint: Checkpoint,
    /// Setpoint from before a crash.
    remembered: Option<Vec<f64>>,
    /// Number of steps that exceeded the acceleration limit.
    beyond_acceleration: u64,
}

/// The setpoint's joints on the measured base.
struct AtSetpoint {
    kinematics: Kinematics,
    q: Vec<f64>,
}

impl AtSetpoint {
    fn update(&mut self, measured: &MeasuredState, setpoint: &SetpointIntegrator) {
        let base = self.q.len() - setpoint.position().len();
        self.q[..base].copy_from_slice(&measured.q[..base]);
        self.q[base..].copy_from_slice(setpoint.position());
        self.kinematics.update(&measured.model, &self.q);
    }
}

impl Velocity {
    /// Returns `true` for the velocity of the base or of one of its wheels, which is no limit.
    fn is_given(&self, name: ConstraintName) -> bool {
        let ConstraintName::Velocity { velocity, .. } = name else { return false };
        velocity.checked_sub(self.base).is_none_or(|joint| self.wheels.contains(&joint))
    }
}

impl Formulation for Velocity {
    const NEEDS_VELOCITIES: bool = false;

    fn configure(
        config: &QpControllerConfig,
        parts: &ControllerSetup,
        room: &Room,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let Room { levels, constrained, soft, limits } = room;
        let rows = IkRows { held: *constrained, limits: *limits, soft: *soft };
        let relaxation = (config.policy() == InfeasiblePolicy::Relax).then_some(RELAXATION);
        let settings = IkSettings { damping: config.damping, relaxation };
        let mut checkpoint = setup.checkpoint(parts.model.joint_count())?;
        Ok(Self {
            ik: DifferentialIk::with_room(&parts.model, rows, settings)
                .levels(levels)
                .level_damping(&parts.level_damping(config)?),
            at_setpoint: (config.feedback == Feedback::Setpoint)
                .then(|| AtSetpoint { kinematics: Kinematics::new(&parts.model), q: parts.model.neutral() }),
            wheels: parts.wheels.clone(),
            base: parts.model.nv() - parts.model.joint_count(),
            before: vec![0.0; parts.model.nv()],
            position: config.limits.position,
            velocity: config.limits.velocity,
            acceleration: parts.acceleration_limit(config)?,
            fingers: Vec::with_capacity(parts.model.joint_count()),
            feed_forward: parts.feed_forward.clone(),
            max_lead: config.max_lead,
            remembered: checkpoint.resume(),
            checkpoint,
            beyond_acceleration: 0,
        })
    }

    fn begin(&mut self, measured: &MeasuredState, setpoint: &mut SetpointIntegrator) {
        let q = measured.joints().0;
        let near = |remembered: &&Vec<f64>| {
            remembered.iter().zip(q).all(|(setpoint, q)| (setpoint - q).abs() <= self.max_lead)
        };
        setpoint.reset(self.remembered.as_ref().filter(near).map_or(q, Vec::as_slice));
        // it becomes stale now; cleared in place, because a step must not free memory
        if let Some(remembered) = &mut self.remembered {
            remembered.fill(f64::NAN);
        }
        self.feed_forward.reset();
    }

    fn prepare(
        &mut self,
        measured: &MeasuredState,
        setpoint: &SetpointIntegrator,
        velocity_fraction: Option<f64>,
        fingers: &[JointVelocity],
        _: &TaskBounds,
    ) {
        self.fingers.clear();
        self.fingers.extend_from_slice(fingers);
        self.velocity.fraction = velocity_fraction.unwrap_or(self.velocity.fraction);
        if let Some(at_setpoint) = &mut self.at_setpoint {
            at_setpoint.update(measured, setpoint);
        }
        self.before[..self.base].copy_from_slice(&measured.v[..self.base]);
        self.before[self.base..].copy_from_slice(setpoint.velocity());
    }

    fn pose(&mut self, Parts { measured, tasks, limits }: Parts<'_>, dt: f64) {
        let Self { ik, at_setpoint, position, velocity, acceleration, fingers, wheels, base, before, .. } =
            self;
        let state = match at_setpoint {
            None => measured.robot(),
            Some(AtSetpoint { kinematics, q }) => RobotState { model: &measured.model, kinematics, q },
        };
        ik.begin();
        for held in tasks {
            let (level, constraint) = (held.level, held.is_constraint);
            match held.task.cost() {
                TaskCost::Motion(mut task) if constraint => ik.constrain(&state, &mut task),
                TaskCost::Motion(mut task) => ik.add_task(&state, level, &mut task),
                TaskCost::Limits(limits, weight) => {
                    for limit in limits {
                        ik.add_soft_limit(&state, level, limit.as_mut(), weight, dt);
                    }
                }
                TaskCost::Forces(_) => {}
            }
        }
        ik.add_limit(&state, position, dt);
        ik.add_limit(&state, velocity, dt);
        if let Some(limit) = acceleration {
            ik.add_acceleration_limit(&state, limit, before, dt);
        }
        for (index, velocity) in before[..*base].iter().enumerate() {
            ik.prescribe(index, *velocity);
        }
        for wheel in wheels.iter() {
            ik.prescribe(*base + wheel, 0.0);
        }
        for JointVelocity { joint, velocity } in fingers {
            ik.prescribe(*base + *joint, *velocity);
        }
        for limit in limits.iter_mut() {
            ik.add_row_limit(&state, limit, dt);
        }
    }

    fn solve(&mut self) -> Result<(), Option<Conflicting>> {
        match self.ik.solve() {
            Ok(_) => Ok(()),
            Err(_) => Err(self.ik.conflict().map(|conflict| conflict.names)),
        }
    }

    fn stats(&self) -> SolveStats {
        let slack = self.ik.conflict().map(|conflict| Slack {
            task: conflict.slack,
            conflict: conflict.names,
            ..Slack::default()
        });
        SolveStats { iterations: self.ik.iterations(), undecided: self.ik.undecided(), slack }
    }

    fn unknowns(&self) -> &[f64] {
        self.ik.unknowns()
    }

    fn set_unknowns(&mut self, unknowns: &[f64]) {
        self.ik.set_unknowns(unknowns);
    }

    fn apply(
        &mut self,
        measured: &MeasuredState,
        setpoint: &mut SetpointIntegrator,
        tasks: &mut [Held],
        dt: f64,
    ) {
        setpoint.integrate(measured.model.joints_of_v(self.ik.velocity()), dt);
        setpoint.limit_tracking_error(measured.joints().0, self.max_lead);
        tasks.iter_mut().for_each(|held| held.task.solved(self.ik.velocity()));
        self.beyond_acceleration += u64::from(self.ik.exceeds_acceleration());
    }

    fn hold(
        &mut self,
        measured: &MeasuredState,
        setpoint: &mut SetpointIntegrator,
        policy: InfeasiblePolicy,
    ) {
        let q = measured.joints().0;
        setpoint.limit_tracking_error(q, self.max_lead);
        // the drives move without this controller now, so the next setpoint starts at their position
        if policy == InfeasiblePolicy::SafeStop {
            setpoint.reset(q);
            self.feed_forward.reset();
        }
    }

    fn record(&mut self, _: &MeasuredState, setpoint: &SetpointIntegrator) {
        self.checkpoint.save(setpoint.position().iter().copied());
    }

    fn torque(&mut self, measured: &MeasuredState, setpoint: &SetpointIntegrator, dt: f64) -> &[f64] {
        self.feed_forward.update(setpoint, dt);
        self.feed_forward.effort(&measured.model, &measured.q, &measured.v[..self.base], setpoint)
    }

    fn residual(&self, held: &mut Held) -> Option<f64> {
        held.task.cost().residual(self.ik.velocity())
    }

    fn visit_active(&self, visit: &mut dyn FnMut(ConstraintName)) {
        self.ik.visit_active(&mut |name| {
            if !self.is_given(name) {
                visit(name);
            }
        });
    }

    fn active(&self) -> usize {
        let mut active = 0;
        self.visit_active(&mut |_| active += 1);
        active
    }

    fn push(&self, message: &mut ControlDiagnostics, name: ConstraintName) {
        let name = match name {
            ConstraintName::Velocity { velocity, side } => match velocity.checked_sub(self.base) {
                Some(joint) => ConstraintName::Velocity { velocity: joint, side },
                None => ConstraintName::Base { axis: velocity },
            },
            name => name,
        };
        // a velocity-controlled robot has no contacts
        push_name(message, name, |_, point| point);
    }

    fn reset(&mut self) {
        self.ik.reset();
        (self.remembered, self.beyond_acceleration) = (None, 0);
    }

    fn add_to(&self, result: &mut Value) {
        result["solver"]["steps_beyond_acceleration"] = json!(self.beyond_acceleration);
    }
}
