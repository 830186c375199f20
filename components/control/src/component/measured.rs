//! The measured state of a robot, from topics.

use motorium::prelude::*;
use motorium_robots::{BasePose, Kinematics, Loaded, Model, RobotSource};

use crate::RobotState;
use crate::inverse_dynamics::MotionState;

/// Loads the robot that the graph assigns to a component.
pub(super) fn load_robot(robot: &RobotReference) -> Result<Loaded, ConfigError> {
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy }),
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
    };
    source.load().map_err(|error| ConfigError::key("robot", error.to_string()))
}

/// Configuration and velocity of a robot, with its kinematics, from the newest states of its joints and its
/// base.
pub(super) struct MeasuredState {
    joint_state: Input<JointState>,
    /// State of a floating base.
    base_state: Option<Input<BaseState>>,
    pub(super) model: Model,
    pub(super) kinematics: Kinematics,
    pub(super) q: Vec<f64>,
    pub(super) v: Vec<f64>,
    /// Time of the joint state, ns.
    pub(super) time_ns: u64,
    /// `true` if the kinematics include velocities.
    velocities: bool,
}

/// Age of the newest state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Freshness {
    /// Nothing published yet.
    Missing,
    /// The state is too old.
    Stale,
    /// A new state was read.
    Fresh,
}

impl MeasuredState {
    pub(super) fn configure(model: Model, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let floating = model.base().floating;
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            base_state: if floating { Some(setup.input("base_state")?) } else { None },
            kinematics: Kinematics::new(&model),
            q: model.neutral(),
            v: vec![0.0; model.nv()],
            time_ns: 0,
            velocities: true,
            model,
        })
    }

    /// The same, with kinematics that include velocities or not.
    pub(super) fn velocities(self, velocities: bool) -> Self {
        Self { velocities, ..self }
    }

    /// Reads the newest state of joints and base, with a maximum age of `timeout_ns`.
    pub(super) fn read(&mut self, timeout_ns: u64) -> Result<Freshness, StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(Freshness::Missing) };
        self.time_ns = state.time_ns();
        let mut stale = state.age_ns() > timeout_ns;
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
            let Some(state) = input.latest() else { return Ok(Freshness::Missing) };
            stale |= state.age_ns() > timeout_ns;
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
            return Ok(Freshness::Stale);
        }
        match self.velocities {
            true => self.kinematics.update_with_velocity(&self.model, &self.q, &self.v),
            false => self.kinematics.update(&self.model, &self.q),
        }
        Ok(Freshness::Fresh)
    }

    /// The state that was read last.
    pub(super) fn motion(&self) -> MotionState<'_> {
        MotionState { model: &self.model, kinematics: &self.kinematics, q: &self.q, v: &self.v }
    }

    /// The same without its velocity.
    pub(super) fn robot(&self) -> RobotState<'_> {
        RobotState { model: &self.model, kinematics: &self.kinematics, q: &self.q }
    }

    /// Positions and velocities of the joints.
    pub(super) fn joints(&self) -> (&[f64], &[f64]) {
        (self.model.joints_of_q(&self.q), self.model.joints_of_v(&self.v))
    }
}
