//! From a configuration and a robot to tasks, limits and gains, with every mistake named by its key.

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MAX_JOINTS;
use motorium_robots::{Gains, Loaded, Model, Profile, load};
use nalgebra::{DVector, Vector3};

use super::config::{CartesianConfig, LimitsConfig, PerJoint, PostureConfig, QpControllerConfig, TaskConfig};
use crate::{
    CommandComposer, ComposeError,
    limits::{PositionLimit, VelocityLimit},
    tasks::{CartesianSettings, CartesianTask, PostureSettings, PostureTask},
};

/// Everything a controller is made of that does not touch a topic.
pub(super) struct Assembly {
    pub(super) model: Model,
    pub(super) cartesian: Vec<Cartesian>,
    pub(super) postures: Vec<Posture>,
    pub(super) position: PositionLimit,
    pub(super) velocity: VelocityLimit,
    pub(super) composer: CommandComposer,
}

/// A Cartesian task, its name and the port of its target.
pub(super) struct Cartesian {
    pub(super) name: String,
    pub(super) port: String,
    pub(super) task: CartesianTask,
}

/// A posture task and its name.
pub(super) struct Posture {
    pub(super) name: String,
    pub(super) task: PostureTask,
    /// Whether the posture is still to be found from the first joint state.
    pub(super) as_found: bool,
}

/// Time constant of the acceleration that is fed forward, s.
const ACCELERATION_SMOOTHING: f64 = 0.004;

/// Values a gain may have, 1/s.
pub(super) const GAINS: core::ops::RangeInclusive<f64> = 0.0..=1000.0;
/// Values a weight may have.
pub(super) const WEIGHTS: core::ops::RangeInclusive<f64> = 0.0..=1000.0;

impl Assembly {
    /// `period` is the time between two ticks, s.
    pub(super) fn new(
        config: &QpControllerConfig,
        robot: &RobotReference,
        period: f64,
    ) -> Result<Self, ConfigError> {
        let Loaded { model, profile, .. } =
            load(&robot.urdf, &robot.base).map_err(|error| ConfigError::key("robot", error.to_string()))?;
        let profile = profile.as_ref();
        if model.base().floating {
            let message = format!(
                "robot `{}` has a floating base, and this controller moves robots whose base is fixed",
                robot.name
            );
            let advice =
                "drive its joints with a policy such as policy.cpg, or fix the base in its URDF or profile";
            return Err(ConfigError::key("robot", message).advise(advice));
        }
        if model.nv() > MAX_JOINTS {
            let joints = model.nv();
            return Err(ConfigError::key("robot", format!("{joints} joints, at most {MAX_JOINTS} fit")));
        }
        let default_tasks = [
            TaskConfig::Cartesian(CartesianConfig::default()),
            TaskConfig::Posture(PostureConfig::default()),
        ];
        let tasks = if config.tasks.is_empty() { &default_tasks[..] } else { &config.tasks };
        let (mut cartesian, mut postures) = (Vec::<Cartesian>::new(), Vec::<Posture>::new());
        for (index, task) in tasks.iter().enumerate() {
            match task {
                TaskConfig::Cartesian(task) => {
                    let key = |name: &str| format!("tasks[{index}].cartesian.{name}");
                    if cartesian.iter().any(|other| other.port == task.target) {
                        let message = format!("two tasks take their target from `{}`", task.target);
                        return Err(ConfigError::key(key("target"), message)
                            .advise("give each its own input, such as `target = \"left_target\"`"));
                    }
                    if task.target == "joint_state" || !is_name(&task.target) {
                        let message = format!("`{}` cannot be the name of an input", task.target);
                        return Err(ConfigError::key(key("target"), message)
                            .advise("use lower-case letters, digits and underscores, such as `target`"));
                    }
                    cartesian.push(Cartesian::new(task, &model, profile, period, key)?);
                }
                TaskConfig::Posture(task) => {
                    let key = |name: &str| format!("tasks[{index}].posture.{name}");
                    postures.push(Posture::new(task, &model, profile, key)?);
                }
            }
        }
        let names = || cartesian.iter().map(|task| &task.name).chain(postures.iter().map(|task| &task.name));
        for (index, name) in names().enumerate() {
            if !is_name(name) || names().take(index).any(|other| other == name) {
                let message = format!("task name `{name}` is used twice or is no name");
                return Err(ConfigError::key("tasks", message)
                    .advise("give each task its own `name`: lower-case letters, digits and underscores"));
            }
        }
        finite("max_lead", config.max_lead, 1e-6..=f64::MAX)?;
        finite("damping", config.damping, 1e-12..=1.0)?;
        let (position, velocity) = limits(&config.limits)?;
        let composer = composer(config, &model, profile)?;
        Ok(Self { cartesian, postures, position, velocity, composer, model })
    }
}

