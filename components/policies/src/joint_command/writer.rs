//! Joint command writer: extends the setpoints of some joints to a command of all joints.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::StepError;
use motorium::state::{JointCommand, JointState};
use motorium::transport::{Input, Output, Parameter};
use motorium_primitives::dmp::{Jet, Quintic};
use motorium_primitives::profile::{Follower, MotionLimits};
use motorium_robots::{Dynamics, Model};
use nalgebra::{DVector, Vector3};

use super::{CommandedJoints, JointCommandConfig, JointPorts};
use crate::robot::unexpected_joints;

/// Fraction of the velocity and acceleration limits that limited setpoints use. Drives overshoot their
/// setpoints.
const LIMIT_SHARE: f64 = 0.9;

/// Commanded quantity of the moved joints.
enum Drive<'a> {
    Position,
    Velocity,
    Effort(&'a [f64]),
}

/// A joint of the robot. The data that a step needs is contiguous in memory, because other components evict
/// the caches between steps.
#[derive(Clone, Copy, Debug)]
struct Joint {
    lower: f64,
    upper: f64,
    velocity_limit: f64,
    effort_limit: f64,
    kp: f64,
    kd: f64,
    /// `true` for a joint without a drive.
    is_passive: bool,
    /// Position in the first joint state, rad or m.
    found: f64,
    /// The newest position and velocity.
    q: f64,
    v: f64,
    /// The commanded position and velocity.
    setpoint: f64,
    rate: f64,
}

impl Joint {
    /// Commands the joint to hold its position of the first joint state.
    #[inline]
    fn hold(&mut self) {
        (self.setpoint, self.rate) = (self.found, 0.0);
    }
}

/// The torques that compensate gravity.
#[derive(Debug)]
struct Compensation {
    model: Model,
    dynamics: Dynamics,
    /// Gravity in the world frame, m/s^2.
    gravity: Vector3<f64>,
    /// Configuration of the model: the pose of a floating base (upright) before the joints.
    configuration: Vec<f64>,
    efforts: Vec<f64>,
}

impl Compensation {
    /// Returns the efforts of all joints at their newest positions.
    fn efforts(&mut self, joints: &[Joint]) -> &[f64] {
        let base = self.configuration.len() - joints.len();
        for (position, joint) in self.configuration[base..].iter_mut().zip(joints) {
            *position = joint.q;
        }
        self.dynamics.gravity(&self.model, &self.configuration, self.gravity, &mut self.efforts);
        self.model.joints_of_v(&self.efforts)
    }
}

/// Setpoints of the moved joints that keep acceleration limits.
#[derive(Debug)]
struct Limiter {
    follower: Follower,
    /// Setpoints before the limits, and their rates.
    target: Vec<f64>,
    rate: Vec<f64>,
    has_started: bool,
    /// Sum of squares, and number, of the differences between limited and unlimited setpoints.
    squares: f64,
    count: u64,
}

impl Limiter {
    /// Limits the setpoints of the joints `moved`. Starts at rest at the initial joint positions.
    fn limit(&mut self, dt: f64, joints: &mut [Joint], moved: &[usize]) {
        if !self.has_started {
            for (target, joint) in self.target.iter_mut().zip(moved) {
                *target = joints[*joint].found;
            }
            self.follower.start(&self.target);
            self.has_started = true;
        }
        for ((target, rate), joint) in self.target.iter_mut().zip(&mut self.rate).zip(moved) {
            let Joint { setpoint, rate: of_joint, .. } = joints[*joint];
            // The follower tracks the target at the end of the step.
            (*target, *rate) = (setpoint - of_joint * dt, of_joint);
        }
        self.follower.step(dt, &self.target, &self.rate);
        let limited = self.follower.position().iter().zip(self.follower.velocity());
        for ((position, velocity), joint) in limited.zip(moved) {
            let joint = &mut joints[*joint];
            self.squares += (position - joint.setpoint).powi(2);
            (joint.setpoint, joint.rate) = (*position, *velocity);
        }
        self.count += moved.len() as u64;
    }
}

/// Commands the joints of a robot. The joints that a policy moves ease from their current positions to its
/// setpoints; the others stay at their initial positions. Setpoints are clamped to the position limits.
#[derive(Debug)]
pub(crate) struct JointCommandWriter {
    /// All joints of the robot.
    joints: Vec<Joint>,
    /// Indices of the moved joints, in the order of the policy.
    moved: Vec<usize>,
    state: Input<JointState>,
    command: Output<JointCommand>,
    kp_scale: Parameter<f64>,
    kd_scale: Parameter<f64>,
    compensation: Option<Box<Compensation>>,
    /// Limits of the setpoints, if the robot's profile has acceleration limits and the policy keeps them.
    limiter: Option<Limiter>,
    acceleration: Option<DVector<f64>>,
    /// Fraction of the easing over time, and its duration, s.
    ease: Quintic,
    ease_duration: f64,
    /// Time since the first joint state, s.
    elapsed: f64,
    is_found: bool,
    /// Time of the newest joint state, ns since the run began.
    state_ns: u64,
}

