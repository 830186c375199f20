//! Goals and limits of the configuration, resolved for a robot.

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MotionGoal;
use motorium_primitives::profile::MotionLimits;
use motorium_robots::{Loaded, Model, Profile};

use super::config::{HOME, JointGoal, JointGoalConfig, JointNumbers, ToolPoseConfig, TrajectoryConfig};
use super::planner::{GoalPlanner, Planned};
use crate::dmp::orientation;
use crate::gripper::Fingers;
use crate::robot::required;

/// The goals and limits of a trajectory.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) goals: Vec<Goal>,
    pub(super) limits: Vec<MotionLimits>,
    pub(super) joints: Vec<String>,
    /// The fingers of the end effector, if it has any.
    pub(super) fingers: Option<Fingers>,
    pub(super) planner: GoalPlanner,
}

/// One goal.
#[derive(Clone, Debug)]
pub(super) struct Goal {
    /// Target of each joint.
    target: Vec<Target>,
    pub(super) duration: Option<f64>,
    pub(super) dwell: f64,
}

#[derive(Clone, Copy, Debug)]
enum Target {
    At(f64),
    Beside(f64),
}

impl Goal {
    /// Returns the joint positions at the goal, computed from the positions at the previous goal.
    pub(super) fn write(&self, before: &[f64], position: &mut [f64]) {
        for ((position, before), target) in position.iter_mut().zip(before).zip(&self.target) {
            *position = match target {
                Target::At(position) => *position,
                Target::Beside(offset) => before + offset,
            };
        }
    }
}

impl Plan {
    /// Checks everything that can be checked before a run.
    pub(super) fn new(
        config: &TrajectoryConfig,
        robot: Option<&RobotReference>,
    ) -> Result<Self, ConfigError> {
        let robot = required(robot, "joints")?;
        if config.goals.is_empty() {
            return Err(ConfigError::key("goals", "no goal is given, expected at least one"));
        }
        if !(config.tolerance > 0.0 && config.tolerance.is_finite()) {
            let message = format!("{}, expected a positive number", config.tolerance);
            return Err(ConfigError::key("tolerance", message));
        }
        let loaded = crate::robot::load(robot)?;
        let mut planner = GoalPlanner::of_loaded(loaded.clone(), config.frame.as_deref())?;
        let fingers = Fingers::of_robot(&loaded, config.frame.as_deref());
        let Loaded { model, profile, .. } = loaded;
        let limits = config.limits.resolve(&model, profile.as_ref())?;
        let home = profile.as_ref().and_then(|profile| profile.home(&model).ok());
        let mut goals = Vec::new();
        // the known position of the robot: all joints that some goal has set
        let mut known: Vec<Option<f64>> = vec![None; model.joint_count()];
        for (index, goal) in config.goals.iter().enumerate() {
            let (key, table) = (format!("goals[{index}]"), table(goal));
            let mut goal = read(&table, &model, profile.as_ref(), &key)?;
            if let Some(gripper) = table.gripper {
                let error = |error: &dyn core::fmt::Display| {
                    ConfigError::key(format!("{key}.gripper"), error.to_string())
                };
                let fingers = fingers.as_ref().map_err(|none| error(none))?;
                for (joint, position) in fingers.positions(gripper).map_err(|outside| error(&outside))? {
                    goal.target[joint] = Target::At(position);
                }
            }
            if let Some(pose) = &table.end_effector {
                let key = format!("{key}.end_effector");
                for (joint, position) in solve(pose, &mut planner, &known, home.as_ref(), &key)? {
                    goal.target[joint] = Target::At(position);
                }
            }
            for (joint, (known, target)) in known.iter_mut().zip(&goal.target).enumerate() {
                *known = match target {
                    Target::At(position) => Some(*position),
                    Target::Beside(offset) => known.map(|known| known + offset),
                };
                let range = model.lower()[joint]..=model.upper()[joint];
                if let Some(position) = known.filter(|position| !range.contains(position)) {
                    let message = format!(
                        "joint \"{}\" at {position}, outside of its range {} to {}",
                        model.joint_names()[joint],
                        range.start(),
                        range.end()
                    );
                    let error = ConfigError::key(format!("goals[{index}]"), message);
                    return Err(match model.degrees_advice(joint, position) {
                        Some(advice) => error.advise(advice),
                        None => error,
                    });
                }
            }
            goals.push(goal);
        }
        Ok(Self { goals, limits, joints: model.joint_names().to_vec(), fingers: fingers.ok(), planner })
    }
}

