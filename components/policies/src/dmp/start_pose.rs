//! Start pose of the end effector.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{BaseState, JointState};
use motorium::transport::Input;
use motorium_robots::{FrameId, Kinematics, Loaded, Model};
use nalgebra::Isometry3;

use super::config::DmpPolicyConfig;
use super::reachable;
use super::waypoints::{self, Waypoints};
use crate::robot;

/// The start pose of the end effector.
#[derive(Debug)]
pub(super) enum StartPose {
    /// The configured pose.
    Configured(Isometry3<f64>),
    /// The pose computed from the joint state with the robot's model.
    Measured(Box<Measured>),
}

#[derive(Debug)]
pub(super) struct Measured {
    state: Input<JointState>,
    /// State of a floating base.
    base: Option<Input<BaseState>>,
    /// Configuration: the pose of a floating base, then the joint positions.
    q: Vec<f64>,
    model: Model,
    frame: FrameId,
    kinematics: Kinematics,
}

impl StartPose {
    /// Declares the required input, and checks the configuration as far as possible.
    pub(super) fn declare(
        config: &DmpPolicyConfig,
        waypoints: &Waypoints,
        declare: &mut Declare,
    ) -> Result<(), ConfigError> {
        if let Some(start) = &config.start {
            let start = waypoints::pose(start, "start")?;
            if config.frame.is_some() {
                return Err(ConfigError::key("frame", "`frame` has no effect next to a configured `start`")
                    .advise(
                        "remove `frame`, or remove `start` to begin at the measured pose of this frame",
                    ));
            }
            // without a known end effector, the reach of the goals cannot be checked either
            if let Some((loaded, frame)) =
                declare.robot().and_then(|robot| robot::load_moved(robot, None).ok())
            {
                reachable::check(waypoints, &loaded, frame, Some(&start), declare)?;
            }
            return Ok(());
        }
        let robot = declare.robot().ok_or_else(|| {
            ConfigError::new("no `start` is given, and the component names no robot whose pose is measured")
                .advise("add `robot = \"NAME\"` to the component, or give `start` in its config")
        })?;
        let (loaded, frame) = robot::load_moved(robot, config.frame.as_deref())?;
        reachable::check(waypoints, &loaded, frame, None, declare)?;
        declare.input::<JointState>(
            "joint_state",
            "joint state, for the start pose of the end effector and the time of each step",
        );
        if loaded.model.base().floating {
            declare.input::<BaseState>(
                "base_state",
                "pose of the base, needed to compute the pose of the end effector",
            );
        }
        Ok(())
    }

    pub(super) fn new(config: &DmpPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        if let Some(start) = &config.start {
            return Ok(Self::Configured(waypoints::pose(start, "start")?));
        }
        let (Loaded { model, .. }, frame) = robot::load_moved(setup.robot()?, config.frame.as_deref())?;
        let kinematics = Kinematics::new(&model);
        Ok(Self::Measured(Box::new(Measured {
            state: setup.input("joint_state")?,
            base: if model.base().floating { Some(setup.input("base_state")?) } else { None },
            q: model.neutral(),
            model,
            frame,
            kinematics,
        })))
    }

    /// Returns `true` if the pose is measured.
    pub(super) fn is_measured(&self) -> bool {
        matches!(self, Self::Measured(_))
    }

    /// Returns the time of the newest measurement, ns since the run began, if the pose is measured.
    pub(super) fn state_ns(&mut self) -> Option<u64> {
        let Self::Measured(measured) = self else { return None };
        measured.state.latest().map(|state| state.time_ns())
    }

    /// Returns the measured position of the end effector, m, if it is measured.
    pub(super) fn end_effector(&mut self) -> Option<nalgebra::Vector3<f64>> {
        let Self::Measured(measured) = self else { return None };
        measured.find().ok().flatten().map(|pose| pose.translation.vector)
    }

    /// Returns the pose once it is known.
    pub(super) fn find(&mut self) -> Result<Option<Isometry3<f64>>, StepError> {
        match self {
            Self::Configured(pose) => Ok(Some(*pose)),
            Self::Measured(measured) => measured.find(),
        }
    }
}

impl Measured {
    /// Returns the pose of the end effector at the newest states, `None` until joints and base have one.
    fn find(&mut self) -> Result<Option<Isometry3<f64>>, StepError> {
        let Self { state, base, q, model, frame, kinematics } = self;
        let Some(state) = state.latest() else { return Ok(None) };
        if state.count() != model.joint_count() {
            return Err(robot::unexpected_joints(model.joint_count(), state.count()));
        }
        let first = q.len() - model.joint_count();
        q[first..].copy_from_slice(state.position());
        if let Some(base) = base {
            let Some(base) = base.latest() else { return Ok(None) };
            q[..3].copy_from_slice(&base.position);
            q[3..7].copy_from_slice(&base.orientation);
        }
        kinematics.update(model, q);
        Ok(Some(kinematics.pose(model, *frame)))
    }
}
