//! The `config` table of the physics kinds.

use std::collections::BTreeMap;

use motorium::declare::ConfigError;
use motorium_robots::{
    BaseMode, BasePose, FrictionCombine, Grain, Loaded, Model, PerJoint, Posture, Softness,
};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use schemars::JsonSchema;
use serde::Deserialize;

use super::actuators::ActuatorConfig;
use super::pushes::PushConfig;
use crate::randomise::RandomiseConfig;
use crate::{BuildError, Connection, Options, RobotSetup, Simulator, World};

/// Configuration of the physics kinds: start of robots, their surroundings, and the settings of the engine.
///
/// ```toml
/// solver = { contact_iterations = 4 }
/// world  = { ground = { friction = 0.8 } }
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsConfig {
    /// Named pose of the robot's profile, or of its SRDF, to start in. Without it and `position`: the home
    /// pose, or, for a robot without a profile, all joints at zero (at the middle of their range where zero
    /// is outside).
    pub pose: Option<String>,
    /// Joint positions to start at, rad or m: one number for all joints, or one for each in their order.
    /// Instead of `pose`.
    pub position: Option<PerJoint>,
    /// True: the root link moves freely; false: it is fixed to the world. Default: from the robot's profile
    /// and file. `physics.rapier` simulates fixed bases only.
    pub floating: Option<bool>,
    /// Start of a floating base. Without it: where the profile has it in the pose, or standing on the ground.
    pub base: Option<BaseStart>,
    /// Starts of several robots, by their names. Default: `pose`, or the home pose of each.
    pub start: BTreeMap<String, RobotStart>,
    /// Gravity, ground and objects around the robot, in a graph without a `[world]`.
    pub world: World,
    /// Forces and torques from outside at stated times.
    pub pushes: Vec<PushConfig>,
    /// The actuators of all joints; `physics.articulated` alone simulates them. Default: ideal ones.
    pub actuator: Option<ActuatorConfig>,
    /// Actuators of single joints by their names, in place of `actuator`. With several robots a name is
    /// `ROBOT/JOINT`.
    pub actuators: BTreeMap<String, ActuatorConfig>,
    /// Connections of links and objects besides the joints of the robots, in their initial relative poses:
    /// they close loops. With several robots a link is `ROBOT/LINK`.
    pub connections: Vec<Connection>,
    /// Springs in joints by joint name, replacing the MJCF file's. With several robots a name is
    /// `ROBOT/JOINT`.
    pub springs: BTreeMap<String, SpringConfig>,
    /// Surfaces of single links by name, replacing `solver`'s and the profile's. With several robots a name
    /// is `ROBOT/LINK`.
    pub surfaces: BTreeMap<String, SurfaceConfig>,
    /// Ranges of physical properties, drawn at the start of every episode. Default: nothing is drawn.
    pub randomise: RandomiseConfig,
    /// Settings of the engine.
    pub solver: Options,
    /// True: the commands come from drives simulated by another component, such as `can.drive_sim`, and are
    /// applied unchecked; the actuator of those drives checks them. Default false.
    pub plant: bool,
}

/// The surface of a link. Missing values are the same as of the other links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceConfig {
    /// Coefficient of friction, from 0; 0 is frictionless on everything without a `friction_combine`.
    #[schemars(range(min = 0.0))]
    pub friction: Option<f64>,
    /// Rule by which frictions combine. Default: the mean of both surfaces' for a friction above 0.
    pub friction_combine: Option<FrictionCombine>,
    /// Share of the approach speed kept after an impact, 0 to 1. A contact has the mean of both surfaces'.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: Option<f64>,
    /// Softness: contact points yield like a spring and a damper. Default: the surface is rigid.
    pub soft: Option<Softness>,
    /// Friction along a direction of the link that differs from that across it.
    pub grain: Option<Grain>,
}

/// A spring in a joint.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpringConfig {
    /// Stiffness (N m/rad or N/m), from 0.
    #[schemars(range(min = 0.0))]
    pub stiffness: f64,
    /// Position of the joint at which the spring is relaxed (rad or m). Default 0.
    #[serde(default)]
    pub rest: f64,
}

/// Start of one of several robots.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotStart {
    /// Named pose to start in.
    pub pose: Option<String>,
    /// Joint positions to start at, rad or m: one number for all joints, or one for each. Instead of `pose`.
    pub position: Option<PerJoint>,
}

/// Start pose of a floating base.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaseStart {
    /// Position of the base frame in the world (m).
    pub position: [f64; 3],
    /// Its roll, pitch, yaw about the fixed axes x, y, z, in this order (rad).
    #[serde(default)]
    pub rpy: [f64; 3],
}

impl PhysicsConfig {
    /// Fixed or floating base.
    pub(super) fn base_mode(&self) -> BaseMode {
        match self.floating {
            None => BaseMode::AsFile,
            Some(true) => BaseMode::Floating,
            Some(false) => BaseMode::Fixed,
        }
    }

