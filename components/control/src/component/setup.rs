//! The checked parts of a controller that need no topics. Every error names its key.

use std::path::Path;

use motorium::prelude::*;
use motorium_robots::{Gains, Loaded, Model, PerJoint, Profile};
use motorium_worlds::World;
use nalgebra::{DVector, Vector3};

use super::config::{LevelConfig, QpControllerConfig};
use super::measured::load_robot;
use crate::checks::{in_range, is_name, per_joint};
use crate::inverse_dynamics::{Contact, Unknowns};
use crate::limits::{AccelerationLimit, HeldSupport, RowLimit};
use crate::tasks::{
    ActsOn, CartesianConfig, Configured, Formulations, PostureConfig, TaskConfig, TaskContext, TaskHead,
    TaskKind,
};
use crate::{FeedForward, check_gains};

/// Time constant of the feed-forward acceleration, s.
const ACCELERATION_SMOOTHING: f64 = 0.004;

/// Number of levels available to tasks.
const LEVELS: u32 = 8;

/// Range of every regularisation.
const DAMPING: core::ops::RangeInclusive<f64> = 1e-12..=1.0;

/// Names of inputs.
pub(super) const OBJECTS_INPUT: &str = "object_poses";
pub(super) const FINGERS_INPUT: &str = "fingers";

/// A robot, its tasks, and the gains and effort limits of its drives.
pub(super) struct ControllerSetup {
    pub(super) model: Model,
    pub(super) profile: Option<Profile>,
    torque: bool,
    unknowns: Unknowns,
    gravity: Vector3<f64>,
    /// The world, including the objects of its file.
    pub(super) world: World,
    contacts: Vec<Contact>,
    tasks: Vec<TaskConfig>,
    pub(super) gains: Gains,
    pub(super) feed_forward: FeedForward,
    /// Joints of the wheels that move a floating base, which another component commands; empty with
    /// `inverse_dynamics`.
    pub(super) wheels: Vec<usize>,
}

impl ControllerSetup {
    /// Loads the robot and checks everything except the tasks' tables. File paths of the world are relative
    /// to `folder`.
    pub(super) fn new(
        config: &QpControllerConfig,
        robot: &RobotReference,
        folder: &Path,
    ) -> Result<Self, ConfigError> {
        let Loaded { model, profile, .. } = load_robot(robot)?;
        let wheels = match config.inverse_dynamics {
            None if model.base().floating => base_joints(robot, &model, profile.as_ref())?,
            _ => Vec::new(),
        };
        check_numbers(config)?;
        if let Some(table) = &config.inverse_dynamics {
            refuse_velocity_keys(config)?;
            table.refuse_unused_limits(&config.limits)?;
        }
        let gains = gains(config, &model, profile.as_ref())?;
        let gravity = config.gravity_compensation.then(|| Vector3::from(config.gravity));
        let feed_forward = FeedForward::new(&model, gravity);
        let feed_forward = match config.inertia_compensation {
            true => feed_forward.with_inertia(ACCELERATION_SMOOTHING),
            false => feed_forward,
        };
        let tasks = config.tasks.clone().unwrap_or_else(default_tasks);
        if tasks.is_empty() {
            return Err(ConfigError::key(
                "tasks",
                "an empty list: a controller without a task moves nothing",
            )
            .advise("add a task, such as `{ posture = {} }`, or leave `tasks` out for the default tasks"));
        }
        let torque = config.inverse_dynamics.is_some();
        let unknowns = config.inverse_dynamics.as_ref().map_or(Unknowns::default(), |table| table.unknowns);
        let contacts = match &config.inverse_dynamics {
            Some(dynamics) => dynamics.contacts(&model, profile.as_ref())?,
            None => Vec::new(),
        };
        let (gravity, mut world) = (config.gravity.into(), config.world.clone());
        // defects of its files are reported by the simulation of the world
        world.locate(folder).map_err(|error| ConfigError::key("world", error.to_string()))?;
        let setup = Self {
            model,
            profile,
            torque,
            unknowns,
            gravity,
            world,
            contacts,
            tasks,
            gains,
            feed_forward,
            wheels,
        };
        if unknowns == Unknowns::Forces && setup.contacts.is_empty() {
            let message = "`forces` for a robot without a contact";
            return Err(ConfigError::key("inverse_dynamics.unknowns", message)
                .advise("add `contacts`, or choose unknowns = \"accelerations\""));
        }
        setup.check_tasks()?;
        setup.level_damping(config)?;
        Ok(setup)
    }

