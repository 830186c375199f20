//! The `config` table of the physics kinds.

use std::collections::BTreeMap;

use motorium::declare::ConfigError;
use motorium::units::TimeSpan;
use motorium_robots::{BaseMode, BasePose, Loaded, Model, PerJoint, Posture};
use motorium_worlds::{FrictionCombine, Grain, Softness};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use schemars::JsonSchema;
use serde::Deserialize;

use super::actuators::ActuatorConfig;
use super::pushes::PushConfig;
use crate::randomise::RandomiseConfig;
use crate::{BuildError, Connection, Options, RobotSetup, Simulator, World};

/// Configuration of the physics kinds: initial state of the robots, the world, and settings of the engine.
///
/// ```toml
/// solver = { contact_iterations = 4 }
/// world  = { ground = { friction = 0.8 } }
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsConfig {
    /// Name of the initial pose, which is defined in the robot's profile or in its SRDF. Default without
    /// `position`: the home pose. In a robot without a profile, each joint starts at zero, or at the middle
    /// of its range if the range excludes zero.
    pub pose: Option<String>,
    /// Initial joint positions, rad or m: one number for all joints, or one number per joint in the order of
    /// the joints. Excludes `pose`.
    pub position: Option<PerJoint>,
    /// `true` if the root link moves freely, `false` if it is fixed to the world. Default: according to the
    /// robot's profile and file. `physics.rapier` supports fixed bases only.
    pub floating: Option<bool>,
    /// Initial pose of a floating base. Default: the base pose that the profile stores with the robot's
    /// initial pose; if the profile stores none, the robot stands upright on the ground.
    pub base: Option<BaseStart>,
    /// Initial states of several robots, by robot name. Default: `pose`, or the home pose of each robot.
    pub start: BTreeMap<String, RobotStart>,
    /// Gravity, ground and objects of the world, for a graph without a `[world]`.
    pub world: World,
    /// External forces and torques at specified times.
    pub pushes: Vec<PushConfig>,
    /// Actuator model of all joints, only in `physics.articulated`. Default: ideal actuators.
    pub actuator: Option<ActuatorConfig>,
    /// Actuator models of single joints by joint name, which replace `actuator`. With several robots, the
    /// name of a joint is `ROBOT/JOINT`.
    pub actuators: BTreeMap<String, ActuatorConfig>,
    /// Connections between links and objects in addition to the joints of the robots. Connections can close
    /// kinematic loops. They hold the relative poses that the parts have at the start. With several robots,
    /// the name of a link is `ROBOT/LINK`.
    pub connections: Vec<Connection>,
    /// Springs in joints by joint name, which replace the springs of an MJCF file. With several robots, the
    /// name of a joint is `ROBOT/JOINT`.
    pub springs: BTreeMap<String, SpringConfig>,
    /// Surfaces of single links by link name, which replace the surfaces that `solver` and the profile
    /// define. With several robots, the name of a link is `ROBOT/LINK`.
    pub surfaces: BTreeMap<String, SurfaceConfig>,
    /// Ranges of physical properties, sampled at the start of every episode. Default: nothing is sampled.
    pub randomise: RandomiseConfig,
    /// Settings of the engine.
    pub solver: Options,
    /// `true` if the commands come from drives that another component simulates, such as `can.drive_sim`.
    /// Physics applies these commands unchecked, because the actuator of the other component checks them.
    /// Default false.
    pub plant: bool,
    /// Age beyond which a state of `follow` or `follow_base` is stale. The robot then holds its last pose
    /// with zero velocity. Default 20 ms.
    pub follow_stale_after: Option<TimeSpan>,
}

/// Contact surface of a link. Missing keys keep the values of the robot's other links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceConfig {
    /// Coefficient of friction, from 0. A surface with friction 0 is frictionless against every surface
    /// without a `friction_combine`.
    #[schemars(range(min = 0.0))]
    pub friction: Option<f64>,
    /// Rule by which the friction coefficients of two surfaces combine. Default: the mean if the friction is
    /// above 0, otherwise the product.
    pub friction_combine: Option<FrictionCombine>,
    /// Fraction of the approach speed kept after an impact, 0 to 1. A contact uses the mean value of both
    /// surfaces.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: Option<f64>,
    /// Softness: contact points yield like a spring and a damper. Default: the surface is rigid.
    pub soft: Option<Softness>,
    /// Direction-dependent friction of the link. Default: the same in all directions.
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

/// Initial state of one of several robots.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotStart {
    /// Named initial pose.
    pub pose: Option<String>,
    /// Initial joint positions, rad or m: one number for all joints, or one per joint. Excludes `pose`.
    pub position: Option<PerJoint>,
}

/// Initial pose of a floating base.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaseStart {
    /// Position of the base frame in the world (m).
    pub position: [f64; 3],
    /// Roll, pitch and yaw of the base frame about the fixed axes x, y, z, in this order (rad).
    #[serde(default)]
    pub rpy: [f64; 3],
}