    /// Start pose of a floating base, if the configuration, the profile or the SRDF defines one. With
    /// `placed` the graph defines the robot's pose, and the model starts there.
    pub(super) fn base_start(
        &self,
        robot: &Loaded,
        placed: bool,
    ) -> Result<Option<Isometry3<f64>>, ConfigError> {
        if placed && self.base.is_some() {
            return Err(ConfigError::key("base", "the graph says where the robot stands already")
                .advise("keep `base` of the robot, and leave this one out"));
        }
        if let Some(BaseStart { position: [x, y, z], rpy: [roll, pitch, yaw] }) = self.base {
            if !robot.model.base().floating {
                return Err(ConfigError::key("base", "a start pose for a base that is fixed to the world")
                    .advise("leave it out, or set `floating = true`"));
            }
            if ![x, y, z, roll, pitch, yaw].iter().all(|number| number.is_finite()) {
                return Err(ConfigError::key("base", "expected finite numbers"));
            }
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            return Ok(Some(Isometry3::from_parts(Translation3::new(x, y, z), rotation)));
        }
        if placed {
            return Ok(Some(robot.model.base().neutral));
        }
        let profile = robot.profile.as_ref();
        let pose = |profile: &&motorium_robots::Profile| match (&self.pose, &self.position) {
            (Some(pose), _) => Some(pose.clone()),
            (None, None) => Some(profile.home.clone()),
            (None, Some(_)) => None,
        };
        let named = profile.and_then(|profile| profile.base_poses.get(&pose(&profile)?));
        let of_srdf = || match (profile, &self.pose) {
            (None, Some(pose)) => posture(robot, pose)?.base,
            _ => None,
        };
        Ok(named.map(BasePose::isometry).or_else(of_srdf))
    }

    /// Sets the surfaces of single links of these robots.
    pub(super) fn set_surfaces(&self, setups: &mut [RobotSetup]) -> Result<(), ConfigError> {
        for (link, surface) in &self.surfaces {
            let SurfaceConfig { friction, friction_combine, restitution, soft, grain } = surface;
            let key = |name: &str| format!("surfaces.{link}{name}");
            // A link that no robot has is refused with the first.
            let owner = setups.iter().position(|setup| setup.model.frame(link).is_ok()).unwrap_or(0);
            let setup = &mut setups[owner];
            if let Err(error) = setup.model.frame(link) {
                return Err(ConfigError::key(key(""), error.to_string()));
            }
            if let Some(friction) = *friction {
                if !(friction >= 0.0 && friction.is_finite()) {
                    let message = format!("{friction}, expected a number from 0 up");
                    return Err(ConfigError::key(key(".friction"), message));
                }
                setup.friction.insert(link.clone(), friction);
            }
            setup.friction_combine.extend(friction_combine.map(|rule| (link.clone(), rule)));
            if let Some(restitution) = *restitution {
                if !(0.0..=1.0).contains(&restitution) {
                    let message = format!("{restitution}, expected a number from 0 to 1");
                    return Err(ConfigError::key(key(".restitution"), message));
                }
                setup.restitution.insert(link.clone(), restitution);
            }
            if let Some(soft) = soft {
                soft.check(link).map_err(|error| ConfigError::key(key(".soft"), error.to_string()))?;
                setup.soft.insert(link.clone(), *soft);
            }
            if let Some(grain) = grain {
                grain.check(link).map_err(|error| ConfigError::key(key(".grain"), error.to_string()))?;
                setup.grain.insert(link.clone(), *grain);
            }
        }
        Ok(())
    }

    /// Puts springs into joints of these robots.
    pub(super) fn set_springs(&self, setups: &mut [RobotSetup]) -> Result<(), ConfigError> {
        for (joint, SpringConfig { stiffness, rest }) in &self.springs {
            // A joint that no robot has is refused with the first.
            let has = |setup: &RobotSetup| setup.model.bodies().iter().any(|body| body.joint.name == *joint);
            let owner = setups.iter().position(has).unwrap_or(0);
            let setup = &mut setups[owner];
            setup.model = setup
                .model
                .with_springs(&[(joint, *stiffness, *rest)])
                .map_err(|error| ConfigError::key(format!("springs.{joint}"), error.to_string()))?;
        }
        Ok(())
    }

    /// Makes the configured connections at the present poses.
    pub(super) fn connect(&self, simulation: &mut impl Simulator) -> Result<(), ConfigError> {
        for (index, connection) in self.connections.iter().enumerate() {
            let refused = |error: crate::ConnectError| {
                ConfigError::key(format!("connections.{index}"), error.to_string())
            };
            simulation.connect(connection).map_err(refused)?;
        }
        Ok(())
    }