fn table(goal: &JointGoal) -> JointGoalConfig {
    match goal {
        JointGoal::Pose(name) => JointGoalConfig { pose: Some(name.clone()), ..JointGoalConfig::default() },
        JointGoal::Table(table) => table.clone(),
    }
}

/// Reads a goal without its gripper and its end effector.
fn read(
    table: &JointGoalConfig,
    model: &Model,
    profile: Option<&Profile>,
    key: &str,
) -> Result<Goal, ConfigError> {
    let stay = || vec![Target::Beside(0.0); model.joint_count()];
    let target = match (&table.pose, &table.position, &table.offset, &table.end_effector) {
        (Some(name), None, None, None) => {
            pose(name, model, profile, key)?.into_iter().map(Target::At).collect()
        }
        (None, Some(position), None, None) => {
            numbers(position, model, &format!("{key}.position"), Target::At)?
        }
        (None, None, Some(offset), None) => numbers(offset, model, &format!("{key}.offset"), Target::Beside)?,
        (None, None, None, Some(_)) => stay(),
        (None, None, None, None) if table.gripper.is_some() => stay(),
        (None, None, None, None) => {
            let message = "`pose`, `position`, `offset`, `end_effector` and `gripper` are all missing";
            return Err(ConfigError::key(key, message).advise("give one of them, or the name of a pose"));
        }
        _ => {
            let message = "more than one of `pose`, `position`, `offset` and `end_effector` is given";
            return Err(ConfigError::key(key, message).advise("keep one of them"));
        }
    };
    Ok(Goal {
        target,
        duration: table.duration.map(|duration| duration.as_secs_f64()),
        dwell: table.dwell.as_secs_f64(),
    })
}

/// Finds positions of the joints that place the end effector. The search starts from the known positions of
/// the joints, and elsewhere from the home pose.
fn solve(
    pose: &ToolPoseConfig,
    planner: &mut GoalPlanner,
    known: &[Option<f64>],
    home: Option<&nalgebra::DVector<f64>>,
    key: &str,
) -> Result<Vec<(usize, f64)>, ConfigError> {
    let moving: Vec<usize> = (0..known.len()).filter(|joint| planner.moves_end_effector(*joint)).collect();
    let turn = orientation(pose.orientation, pose.rpy, |name| format!("{key}.{name}"))?;
    if turn.is_none() && moving.iter().any(|joint| known[*joint].is_none()) {
        let message = "the orientation is not given, and the previous goal does not determine it";
        return Err(ConfigError::key(key, message).advise("add `rpy` or `orientation`"));
    }
    let mut goal = MotionGoal::default();
    goal.set_position(pose.position);
    goal.orientation = turn.map_or([0.0; 4], |turn| turn.coords.into());
    let model = planner.model();
    let start = known.iter().enumerate().map(|(joint, known)| {
        let usual = home.map_or(0.0, |home| home[joint]);
        known.unwrap_or(usual).max(model.lower()[joint]).min(model.upper()[joint])
    });
    let start: Vec<f64> = start.collect();
    let planned = planner.begin(&goal, &start).map(|()| planner.advance(usize::MAX));
    match planned {
        Ok(Planned::Refused(refusal)) | Err(refusal) => {
            let message = planner.explain(&refusal).to_string();
            Err(ConfigError::key(key, message)
                .advise("bring the goal nearer; positions are in metres, in the world frame"))
        }
        Ok(Planned::Ready | Planned::Searching) => {
            Ok(moving.into_iter().map(|joint| (joint, planner.target()[joint])).collect())
        }
    }
}