impl Cartesian {
    fn new(
        config: &CartesianConfig,
        model: &Model,
        profile: Option<&Profile>,
        period: f64,
        key: impl Fn(&str) -> String,
    ) -> Result<Self, ConfigError> {
        let frame = match &config.frame {
            Some(name) => name.as_str(),
            None => only_end_effector(profile).map_err(|found| {
                let message = format!("robot `{}` has {found}, and no `frame` is given", model.name());
                let example = model.frames().last().map_or("", |frame| frame.name.as_str());
                ConfigError::new(message).advise(format!(
                    "name the link that is led: tasks = [{{ cartesian = {{ frame = \"{example}\" }} }}, {{ posture = {{}} }}]"
                ))
            })?,
        };
        let frame = model.frame(frame).map_err(|error| ConfigError::key(key("frame"), error.to_string()))?;
        let speed = |name, speed: Option<f64>| match speed {
            None => Ok(f64::INFINITY),
            Some(speed) => finite(&key(name), speed, 1e-6..=f64::MAX),
        };
        let settings = CartesianSettings {
            gain: finite(&key("gain"), config.gain, GAINS)?,
            position_weight: finite(&key("position_weight"), config.position_weight, WEIGHTS)?,
            orientation_weight: finite(&key("orientation_weight"), config.orientation_weight, WEIGHTS)?,
            max_linear_speed: speed("max_linear_speed", config.max_linear_speed)?,
            max_angular_speed: speed("max_angular_speed", config.max_angular_speed)?,
            damping: match config.damping {
                None => CartesianSettings::default().damping.max(2.0 * period),
                Some(damping) => finite(&key("damping"), damping, 0.0..=f64::MAX)?,
            },
        };
        let task = CartesianTask::new(model, frame).with(settings);
        Ok(Self { name: config.name.clone(), port: config.target.clone(), task })
    }
}

impl Posture {
    fn new(
        config: &PostureConfig,
        model: &Model,
        profile: Option<&Profile>,
        key: impl Fn(&str) -> String,
    ) -> Result<Self, ConfigError> {
        let refused = |error: motorium_robots::ProfileError| ConfigError::key(key("pose"), error.to_string());
        let (target, as_found) = match (&config.pose, &config.positions, profile) {
            (Some(_), Some(_), _) => {
                let message = "both `pose` and `positions` are given";
                return Err(ConfigError::key(key("positions"), message).advise("keep one of them"));
            }
            (Some(_), None, None) => {
                let message = format!("robot `{}` has no profile, so its poses have no names", model.name());
                return Err(ConfigError::key(key("pose"), message)
                    .advise("give `positions`, or put a profile beside the URDF"));
            }
            (Some(name), None, Some(profile)) => (profile.pose(model, name).map_err(refused)?, false),
            (None, Some(positions), _) => (per_joint(&key("positions"), positions, model)?, false),
            (None, None, Some(profile)) => (profile.home(model).map_err(refused)?, false),
            (None, None, None) => (DVector::zeros(model.nv()), true),
        };
        let settings = PostureSettings {
            gain: finite(&key("gain"), config.gain, GAINS)?,
            weight: finite(&key("weight"), config.weight, WEIGHTS)?,
        };
        let task = PostureTask::new(model, target.as_slice()).with(settings);
        Ok(Self { name: config.name.clone(), task, as_found })
    }
}