impl JointCommandWriter {
    /// Creates the writer of a component for a single robot.
    pub(crate) fn new(
        driven: CommandedJoints,
        config: &JointCommandConfig,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        Self::with_ports(driven, config, &JointPorts::single(), setup)
    }

    /// Creates a writer with the given ports.
    pub(crate) fn with_ports(
        driven: CommandedJoints,
        config: &JointCommandConfig,
        ports: &JointPorts,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let CommandedJoints { model, gains, gravity, joints: moved, passive, acceleration } = driven;
        let joint = |joint: usize| Joint {
            lower: model.lower()[joint],
            upper: model.upper()[joint],
            velocity_limit: model.velocity_limit()[joint],
            effort_limit: model.effort_limit()[joint],
            kp: gains.kp[joint],
            kd: gains.kd[joint],
            is_passive: passive.contains(&joint),
            found: 0.0,
            q: 0.0,
            v: 0.0,
            setpoint: 0.0,
            rate: 0.0,
        };
        let joints = (0..model.joint_count()).map(joint).collect();
        let ease_duration = config.ease.as_secs_f64().max(1e-3);
        let compensation = config.gravity_compensation.then(|| {
            Box::new(Compensation {
                dynamics: Dynamics::new(&model),
                configuration: model.neutral(),
                efforts: vec![0.0; model.nv()],
                gravity,
                model,
            })
        });
        Ok(Self {
            joints,
            moved,
            state: setup.input(&ports.state)?,
            command: setup.named_output(&ports.command)?,
            kp_scale: setup.parameter("kp_scale")?,
            kd_scale: setup.parameter("kd_scale")?,
            compensation,
            limiter: None,
            acceleration,
            ease: Quintic::new(0.0, ease_duration, Jet::default(), 1.0),
            ease_duration,
            elapsed: 0.0,
            is_found: false,
            state_ns: 0,
        })
    }

    /// Keeps setpoints within 0.9 times the velocity limits of the robot and the acceleration limits of its
    /// profile for any request of the policy. Joints without an acceleration limit are not limited.
    #[must_use]
    pub(crate) fn within_limits(mut self) -> Self {
        let Some(acceleration) = &self.acceleration else { return self };
        let limits = |joint: &usize| match acceleration[*joint] {
            limit if limit.is_finite() => MotionLimits {
                velocity: LIMIT_SHARE * self.joints[*joint].velocity_limit,
                acceleration: LIMIT_SHARE * limit,
                jerk: f64::INFINITY,
            },
            _ => MotionLimits { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY },
        };
        let range = |joint: &usize| [self.joints[*joint].lower, self.joints[*joint].upper];
        let (limits, ranges) =
            (self.moved.iter().map(limits).collect(), self.moved.iter().map(range).collect());
        let zeros = vec![0.0; self.moved.len()];
        self.limiter = Some(Limiter {
            follower: Follower::new(limits, ranges),
            target: zeros.clone(),
            rate: zeros,
            has_started: false,
            squares: 0.0,
            count: 0,
        });
        self
    }

    /// Restarts with the next joint state.
    pub(crate) fn reset(&mut self) {
        (self.elapsed, self.is_found) = (0.0, false);
        if let Some(limiter) = &mut self.limiter {
            (limiter.has_started, limiter.squares, limiter.count) = (false, 0.0, 0);
        }
    }

    /// Returns the commanded position of a moved joint, rad or m.
    pub(crate) fn setpoint(&self, index: usize) -> f64 {
        self.joints[self.moved[index]].setpoint
    }

    /// Returns the root mean square distance of the limited setpoints from the desired ones, rad or m.
    pub(crate) fn limited_error(&self) -> f64 {
        self.limiter.as_ref().map_or(0.0, |limiter| (limiter.squares / limiter.count.max(1) as f64).sqrt())
    }

    /// Reads the newest joint state. Returns `false` before the first one.
    pub(crate) fn read(&mut self) -> Result<bool, StepError> {
        let Some(state) = self.state.latest() else { return Ok(self.is_found) };
        if state.count() != self.joints.len() {
            return Err(unexpected_joints(self.joints.len(), state.count()));
        }
        let measured = state.position().iter().zip(state.velocity());
        for (joint, (position, velocity)) in self.joints.iter_mut().zip(measured) {
            (joint.q, joint.v) = (*position, *velocity);
        }
        self.state_ns = state.time_ns();
        if !self.is_found {
            self.joints.iter_mut().for_each(|joint| joint.found = joint.q);
            self.is_found = true;
        }
        Ok(true)
    }

    /// Returns the time of the newest joint state, ns since the run began.
    pub(crate) fn state_ns(&self) -> u64 {
        self.state_ns
    }