fn pose(name: &str, model: &Model, profile: Option<&Profile>, key: &str) -> Result<Vec<f64>, ConfigError> {
    let profile = profile.ok_or_else(|| {
        ConfigError::key(key, format!("robot `{}` has no profile, and no pose \"{name}\"", model.name()))
            .advise("`motorium robot profile` writes a profile with the pose \"home\"")
    })?;
    // `start` of the graph file replaces the home pose, but not a pose named "home"
    let name = if name == HOME { &profile.home } else { name };
    let pose = profile.pose(model, name).map_err(|error| ConfigError::key(key, error.to_string()))?;
    Ok(pose.as_slice().to_vec())
}

fn numbers(
    given: &JointNumbers,
    model: &Model,
    key: &str,
    target: fn(f64) -> Target,
) -> Result<Vec<Target>, ConfigError> {
    let finite = |number: f64| {
        let message = format!("{number}, expected a finite number");
        if number.is_finite() { Ok(target(number)) } else { Err(ConfigError::key(key, message)) }
    };
    let names = || model.joint_names().join(", ");
    match given {
        JointNumbers::Each(given) => {
            let given = given.resolve(model.joint_count()).map_err(|error| {
                ConfigError::key(key, error.to_string()).advise(format!("in this order: {}", names()))
            })?;
            given.into_iter().map(finite).collect()
        }
        JointNumbers::Named(given) => {
            let mut targets = vec![Target::Beside(0.0); model.joint_count()];
            for (name, number) in given {
                let index = model.joint_index(name).ok_or_else(|| {
                    let message = format!("robot `{}` has no joint \"{name}\"", model.name());
                    ConfigError::key(key, message).advise(format!("its joints are {}", names()))
                })?;
                targets[index] = finite(*number)?;
            }
            Ok(targets)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First goal of `config` for the planar arm with these settings and a profile whose pose "home" is zero.
    fn first_goal(goal: &str, settings: serde_json::Value) -> Vec<f64> {
        let folder = tempfile::tempdir().unwrap();
        let profile = folder.path().join("profile.toml");
        let text = "title = \"arm\"\nsources = []\njoints = [\"joint1\", \"joint2\", \"joint3\"]\nhome = \"home\"\n\
                    [poses]\nhome = [0.0, 0.0, 0.0]\nbent = [0.1, 0.2, 0.3]\n";
        std::fs::write(&profile, text).unwrap();
        let robot = RobotReference {
            name: "arm".to_owned(),
            urdf: "planar-3r".to_owned(),
            base: folder.path().to_owned(),
            pose: None,
            profile: Some(profile),
            package_path: Vec::new(),
            settings: Some(settings),
        };
        let config: TrajectoryConfig = toml::from_str(&format!(
            "goals = [\"{goal}\"]\nlimits = {{ velocity = 1.0, acceleration = 1.0 }}"
        ))
        .unwrap();
        let plan = Plan::new(&config, Some(&robot)).unwrap();
        let mut position = vec![f64::NAN; 3];
        plan.goals[0].write(&[0.0; 3], &mut position);
        position
    }

    #[test]
    fn home_is_the_start_of_the_graph() {
        let start = serde_json::json!({ "start": [0.5, 0.4, 0.3] });
        assert_eq!(first_goal("home", start), [0.5, 0.4, 0.3]);
        assert_eq!(first_goal("home", serde_json::json!({ "start": "bent" })), [0.1, 0.2, 0.3]);
        assert_eq!(first_goal("home", serde_json::json!({})), [0.0; 3]);
        assert_eq!(first_goal("bent", serde_json::json!({ "start": [0.5, 0.4, 0.3] })), [0.1, 0.2, 0.3]);
    }
}