impl PhysicsConfig {
    /// Returns whether the base is fixed or floating.
    pub(super) fn base_mode(&self) -> BaseMode {
        match self.floating {
            None => BaseMode::AsFile,
            Some(true) => BaseMode::Floating,
            Some(false) => BaseMode::Fixed,
        }
    }

    /// Returns the start pose of a floating base if the configuration, the profile or the SRDF specifies one.
    /// `placed` is true if the graph specifies the pose of the robot: the model then starts there.
    pub(super) fn base_start(
        &self,
        robot: &Loaded,
        placed: bool,
    ) -> Result<Option<Isometry3<f64>>, ConfigError> {
        if placed && self.base.is_some() {
            return Err(ConfigError::key("base", "the graph already specifies the robot's pose")
                .advise("remove this `base`, or the `base` of the robot"));
        }
        if let Some(BaseStart { position: [x, y, z], rpy: [roll, pitch, yaw] }) = self.base {
            if !robot.model.base().floating {
                return Err(ConfigError::key(
                    "base",
                    "an initial pose is set, but the base is fixed to the world",
                )
                .advise("remove it, or set `floating = true`"));
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

    /// Assigns surfaces to single links of these robots.
    pub(super) fn set_surfaces(&self, setups: &mut [RobotSetup]) -> Result<(), ConfigError> {
        for (link, surface) in &self.surfaces {
            let SurfaceConfig { friction, friction_combine, restitution, soft, grain } = surface;
            let key = |name: &str| format!("surfaces.{link}{name}");
            // An unknown link is passed to the first robot, which rejects it.
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

    /// Adds springs to joints of these robots.
    pub(super) fn set_springs(&self, setups: &mut [RobotSetup]) -> Result<(), ConfigError> {
        for (joint, SpringConfig { stiffness, rest }) in &self.springs {
            // An unknown joint is passed to the first robot, which rejects it.
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

    /// Makes the configured connections in the current poses.
    pub(super) fn connect(&self, simulation: &mut impl Simulator) -> Result<(), ConfigError> {
        for (index, connection) in self.connections.iter().enumerate() {
            let refused = |error: crate::ConnectError| {
                ConfigError::key(format!("connections.{index}"), error.to_string())
            };
            simulation.connect(connection).map_err(refused)?;
        }
        Ok(())
    }

    /// Returns the start positions of the joints, within their limits.
    pub(super) fn start(&self, robot: &Loaded) -> Result<Vec<f64>, ConfigError> {
        let start = self.chosen_start(robot)?;
        let key = if self.position.is_some() { "position" } else { "pose" };
        let model = &robot.model;
        let limits = model.lower().iter().zip(model.upper().iter());
        let joints = model.joint_names().iter().zip(&start).zip(limits);
        for (index, ((name, position), (lower, upper))) in joints.enumerate() {
            // Numbers in files are rounded.
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
                Err(ConfigError::new("both `pose` and `position` specify the robot's start")
                    .advise("keep one of them"))
            }
            (None, Some(position), _) => position.resolve(model.joint_count()).map_err(|error| {
                let names = model.joint_names().join(", ");
                ConfigError::key("position", error.to_string())
                    .advise(format!("list the joints in this order: {names}"))
            }),
            (Some(pose), None, None) => match posture(robot, pose) {
                Some(posture) => Ok(posture.joints.as_slice().to_vec()),
                None => {
                    let message = format!("pose \"{pose}\" is unknown, and the robot has no profile");
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

/// Tolerance for start positions beyond a joint limit, which covers the rounding of written numbers, rad or
/// m.
const LIMIT_ROUNDING: f64 = 1e-6;

/// Returns the named pose of the robot's SRDF.
fn posture<'a>(robot: &'a Loaded, name: &str) -> Option<&'a Posture> {
    robot.postures.iter().find(|posture| posture.name == name)
}

/// Returns advice for an unknown pose.
fn advice(robot: &Loaded) -> String {
    let names: Vec<_> = robot.postures.iter().map(|posture| posture.name.as_str()).collect();
    if names.is_empty() {
        "set `position` instead, or add a profile (.toml) next to the URDF".to_owned()
    } else {
        format!("its SRDF has {}", names.join(", "))
    }
}

/// Returns the whole configuration: the base at `base`, the joints at `joints`.
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

/// Returns zero, or, if the range excludes zero, its middle (or its finite end).
fn rest_position(low: f64, high: f64) -> f64 {
    let middle = 0.5 * (low + high);
    if low > 0.0 || high < 0.0 {
        if middle.is_finite() { middle } else { 0.0_f64.max(low).min(high) }
    } else {
        0.0
    }
}

/// Converts a build error into a configuration error at the offending key.
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