    /// Returns `true` if the parameter `velocity_fraction` has an effect; forces alone move no joint.
    pub(super) fn limits_velocities(&self) -> bool {
        self.unknowns != Unknowns::Forces
    }

    /// Tasks with their build context, for a controller with a period of `period` seconds.
    pub(super) fn tasks(&self, period: f64) -> impl Iterator<Item = (TaskContext<'_>, &dyn TaskKind)> {
        self.configured().map(move |Configured { path, kind, is_constraint }| {
            let context = TaskContext {
                model: &self.model,
                profile: self.profile.as_ref(),
                period,
                torque: self.torque,
                gravity: self.gravity,
                world: &self.world,
                contacts: &self.contacts,
                wheels: &self.wheels,
                is_constraint,
                path,
            };
            (context, kind)
        })
    }

    /// The tables of the tasks, which were [checked](Self::check_tasks).
    fn configured(&self) -> impl Iterator<Item = Configured<'_>> {
        self.tasks.iter().enumerate().filter_map(|(index, task)| task.configured(index).ok())
    }

    /// Levels of the tasks, without duplicates, highest first. If all tasks are constraints there is one
    /// level, whose regularisation selects the smallest solution.
    pub(super) fn levels(&self) -> impl Iterator<Item = u32> {
        let bare = self.configured().all(|task| task.is_constraint);
        let is_used =
            |level: u32| self.configured().any(|task| !task.is_constraint && task.kind.head().level == level);
        (1..=LEVELS).filter(move |level| (bare && *level == 1) || is_used(*level))
    }

    /// Regularisation of each level, highest first.
    pub(super) fn level_damping(&self, config: &QpControllerConfig) -> Result<Vec<f64>, ConfigError> {
        let mut found: Vec<(u32, f64)> = self.levels().map(|level| (level, config.damping)).collect();
        for (index, LevelConfig { level, damping }) in config.levels.iter().enumerate() {
            let key = |name: &str| format!("levels[{index}].{name}");
            let used: Vec<_> = found.iter().map(|(level, _)| level.to_string()).collect();
            let Some((_, of_level)) = found.iter_mut().find(|(other, _)| other == level) else {
                let message = format!("no task is on level {level}");
                return Err(ConfigError::key(key("level"), message)
                    .advise(format!("the tasks have level {}", used.join(", "))));
            };
            if config.levels[..index].iter().any(|other| other.level == *level) {
                let message = format!("level {level} is listed twice");
                return Err(ConfigError::key(key("level"), message).advise("keep one of the two"));
            }
            *of_level = in_range(&key("damping"), *damping, DAMPING)?;
        }
        Ok(found.into_iter().map(|(_, damping)| damping).collect())
    }

    /// Total number of task parameters.
    pub(super) fn parameter_count(&self) -> usize {
        self.configured().map(|task| task.kind.parameters().len()).sum()
    }

    /// The limits of combinations of velocities.
    pub(super) fn row_limits(&self, config: &QpControllerConfig) -> Result<RowLimits, ConfigError> {
        let (model, profile) = (&self.model, self.profile.as_ref());
        let (mut rows, mut names) = (Vec::new(), Vec::new());
        for (index, frame) in config.limits.frames.iter().enumerate() {
            let path = format!("limits.frames[{index}]");
            frame.build(&path, model, profile, &mut rows)?;
            names.resize(rows.len(), path);
        }
        if let Some(centre) = &config.limits.centre_of_mass_velocity {
            rows.push(Box::new(centre.build(model)?));
            names.push("limits.centre_of_mass_velocity".to_owned());
        }
        if let Some(collision) = &config.limits.collision {
            let path = "limits.collision";
            rows.push(Box::new(collision.build(path, model, profile, &self.world)?));
            names.push(path.to_owned());
        }
        let points = self.contacts.iter().map(Contact::points).sum();
        let support = config.limits.support.as_ref();
        let support = support.map(|support| support.build(model, self.gravity, points)).transpose()?;
        Ok(RowLimits { rows, names, support, smallest: f64::INFINITY })
    }

    /// The limit of accelerations, for velocities.
    pub(super) fn acceleration_limit(
        &self,
        config: &QpControllerConfig,
    ) -> Result<Option<AccelerationLimit>, ConfigError> {
        let limits = &config.limits;
        let limit = limits.acceleration.as_ref();
        limit.map(|limit| limit.build(&self.model, self.profile.as_ref(), limits.position)).transpose()
    }

    fn check_tasks(&self) -> Result<(), ConfigError> {
        for (index, task) in self.tasks.iter().enumerate() {
            task.configured(index)?;
        }
        let own = ["joint_state", "base_state", OBJECTS_INPUT, FINGERS_INPUT];
        let (mut names, mut targets) = (Vec::new(), own.to_vec());
        for (context, kind) in self.tasks(0.0) {
            let TaskHead { name, level, target, wrench, formulations, acts_on } = kind.head();
            if !is_name(name) || names.contains(&name) {
                let message = format!("task name `{name}` is used twice or is invalid");
                return Err(ConfigError::key("tasks", message)
                    .advise("give each task its own `name`: lower-case letters, digits and underscores"));
            }
            names.push(name);
            if !(1..=LEVELS).contains(&level) {
                let message = format!("level {level} of task `{name}`, expected 1 to {LEVELS}");
                return Err(
                    ConfigError::key(context.key("level"), message).advise("1 is the highest priority")
                );
            }
            if formulations == Formulations::Torque && !self.torque {
                return Err(ConfigError::key(
                    &context.path,
                    format!("task `{name}` needs `inverse_dynamics`"),
                ));
            }
            if let Formulations::Velocity(instead) = formulations
                && self.torque
            {
                let message = format!("task `{name}` is not available with `inverse_dynamics`");
                return Err(ConfigError::key(&context.path, message).advise(instead));
            }
            let unused = match (self.unknowns, acts_on) {
                (Unknowns::Accelerations, ActsOn::Forces) => Some(("forces", "accelerations")),
                (Unknowns::Forces, ActsOn::Joints) => Some(("motions of the joints", "contact forces")),
                _ => None,
            };
            if let Some((what, unknowns)) = unused {
                let message = format!("task `{name}` acts on {what}, but the only unknowns are {unknowns}");
                return Err(ConfigError::key(&context.path, message)
                    .advise("leave it out, or solve for both: unknowns = \"accelerations_and_forces\""));
            }
            for (key, input) in [("target", target), ("wrench", wrench)] {
                let Some(input) = input else { continue };
                if targets[own.len()..].contains(&input) {
                    let message = format!("two tasks read their {key} from `{input}`");
                    return Err(ConfigError::key(context.key(key), message)
                        .advise(format!("give each task its own input, such as `{key} = \"left_{key}\"`")));
                }
                if own.contains(&input) || !is_name(input) {
                    let message = format!("`{input}` cannot be the name of an input");
                    return Err(ConfigError::key(context.key(key), message)
                        .advise(format!("use lower-case letters, digits and underscores, such as `{key}`")));
                }
                targets.push(input);
            }
        }
        Ok(())
    }
}