fn limits(config: &LimitsConfig) -> Result<(PositionLimit, VelocityLimit), ConfigError> {
    let position = PositionLimit {
        rate: finite("limits.position.rate", config.position.rate, 1e-3..=f64::MAX)?,
        margin: finite("limits.position.margin", config.position.margin, 0.0..=f64::MAX)?,
    };
    let fraction = finite("limits.velocity.fraction", config.velocity.fraction, 1e-6..=1.0)?;
    Ok((position, VelocityLimit { fraction }))
}

fn composer(
    config: &QpControllerConfig,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<CommandComposer, ConfigError> {
    let of_profile = profile.map(|profile| profile.gains(model));
    let gain = |name: &str, given: &Option<PerJoint>, pick: fn(&Gains) -> &DVector<f64>| match (
        given,
        &of_profile,
    ) {
        (Some(PerJoint::All(gain)), _) => Ok(DVector::repeat(model.nv(), *gain)),
        (Some(PerJoint::Each(gains)), _) => per_joint(name, gains, model),
        (None, Some(Ok(gains))) => Ok(pick(gains).clone()),
        (None, Some(Err(error))) => Err(ConfigError::new(format!("no `{name}` is given, and {error}"))),
        (None, None) => {
            let message = format!("no `{name}` is given, and robot `{}` has no profile", model.name());
            Err(ConfigError::new(message).advise(format!("add `{name}`: one number, or one per joint")))
        }
    };
    let kp = gain("kp", &config.kp, |gains| &gains.kp)?;
    let kd = gain("kd", &config.kd, |gains| &gains.kd)?;
    for component in config.gravity {
        finite("gravity", component, -1000.0..=1000.0)?;
    }
    let gravity = config.gravity_compensation.then(|| Vector3::from(config.gravity));
    let composer = CommandComposer::new(model, &Gains { kp, kd }, gravity).map_err(|error| match error {
        ComposeError::Length { what, .. } | ComposeError::Gain { what, .. } => {
            ConfigError::key(what, error.to_string())
        }
    })?;
    Ok(if config.inertia_compensation { composer.with_inertia(ACCELERATION_SMOOTHING) } else { composer })
}

fn only_end_effector(profile: Option<&Profile>) -> Result<&str, &'static str> {
    let mut all = profile.into_iter().flat_map(|profile| profile.end_effectors.values());
    match (all.next(), all.next()) {
        (Some(one), None) => Ok(&one.frame),
        (Some(_), Some(_)) => Err("several end effectors"),
        (None, _) => Err("no known end effector"),
    }
}

fn per_joint(key: &str, values: &[f64], model: &Model) -> Result<DVector<f64>, ConfigError> {
    if values.len() != model.nv() {
        let message = format!("{} numbers, expected {}: one per joint", values.len(), model.nv());
        return Err(ConfigError::key(key, message)
            .advise(format!("in this order: {}", model.joint_names().join(", "))));
    }
    for value in values {
        finite(key, *value, f64::MIN..=f64::MAX)?;
    }
    Ok(DVector::from_column_slice(values))
}

/// The value, if it is within the range.
fn finite(key: &str, value: f64, range: core::ops::RangeInclusive<f64>) -> Result<f64, ConfigError> {
    if range.contains(&value) {
        return Ok(value);
    }
    let expected = match (*range.start(), *range.end()) {
        (f64::MIN, f64::MAX) => "a finite number".to_owned(),
        (low, f64::MAX) => format!("at least {low}"),
        (low, high) => format!("from {low} to {high}"),
    };
    Err(ConfigError::key(key, format!("{value}, expected {expected}")))
}

fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}