    /// Start positions of the joints, within their limits.
    pub(super) fn start(&self, robot: &Loaded) -> Result<Vec<f64>, ConfigError> {
        let start = self.chosen_start(robot)?;
        let key = if self.position.is_some() { "position" } else { "pose" };
        let model = &robot.model;
        let limits = model.lower().iter().zip(model.upper().iter());
        let joints = model.joint_names().iter().zip(&start).zip(limits);
        for (index, ((name, position), (lower, upper))) in joints.enumerate() {
            // Written numbers are rounded.
            if *position < lower - LIMIT_ROUNDING || *position > upper + LIMIT_ROUNDING {
                let message =
                    format!("joint `{name}` starts at {position}, outside its limits {lower} to {upper}");
                let nearest = format!("start it at {}", position.clamp(*lower, *upper));
                let advice = model.degrees_advice(index, *position).unwrap_or(nearest);
                return Err(ConfigError::key(key, message).advise(advice));
            }
        }
        Ok(start)
    }

    fn chosen_start(&self, robot: &Loaded) -> Result<Vec<f64>, ConfigError> {
        let model = &robot.model;
        let named = |error: motorium_robots::ProfileError| ConfigError::key("pose", error.to_string());
        match (&self.pose, &self.position, &robot.profile) {
            (Some(_), Some(_), _) => {
                Err(ConfigError::new("both `pose` and `position` say where the robot starts")
                    .advise("keep one of them"))
            }
            (None, Some(position), _) => position.resolve(model.joint_count()).map_err(|error| {
                let names = model.joint_names().join(", ");
                ConfigError::key("position", error.to_string()).advise(format!("in this order: {names}"))
            }),
            (Some(pose), None, None) => match posture(robot, pose) {
                Some(posture) => Ok(posture.joints.as_slice().to_vec()),
                None => {
                    let message = format!("pose \"{pose}\" of a robot without a profile");
                    Err(ConfigError::key("pose", message).advise(advice(robot)))
                }
            },
            (Some(pose), None, Some(profile)) => {
                Ok(profile.pose(model, pose).map_err(named)?.as_slice().to_vec())
            }
            (None, None, Some(profile)) => Ok(profile.home(model).map_err(named)?.as_slice().to_vec()),
            (None, None, None) => Ok(model
                .lower()
                .iter()
                .zip(model.upper().iter())
                .map(|(low, high)| rest_position(*low, *high))
                .collect()),
        }
    }
}

/// Distance beyond a limit of a joint that is rounding of a written number, rad or m.
const LIMIT_ROUNDING: f64 = 1e-6;

/// The key pose of the robot's SRDF.
fn posture<'a>(robot: &'a Loaded, name: &str) -> Option<&'a Posture> {
    robot.postures.iter().find(|posture| posture.name == name)
}

/// Advice for a pose that does not exist.
fn advice(robot: &Loaded) -> String {
    let names: Vec<_> = robot.postures.iter().map(|posture| posture.name.as_str()).collect();
    if names.is_empty() {
        "write its `position` instead, or a profile (.toml) beside its URDF".to_owned()
    } else {
        format!("its SRDF has {}", names.join(", "))
    }
}

/// The whole configuration: the base at `base`, the joints at `joints`.
pub(super) fn configuration(model: &Model, base: &Isometry3<f64>, joints: &[f64]) -> Vec<f64> {
    let mut q = model.neutral();
    let offset = model.nq() - joints.len();
    q[offset..].copy_from_slice(joints);
    if model.base().floating {
        q[..3].copy_from_slice(base.translation.vector.as_slice());
        q[3..7].copy_from_slice(base.rotation.coords.as_slice());
    }
    q
}

/// Zero, or where the range excludes it, its middle (its end, if it is open).
fn rest_position(low: f64, high: f64) -> f64 {
    let middle = 0.5 * (low + high);
    if low > 0.0 || high < 0.0 {
        if middle.is_finite() { middle } else { 0.0_f64.max(low).min(high) }
    } else {
        0.0
    }
}

/// The configuration error of a build error, at the key at fault.
pub(super) fn refused(error: BuildError) -> ConfigError {
    let message = error.to_string();
    match error {
        BuildError::IdealDrives => ConfigError::key("actuator", message),
        BuildError::Actuator { ref joint, ref error } => {
            ConfigError::key(format!("actuators.{joint}.{}", error.setting), message)
        }
        BuildError::Unable { ref owner, surface: Some(surface), .. } => {
            ConfigError::key(format!("surfaces.{owner}.{surface}"), message)
        }
        BuildError::World(_)
        | BuildError::Terrain
        | BuildError::Connection(_)
        | BuildError::Unable { .. } => ConfigError::key("world", message),
        BuildError::Option { name, .. } => ConfigError::key(format!("solver.{name}"), message),
        BuildError::Integrator { .. } => ConfigError::key("solver.integrator", message),
        BuildError::State(_) => ConfigError::key("position", message),
        BuildError::NoRobot | BuildError::Name { .. } | BuildError::SeveralArticulations => {
            ConfigError::key("robots", message)
        }
        BuildError::Library(_) | BuildError::Refused { .. } => ConfigError::new(message),
        BuildError::FloatingBase { robot } => {
            let message =
                format!("robot `{robot}` has a floating base, which `physics.rapier` cannot simulate");
            ConfigError::new(message).advise("use `kind = \"physics.articulated\"`")
        }
    }
}
