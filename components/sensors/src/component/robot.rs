//! The robot of a component, and the motion of a sensor mount on the robot.

use motorium::prelude::*;
use motorium_robots::{
    BaseMode, BasePose, FrameId, Kinematics, LoadOptions, Loaded, Model, RobotSource, degrees_doubt,
};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::doubts::Plausible;
use crate::encoder::StateTimes;

/// Returns the robot that the component names.
pub(super) fn named<'a>(declare: &'a Declare, needs: &str) -> Result<&'a RobotReference, ConfigError> {
    declare.robot().ok_or_else(|| {
        ConfigError::new(format!("the component needs {needs}, but names no robot"))
            .advise("add `robot = \"NAME\"` to the component")
    })
}

/// Returns the error for a joint state with fewer joints than the robot's model.
#[cold]
pub(super) fn too_few_joints(expected: usize, found: usize) -> StepError {
    StepError::failed(format!("joint state: expected at least {expected} joints, found {found}"))
}

/// Loads the robot of a component.
pub(super) fn load(robot: &RobotReference, base: BaseMode) -> Result<Loaded, ConfigError> {
    let source = RobotSource {
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy }),
    };
    let options = LoadOptions { base, ..LoadOptions::default() };
    source.load_with(&options).map_err(|error| ConfigError::new(error.to_string()))
}

/// Warns of angles \[rad\] of the setting `key` that were probably written in degrees.
pub(super) fn warn_of_angles(key: &str, angles: &[f64], declare: &mut Declare) {
    if let Some(doubt) = degrees_doubt(angles) {
        declare.warn(doubt).key(key);
    }
}

/// Plausible distances of a sensor from the origin of its link.
pub(super) const LARGEST_MOUNT: Plausible = Plausible::length(20.0);

/// Name of the frame that never moves.
const WORLD: &str = "world";

/// The mount of a sensor on a robot.
///
/// ```toml
/// frame    = "base"
/// position = [0.05, 0.0, 0.03]
/// rpy      = [0.0, 0.0, 3.14159]
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mount {
    /// Link on which the sensor is mounted. `world` is a mount fixed in the world, unless the robot has a
    /// link of this name. Default: the root link.
    pub frame: Option<String>,
    /// Position of the sensor in the frame of the link (m). Default: the link's origin.
    pub position: [f64; 3],
    /// Orientation of the sensor in the frame of the link: roll, pitch, yaw about the fixed axes x, y, z, in
    /// this order (rad).
    pub rpy: [f64; 3],
}

impl Mount {
    /// Returns the pose of the sensor in the frame of its link.
    ///
    /// # Errors
    /// [`ConfigError`] if a number is not finite.
    pub fn pose(&self) -> Result<Isometry3<f64>, ConfigError> {
        if !self.position.iter().chain(&self.rpy).all(|number| number.is_finite()) {
            return Err(ConfigError::key("mount", "expected finite numbers"));
        }
        let [roll, pitch, yaw] = self.rpy;
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        Ok(Isometry3::from_parts(Translation3::from(self.position), rotation))
    }

    /// Returns the link that carries the sensor; `None` for the world.
    ///
    /// # Errors
    /// [`ConfigError`] if the robot lacks the link.
    pub fn carrier(&self, model: &Model) -> Result<Option<FrameId>, ConfigError> {
        let is_link = || model.frames().iter().any(|frame| frame.name == WORLD);
        if self.frame.as_deref() == Some(WORLD) && !is_link() {
            return Ok(None);
        }
        self.frame(model).map(Some)
    }

    /// Returns the link that carries the sensor.
    pub(super) fn frame(&self, model: &Model) -> Result<FrameId, ConfigError> {
        let name = self.frame.as_deref().unwrap_or(&model.frames()[0].name);
        model.frame(name).map_err(|error| ConfigError::key("mount.frame", error.to_string()))
    }
}

/// Motion of a point on a robot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Pose in the world.
    pub(super) pose: Isometry3<f64>,
    /// Velocity of the origin in world axes \[m/s\].
    pub(super) linear: Vector3<f64>,
    /// Times of the state.
    pub(super) times: StateTimes,
}

/// Motion required by a sensor besides the motion of its mount.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Needs {
    /// None; a fixed mount is rejected.
    Place,
    /// None; the mount may be fixed.
    AnyPlace,
    /// None; the mount may be fixed. The sensor uses the measured motion instead of the true motion.
    Measured,
    /// Motion of all links.
    AllLinks,
}

/// True motion of a point on a robot, from the base state and the joint state.
pub(super) struct TrueMotion {
    base: Option<Input<BaseState>>,
    joints: Option<Input<JointState>>,
    model: Model,
    kinematics: Kinematics,
    /// `None` for the world.
    frame: Option<FrameId>,
    mount: Isometry3<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    seen: [(u32, u32, u64); 2],
}