    /// Returns the measured position of a moved joint, rad or m.
    pub(crate) fn position(&self, index: usize) -> f64 {
        self.joints[self.moved[index]].q
    }

    /// Returns the measured velocity of a moved joint, per second.
    pub(crate) fn speed(&self, index: usize) -> f64 {
        self.joints[self.moved[index]].v
    }

    /// Clamps positions of the moved joints to their limits.
    pub(crate) fn limit(&self, positions: &mut [f64]) {
        for (position, joint) in positions.iter_mut().zip(&self.moved) {
            let Joint { lower, upper, .. } = self.joints[*joint];
            *position = position.max(lower).min(upper);
        }
    }

    /// Returns the velocity limits of the moved joints, rad/s or m/s; infinite if the model specifies none.
    pub(crate) fn velocity_limits(&self) -> impl Iterator<Item = f64> {
        self.moved.iter().map(|joint| self.joints[*joint].velocity_limit)
    }

    /// Commands the setpoints of the moved joints and their rates, per second.
    pub(crate) fn command(&mut self, dt: f64, setpoint: &[f64], rate: &[f64]) -> Result<(), StepError> {
        if !self.is_found {
            return Ok(());
        }
        self.elapsed += dt;
        let ease = self.ease.sample(self.elapsed);
        self.joints.iter_mut().for_each(Joint::hold);
        for ((joint, y), rate) in self.moved.iter().zip(setpoint).zip(rate) {
            let joint = &mut self.joints[*joint];
            let off = y - joint.found;
            let eased = joint.found + ease.value * off;
            joint.setpoint = eased.max(joint.lower).min(joint.upper);
            if joint.setpoint == eased {
                joint.rate = ease.value * rate + ease.rate * off;
            }
        }
        if let Some(limiter) = &mut self.limiter {
            limiter.limit(dt, &mut self.joints, &self.moved);
        }
        self.publish(&Drive::Position)
    }

    /// Commands all joints to hold their positions of the first joint state.
    pub(crate) fn hold(&mut self) -> Result<(), StepError> {
        self.joints.iter_mut().for_each(Joint::hold);
        self.publish(&Drive::Position)
    }

    /// Commands velocities of the moved joints, per second, using only the damping.
    pub(crate) fn command_velocities(&mut self, rate: &[f64]) -> Result<(), StepError> {
        self.joints.iter_mut().for_each(Joint::hold);
        for (joint, rate) in self.moved.iter().zip(rate) {
            let joint = &mut self.joints[*joint];
            (joint.setpoint, joint.rate) = (joint.q, *rate);
        }
        self.publish(&Drive::Velocity)
    }

    /// Commands efforts of the moved joints, N m or N, without gains.
    pub(crate) fn command_efforts(&mut self, effort: &[f64]) -> Result<(), StepError> {
        self.joints.iter_mut().for_each(Joint::hold);
        for joint in &self.moved {
            let joint = &mut self.joints[*joint];
            joint.setpoint = joint.q;
        }
        self.publish(&Drive::Effort(effort))
    }

    /// Publishes the setpoints.
    fn publish(&mut self, drive: &Drive<'_>) -> Result<(), StepError> {
        let joints = &self.joints;
        let mut command = self.command.loan()?;
        command.set_count(joints.len());
        for (position, joint) in command.position_mut().iter_mut().zip(joints) {
            *position = joint.setpoint;
        }
        for (velocity, joint) in command.velocity_mut().iter_mut().zip(joints) {
            *velocity = joint.rate;
        }
        let (kp_scale, kd_scale) = (self.kp_scale.get(), self.kd_scale.get());
        for (kp, joint) in command.kp_mut().iter_mut().zip(joints) {
            *kp = kp_scale * joint.kp;
        }
        for (kd, joint) in command.kd_mut().iter_mut().zip(joints) {
            *kd = kd_scale * joint.kd;
        }
        match &mut self.compensation {
            Some(compensation) => command.effort_mut().copy_from_slice(compensation.efforts(joints)),
            None => command.effort_mut().fill(0.0),
        }
        match drive {
            Drive::Position => {}
            Drive::Velocity => self.moved.iter().for_each(|joint| command.kp_mut()[*joint] = 0.0),
            Drive::Effort(efforts) => {
                for (joint, effort) in self.moved.iter().zip(*efforts) {
                    command.kp_mut()[*joint] = 0.0;
                    command.kd_mut()[*joint] = 0.0;
                    command.effort_mut()[*joint] += effort;
                }
            }
        }
        for (effort, joint) in command.effort_mut().iter_mut().zip(joints) {
            let limit = joint.effort_limit;
            *effort = if joint.is_passive { 0.0 } else { effort.max(-limit).min(limit) };
        }
        command.publish()
    }

    /// Returns `true` once the easing into the movement has finished.
    pub(crate) fn is_eased_in(&self) -> bool {
        self.elapsed >= self.ease_duration
    }
}