/// Limits of combinations of velocities.
pub(super) struct RowLimits {
    pub(super) rows: Vec<Box<dyn RowLimit>>,
    /// Key of each in the configuration.
    pub(super) names: Vec<String>,
    pub(super) support: Option<HeldSupport>,
    /// Smallest distance of the links from each other and from obstacles so far, m.
    smallest: f64,
}

impl RowLimits {
    /// All limits, in the order of their rows.
    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut (dyn RowLimit + 'static)> {
        let support = self.support.iter_mut().map(|support| &mut support.limit as &mut dyn RowLimit);
        self.rows.iter_mut().map(|limit| limit.as_mut()).chain(support)
    }

    /// Number of their rows.
    pub(super) fn count(&self) -> usize {
        let support = self.support.as_ref().map_or(0, |support| support.limit.rows());
        self.rows.iter().map(|limit| limit.rows()).sum::<usize>() + support
    }

    /// Records the distances at which the limits were evaluated.
    pub(super) fn observe(&mut self) {
        let distances = self.rows.iter().filter_map(|limit| limit.smallest_distance());
        self.smallest = distances.fold(self.smallest, f64::min);
    }

    /// Forgets the distances, for a new episode.
    pub(super) fn reset(&mut self) {
        self.smallest = f64::INFINITY;
    }

