//! The robot of a component, and the motion of a place on it.

use motorium::prelude::*;
use motorium_robots::{BaseMode, FrameId, Kinematics, LoadOptions, Loaded, Model, RobotSource};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::encoder::StateTimes;

/// The robot that a component names.
pub(super) fn named<'a>(declare: &'a Declare, needs: &str) -> Result<&'a RobotReference, ConfigError> {
    declare.robot().ok_or_else(|| {
        ConfigError::new(format!("the component names no robot, and needs {needs}"))
            .advise("add `robot = \"NAME\"` to the component")
    })
}

/// Loads the robot of a component.
pub(super) fn load(robot: &RobotReference, base: BaseMode) -> Result<Loaded, ConfigError> {
    let source = RobotSource {
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: None,
    };
    let options = LoadOptions { base, ..LoadOptions::default() };
    source.load_with(&options).map_err(|error| ConfigError::new(error.to_string()))
}

/// The place of a sensor on a robot.
///
/// ```toml
/// frame    = "base"
/// position = [0.05, 0.0, 0.03]
/// rpy      = [0.0, 0.0, 3.14159]
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mount {
    /// Link that carries the sensor. Default: the root link.
    pub frame: Option<String>,
    /// Position of the sensor in the frame of the link (m). Default: its origin.
    pub position: [f64; 3],
    /// Orientation of the sensor there: roll, pitch, yaw about the fixed axes x, y, z, in this order (rad).
    pub rpy: [f64; 3],
}

impl Mount {
    /// The pose of the sensor in the frame of its link.
    pub(super) fn pose(&self) -> Result<Isometry3<f64>, ConfigError> {
        if !self.position.iter().chain(&self.rpy).all(|number| number.is_finite()) {
            return Err(ConfigError::key("mount", "expected finite numbers"));
        }
        let [roll, pitch, yaw] = self.rpy;
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        Ok(Isometry3::from_parts(Translation3::from(self.position), rotation))
    }

    /// The link that carries the sensor.
    pub(super) fn frame(&self, model: &Model) -> Result<FrameId, ConfigError> {
        let name = self.frame.as_deref().unwrap_or(&model.frames()[0].name);
        model.frame(name).map_err(|error| ConfigError::key("mount.frame", error.to_string()))
    }
}

/// A place on a robot, in motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Its pose in the world.
    pub(super) pose: Isometry3<f64>,
    /// Velocity of its origin, axes of the world \[m/s\].
    pub(super) linear: Vector3<f64>,
    /// Times of the state.
    pub(super) times: StateTimes,
}

/// The true motion of a place on a robot, from its base state and its joint state.
pub(super) struct TrueMotion {
    base: Option<Input<BaseState>>,
    joints: Option<Input<JointState>>,
    model: Model,
    kinematics: Kinematics,
    frame: FrameId,
    mount: Isometry3<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    seen: [(u32, u32, u64); 2],
}

impl TrueMotion {
    /// Declares the inputs: `base_state` where the base floats, `joint_state` where joints move the frame.
    pub(super) fn declare(mount: &Mount, declare: &mut Declare) -> Result<(), ConfigError> {
        let model = load(named(declare, "the place of the sensor on it")?, BaseMode::AsFile)?.model;
        let frame = mount.frame(&model)?;
        mount.pose()?;
        let moved = model.frames()[frame.index()].body.is_some();
        if !model.base().floating && !moved {
            return Err(ConfigError::key("mount.frame", "the link does not move: nothing to measure there")
                .advise("name a link that a joint moves"));
        }
        if model.base().floating {
            declare.input::<BaseState>("base_state", "true pose and velocity of the base");
        }
        if moved {
            declare.input::<JointState>("joint_state", "true joint state");
        }
        Ok(())
    }

    /// Opens the inputs.
    pub(super) fn open(mount: &Mount, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let model = load(setup.robot()?, BaseMode::AsFile)?.model;
        let (frame, pose) = (mount.frame(&model)?, mount.pose()?);
        let moved = model.frames()[frame.index()].body.is_some();
        Ok(Self {
            base: if model.base().floating { Some(setup.input("base_state")?) } else { None },
            joints: if moved { Some(setup.input("joint_state")?) } else { None },
            kinematics: Kinematics::new(&model),
            frame,
            mount: pose,
            q: model.neutral(),
            v: vec![0.0; model.nv()],
            model,
            seen: [(0, 0, 0); 2],
        })
    }

    /// The motion, if there is a newer one.
    pub(super) fn newest(&mut self) -> Result<Option<Motion>, StepError> {
        let Self { base, joints, model, q, v, seen, .. } = self;
        let offset = (q.len() - model.joint_count(), v.len() - model.joint_count());
        let mut is_new = false;
        let mut times = None;
        if let Some(input) = joints {
            let Some(state) = input.latest() else { return Ok(None) };
            let count = model.joint_count();
            if state.count() < count {
                return Err(StepError::failed("the joint state has fewer joints than the robot"));
            }
            let stamp = state.stamp();
            is_new |= name(&stamp) != seen[1];
            seen[1] = name(&stamp);
            times = Some(StateTimes { state: state.time_ns(), source: stamp.source_time });
            q[offset.0..].copy_from_slice(&state.position()[..count]);
            v[offset.1..].copy_from_slice(&state.velocity()[..count]);
        }
        if let Some(input) = base {
            let Some(state) = input.latest() else { return Ok(None) };
            let stamp = state.stamp();
            is_new |= name(&stamp) != seen[0];
            seen[0] = name(&stamp);
            times = Some(StateTimes { state: state.time_ns(), source: stamp.source_time });
            q[..3].copy_from_slice(&state.position);
            q[3..7].copy_from_slice(&state.orientation);
            v[..3].copy_from_slice(&state.linear_velocity);
            v[3..6].copy_from_slice(&state.angular_velocity);
        }
        let Some(times) = times.filter(|_| is_new) else { return Ok(None) };
        self.kinematics.update_with_velocity(&self.model, &self.q, &self.v);
        let frame = self.kinematics.pose(&self.model, self.frame);
        let twist = self.kinematics.velocity(&self.model, self.frame);
        let arm = frame.rotation * self.mount.translation.vector;
        Ok(Some(Motion { pose: frame * self.mount, linear: twist.linear + twist.angular.cross(&arm), times }))
    }

    /// Goes back to the start.
    pub(super) fn reset(&mut self) {
        self.seen = [(0, 0, 0); 2];
    }
}

/// What tells one sample from another.
pub(super) fn name(stamp: &Stamp) -> (u32, u32, u64) {
    (stamp.publisher, stamp.restart_count, stamp.sequence)
}