impl TrueMotion {
    /// Declares the inputs: `base_state` for a floating base, `joint_state` if joints move the frame or all
    /// links are required. Returns the model.
    pub(super) fn declare(mount: &Mount, needs: Needs, declare: &mut Declare) -> Result<Model, ConfigError> {
        let model = load(named(declare, "the link of a robot")?, BaseMode::AsFile)?.model;
        let frame = mount.carrier(&model)?;
        let moved = by_joints(&model, frame, needs);
        let with_base = by_base(&model, frame, needs);
        mount.pose()?;
        let table = if needs == Needs::Measured { "camera" } else { "mount" };
        warn_of_angles(&format!("{table}.rpy"), &mount.rpy, declare);
        if frame.is_some() {
            LARGEST_MOUNT.warn(&format!("{table}.position"), &mount.position, declare);
        }
        if !with_base && !moved && needs == Needs::Place {
            return Err(ConfigError::key(
                "mount.frame",
                "the link does not move, so there is no motion to measure",
            )
            .advise("name a link that a joint moves"));
        }
        let how = if needs == Needs::Measured { "measured" } else { "true" };
        if with_base {
            declare.input::<BaseState>("base_state", &format!("{how} pose and velocity of the base"));
        }
        if moved {
            declare.input::<JointState>("joint_state", &format!("{how} joint state"));
        }
        Ok(model)
    }

    /// Opens the inputs.
    pub(super) fn open(mount: &Mount, needs: Needs, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let model = load(setup.robot()?, BaseMode::AsFile)?.model;
        let (frame, pose) = (mount.carrier(&model)?, mount.pose()?);
        let moved = by_joints(&model, frame, needs);
        let with_base = by_base(&model, frame, needs);
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &model.neutral());
        Ok(Self {
            base: if with_base { Some(setup.input("base_state")?) } else { None },
            joints: if moved { Some(setup.input("joint_state")?) } else { None },
            kinematics,
            frame,
            mount: pose,
            q: model.neutral(),
            v: vec![0.0; model.nv()],
            model,
            seen: [(0, 0, 0); 2],
        })
    }

    /// Returns `true` for a fixed mount on a robot whose motion is not required. There are no inputs then.
    pub(super) fn is_still(&self) -> bool {
        self.base.is_none() && self.joints.is_none()
    }

    /// Returns the model of the robot.
    pub(super) fn model(&self) -> &Model {
        &self.model
    }

    /// Returns the positions and velocities of the joints from the last motion read.
    pub(super) fn joints(&self) -> (&[f64], &[f64]) {
        (self.model.joints_of_q(&self.q), self.model.joints_of_v(&self.v))
    }

    /// Returns the poses of the links from the last motion read.
    pub(super) fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// Returns the pose of the mount from the last motion read.
    pub(super) fn pose(&self) -> Isometry3<f64> {
        match self.frame {
            Some(frame) => self.kinematics.pose(&self.model, frame) * self.mount,
            None => self.mount,
        }
    }

    /// Returns the motion if there is a newer one.
    pub(super) fn newest(&mut self) -> Result<Option<Motion>, StepError> {
        let Self { base, joints, model, q, v, seen, .. } = self;
        let offset = (q.len() - model.joint_count(), v.len() - model.joint_count());
        let mut is_new = false;
        let mut times = None;
        if let Some(input) = joints {
            let Some(state) = input.latest() else { return Ok(None) };
            let count = model.joint_count();
            if state.count() < count {
                return Err(too_few_joints(count, state.count()));
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
        let Some(frame) = self.frame else {
            return Ok(Some(Motion { pose: self.mount, linear: Vector3::zeros(), times }));
        };
        let twist = self.kinematics.velocity(&self.model, frame);
        let frame = self.kinematics.pose(&self.model, frame);
        let arm = frame.rotation * self.mount.translation.vector;
        Ok(Some(Motion { pose: frame * self.mount, linear: twist.linear + twist.angular.cross(&arm), times }))
    }

    /// Resets to the initial state.
    pub(super) fn reset(&mut self) {
        self.seen = [(0, 0, 0); 2];
    }
}

/// Returns `true` if the joint state is required.
fn by_joints(model: &Model, frame: Option<FrameId>, needs: Needs) -> bool {
    let all = needs == Needs::AllLinks && model.joint_count() > 0;
    all || frame.is_some_and(|frame| model.frames()[frame.index()].body.is_some())
}

/// Returns `true` if the base state is required.
fn by_base(model: &Model, frame: Option<FrameId>, needs: Needs) -> bool {
    model.base().floating && (frame.is_some() || needs == Needs::AllLinks)
}

/// Returns the identity of a sample.
pub(super) fn name(stamp: &Stamp) -> (u32, u32, u64) {
    (stamp.publisher, stamp.restart_count, stamp.sequence)
}