    /// Their entry in the result of a run.
    pub(super) fn add_to(&self, result: &mut serde_json::Value) {
        let smallest = Some(self.smallest).filter(|distance| distance.is_finite());
        result["smallest_distance_m"] = serde_json::json!(smallest);
    }
}

fn default_tasks() -> Vec<TaskConfig> {
    vec![TaskConfig::Cartesian(CartesianConfig::default()), TaskConfig::Posture(PostureConfig::default())]
}

fn check_numbers(config: &QpControllerConfig) -> Result<(), ConfigError> {
    let limits = &config.limits;
    in_range("max_lead", config.max_lead, 1e-6..=1e3)?;
    in_range("damping", config.damping, DAMPING)?;
    in_range("limits.position.rate", limits.position.rate, 1e-3..=1e6)?;
    in_range("limits.position.margin", limits.position.margin, 0.0..=1e3)?;
    in_range("limits.velocity.fraction", limits.velocity.fraction, 1e-6..=1.0)?;
    for component in config.gravity {
        in_range("gravity", component, -1000.0..=1000.0)?;
    }
    Ok(())
}

/// Rejects keys that have no effect with inverse dynamics.
fn refuse_velocity_keys(config: &QpControllerConfig) -> Result<(), ConfigError> {
    let default = QpControllerConfig::default();
    let given = [
        ("feedback", config.feedback != default.feedback),
        ("gravity_compensation", config.gravity_compensation != default.gravity_compensation),
        ("inertia_compensation", config.inertia_compensation != default.inertia_compensation),
        ("limits.acceleration", config.limits.acceleration.is_some()),
        ("limits.position.rate", config.limits.position.rate != default.limits.position.rate),
    ];
    if config.on_infeasible.is_some() {
        return Err(ConfigError::key("on_infeasible", "`inverse_dynamics` has its own key of this name")
            .advise("move the key there: inverse_dynamics = { on_infeasible = \"hold\" }"));
    }
    match given.into_iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((key, _)) => Err(ConfigError::key(key, "it has no effect with `inverse_dynamics`")
            .advise("leave it out: torques balance gravity and inertia, and joints accelerate by `inverse_dynamics.max_acceleration` and brake at `inverse_dynamics.braking`")),
    }
}

/// Returns the joints of the wheels that move the base of a robot with a floating base.
///
/// # Errors
/// [`ConfigError`] if the profile has no such wheels: without contacts the controller could not move the
/// base.
fn base_joints(
    robot: &RobotReference,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<Vec<usize>, ConfigError> {
    let Some(base) = profile.and_then(|profile| profile.mobile_base.as_ref()) else {
        let message =
            format!("robot `{}` has a floating base, which joint velocities alone do not move", robot.name);
        let advice = "add `inverse_dynamics = {}` for torques and contacts, or fix the base in the robot's URDF or profile; a base on wheels needs a `[mobile_base]` in the profile";
        return Err(ConfigError::key("robot", message).advise(advice));
    };
    let names = base.joints.iter().chain(&base.wheels).chain(&base.steering);
    let index = |name: &String| model.joint_names().iter().position(|joint| joint == name);
    // the profile was checked: every name is a joint's
    Ok(names.filter_map(index).collect())
}

/// Returns the gains of the configuration, or else of the profile.
fn gains(
    config: &QpControllerConfig,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<Gains, ConfigError> {
    let of_profile = profile.map(|profile| profile.gains(model));
    let gain = |name: &str, given: &Option<PerJoint>, pick: fn(&Gains) -> &DVector<f64>| match (
        given,
        &of_profile,
    ) {
        (Some(gains), _) => per_joint(name, gains, model),
        (None, Some(Ok(gains))) => Ok(pick(gains).clone()),
        (None, Some(Err(error))) => Err(ConfigError::new(format!("no `{name}` is given, and {error}"))),
        (None, None) => {
            let message = format!("no `{name}` is given, and robot `{}` has no profile", model.name());
            Err(ConfigError::new(message).advise(format!("add `{name}`: one number, or one per joint")))
        }
    };
    let kp = gain("kp", &config.kp, |gains| &gains.kp)?;
    let kd = gain("kd", &config.kd, |gains| &gains.kd)?;
    let gains = Gains { kp, kd };
    check_gains(model, &gains).map_err(|error| ConfigError::key(error.gain(), error.to_string()))?;
    Ok(gains)
}
