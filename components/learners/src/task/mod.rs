//! A learning task: observations, action, reward, terminations, start and randomisation of one robot.
//!
//! A task is a TOML file. The keys `observations` and `action` follow the format of a policy folder
//! ([`motorium_models::policy`]), so that a trained policy runs with the same terms.
//!
//! ```
//! use motorium_learners::task::Task;
//!
//! let task = Task::parse(
//!     r#"
//!     title = "Balance a pole"
//!     robot = "cart-pole"
//!     step = 0.005
//!     decimation = 4
//!     duration = 10.0
//!     observations = [{ term = "joint_positions" }, { term = "joint_velocities" }]
//!     rewards = [{ term = "alive" }, { term = "action", shape = "square", weight = -0.01 }]
//!     terminations = [{ term = "joint_position", joint = "hinge", outside = [2.93, 3.35] }]
//!     [start]
//!     position = [0.0, 3.14]
//!     [action]
//!     joints = ["slider", "hinge"]
//!     kind = "effort"
//!     scale = [10.0, 0.0]
//!     default_pose = [0.0, 3.14]
//!     clip = [-1.0, 1.0]
//!     "#,
//! )?;
//! assert_eq!((task.rate(), task.steps()), (50.0, 500));
//! // two actions between -1 and 1, of which the mean square counts
//! assert_eq!(task.reward_range()?, [0.99, 1.0]);
//! # Ok::<(), motorium_learners::task::TaskError>(())
//! ```

mod cameras;
mod choices;
mod command;
mod mirror;
mod noise;
mod points;
mod push;
mod quantity;
mod rhythm;
mod robot;
mod terms;
mod trial;

use motorium_locomotion::wheels::{RobotWheelsError, WheelsConfig};
use motorium_models::policy::{ActionKind, Pattern, Policy, PolicyError, RobotDigest};
use motorium_physics::randomise::{RandomiseConfig, RangeError};
use motorium_worlds::World;
use serde::Deserialize;

pub use cameras::Cameras;
pub(crate) use cameras::camera;
pub use choices::Choices;
pub(crate) use choices::best;
pub use command::{CommandRanges, Curriculum};
pub use mirror::{Mirror, Symmetry};
pub use noise::MeasurementNoise;
pub use points::{PointMotion, Points};
pub use push::Pushes;
pub use quantity::{Quantity, Reward, Shape, Termination, Verdict};
pub use rhythm::Rhythm;
pub use robot::{digest_joints, robot_difference, robot_digest};
pub use terms::{Outcome, RobotState, Terms};
pub use trial::{End, Step, Trial};

/// Name of the network's file in a policy folder.
pub const NETWORK: &str = "policy.onnx";

/// Key of the rows of a discrete action.
pub(crate) const CHOICES: &str = "choices";

/// Content of a task file, which describes a learning task.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// One-line description of the task.
    pub title: String,
    /// Robot: a name of the catalogue, or the path of a URDF or MJCF file relative to the task.
    pub robot: String,
    /// Duration of a physics step \[s\], more than 0.
    pub step: f64,
    /// Number of physics steps per policy step, at least 1.
    pub decimation: usize,
    /// Maximum duration of an episode \[s\]. An episode that reaches this duration is truncated, not
    /// terminated.
    pub duration: f64,
    /// Gravity, ground and objects around the robot, as in a graph. Paths are relative to the task. Default:
    /// Earth's gravity and no ground.
    #[serde(default)]
    pub world: World,
    /// State at the start of an episode.
    pub start: StartState,
    /// Observation terms, in the format of `policy.toml`.
    pub observations: Vec<toml::Value>,
    /// Depth cameras by name, with the keys of `sensor.depth_camera`. An image observation refers to one of
    /// these cameras by name. The camera defines the number of pixels, and also the range unless the
    /// observation specifies a range. Default: no cameras.
    #[serde(default)]
    pub cameras: Cameras,
    /// Action, as in `policy.toml`. A discrete action also has [`choices`](Self::choices).
    pub action: toml::Table,
    /// Settings of the wheels that a base twist moves, with the keys of `control.wheels`. A graph that runs
    /// the policy must use the same settings. Default: the defaults of `control.wheels`.
    pub wheels: Option<WheelsConfig>,
    /// Pattern generator commanded by the action, as in `policy.toml`. Default: no pattern generator; the
    /// action commands the joints.
    pub pattern: Option<Pattern>,
    /// Terms of the reward, which are added.
    pub rewards: Vec<Reward>,
    /// Conditions that end an episode.
    #[serde(default)]
    pub terminations: Vec<Termination>,
    /// Commanded velocities of the base, or positions of a target. Default: the task has no commands.
    pub command: Option<CommandRanges>,
    /// Pushes on the base during training. Default: no pushes.
    pub pushes: Option<Pushes>,
    /// Noise of the measurements that the policy observes during training. Default: no noise.
    pub noise: Option<MeasurementNoise>,
    /// Minimum and maximum number of physics steps before an action takes effect, less than `decimation`. The
    /// number is sampled for each episode. Default: 0.
    #[serde(default)]
    pub delay: [usize; 2],
    /// `true` limits position actions to the range and the velocity limit of each joint, as a command gate
    /// does. Default: false.
    #[serde(default)]
    pub within_limits: bool,
    /// Ranges of physical properties and start states, sampled at the start of every episode, as in a graph.
    #[serde(default)]
    pub randomise: RandomiseConfig,
    /// Left-right symmetry of the task, which learners need to mirror steps. Default: no symmetry.
    pub symmetry: Option<Symmetry>,
    /// Settings of learning algorithms for this task. The keys are the names of the algorithms.
    #[serde(default)]
    pub algorithms: toml::Table,
}

/// State at the start of an episode, to which randomisation is added.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartState {
    /// Configuration (nq) \[rad or m\].
    pub position: Vec<f64>,
    /// Velocity (nv) \[rad/s or m/s\]. Default: at rest.
    pub velocity: Option<Vec<f64>>,
    /// Maximum deviation of each velocity from the start, uniformly distributed \[rad/s or m/s\]. Default: 0.
    #[serde(default)]
    pub velocity_spread: f64,
    /// Number of physics steps without commands before the first observation. A graph always performs 1 such
    /// step: the first state is published after the first step, before a command can arrive. Default: 0.
    #[serde(default)]
    pub free_steps: usize,
}

/// Error of an invalid task.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TaskError {
    /// The file does not parse.
    #[error("{0}")]
    Parse(String),
    /// A value is out of range.
    #[error("`{key}`: found {found}, expected {expected}")]
    Value {
        /// Key of the value.
        key: String,
        /// Value found.
        found: String,
        /// Description of the valid range.
        expected: String,
    },
    /// A reward term can be infinite.
    #[error(
        "`rewards[{index}]`: the term lies between {low} and {high}, expected a finite range\n\
         help: add `clip = [LOW, HIGH]` or `shape = \"kernel\"` with a `width`"
    )]
    Unbounded {
        /// Index of the reward.
        index: usize,
        /// Lower bound of the term.
        low: f64,
        /// Upper bound of the term.
        high: f64,
    },
    /// The observations or the action are invalid.
    #[error(transparent)]
    Policy(#[from] PolicyError),
    /// The robot has no wheels that a base twist could command.
    #[error("`robot`: {}{}", .0, .0.help().map_or_else(String::new, |help| format!("\nhelp: {help}")))]
    Wheels(#[from] RobotWheelsError),
    /// A camera or a setting of the wheels is invalid.
    #[error("`{key}`: {message}")]
    Setting {
        /// The key.
        key: String,
        /// Value found, and values allowed.
        message: String,
    },
    /// A range of `randomise` cannot be sampled.
    #[error("`randomise.{}`: {}", .0.key, .0.message)]
    Range(RangeError),
}

impl TaskError {
    pub(crate) fn value(
        key: impl Into<String>,
        found: impl core::fmt::Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Value { key: key.into(), found: found.to_string(), expected: expected.into() }
    }
}

impl Task {
    /// Parses the text of a task file.
    ///
    /// # Errors
    ///
    /// [`TaskError`] with the key of an invalid value and the value expected.
    pub fn parse(text: &str) -> Result<Self, TaskError> {
        let task: Self = toml::from_str(text).map_err(|error| TaskError::Parse(error.to_string()))?;
        for (key, value) in [("step", task.step), ("duration", task.duration)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(TaskError::value(key, value, "a time above 0 s"));
            }
        }
        if task.decimation == 0 {
            return Err(TaskError::value("decimation", 0, "at least 1"));
        }
        if task.steps() == 0 {
            let expected = format!("at least one step of the policy, {} s", 1.0 / task.rate());
            return Err(TaskError::value("duration", task.duration, expected));
        }
        let spread = task.start.velocity_spread;
        if !(spread >= 0.0 && spread.is_finite()) {
            return Err(TaskError::value("start.velocity_spread", spread, "at least 0"));
        }
        if task.rewards.is_empty() {
            return Err(TaskError::value("rewards", "none", "at least one term"));
        }
        task.check_cameras()?;
        let policy = task.policy()?;
        task.check_images(&policy)?;
        task.choices()?;
        if let Some(wheels) = &task.wheels {
            check_wheels(wheels, policy.action.kind)?;
        }
        if let Some(command) = &task.command {
            command.check()?;
        }
        if let Some(pushes) = &task.pushes {
            pushes.check()?;
        }
        if let Some(noise) = &task.noise {
            noise.check()?;
        }
        let [fewest, most] = task.delay;
        if !(fewest <= most && most < task.decimation) {
            let expected = format!("a lower and a higher number of physics steps below {}", task.decimation);
            return Err(TaskError::value("delay", format!("{:?}", task.delay), expected));
        }
        if task.within_limits && (task.pattern.is_some() || policy.action.kind != ActionKind::Position) {
            let expected = "false, unless the action commands joint positions";
            return Err(TaskError::value("within_limits", true, expected));
        }
        task.reward_range()?;
        for (index, termination) in task.terminations.iter().enumerate() {
            termination.check(&format!("terminations[{index}]"))?;
        }
        Ok(task)
    }

    /// Returns the rate of the policy \[Hz\].
    pub fn rate(&self) -> f64 {
        1.0 / (self.step * self.decimation as f64)
    }

    /// Returns the maximum number of policy steps of an episode.
    pub fn steps(&self) -> usize {
        (self.duration * self.rate()).round() as usize
    }

    /// Returns the text of `policy.toml` for policies of this task. The text contains the digest of the robot
    /// if it is given.
    ///
    /// # Errors
    ///
    /// [`TaskError`] if the terms do not serialise, or an image refers to an unknown camera.
    pub fn policy_text(&self, robot: Option<RobotDigest>) -> Result<String, TaskError> {
        let mut table = toml::Table::new();
        table.insert("network".into(), NETWORK.into());
        table.insert("rate".into(), self.rate().into());
        table.insert("robot".into(), self.robot.clone().into());
        table.insert("observations".into(), toml::Value::Array(self.described_observations()?));
        let mut action = self.action.clone();
        // the network of a discrete policy puts out the chosen row
        action.remove(CHOICES);
        table.insert("action".into(), toml::Value::Table(action));
        if let Some(pattern) = &self.pattern {
            let pattern =
                toml::Value::try_from(pattern).map_err(|error| TaskError::Parse(error.to_string()))?;
            table.insert("pattern".into(), pattern);
        }
        if let Some(robot) = robot {
            let digest = toml::Value::try_from(robot).map_err(|error| TaskError::Parse(error.to_string()))?;
            table.insert("robot_digest".into(), digest);
        }
        toml::to_string(&table).map_err(|error| TaskError::Parse(error.to_string()))
    }

    /// Returns the observations and the action of the task as a policy.
    ///
    /// # Errors
    ///
    /// [`TaskError`] if an observation or the action is invalid.
    pub fn policy(&self) -> Result<Policy, TaskError> {
        Ok(Policy::parse(&self.policy_text(None)?)?)
    }

    /// Returns the lowest and highest possible reward of a step.
    ///
    /// # Errors
    ///
    /// [`TaskError::Unbounded`] if a term can be infinite.
    pub fn reward_range(&self) -> Result<[f64; 2], TaskError> {
        let clip = self.policy()?.action.bounds();
        let mut total = [0.0; 2];
        for (index, reward) in self.rewards.iter().enumerate() {
            let [low, high] = reward.range(&format!("rewards[{index}]"), clip)?;
            if !(low.is_finite() && high.is_finite()) {
                return Err(TaskError::Unbounded { index, low, high });
            }
            total[0] += low;
            total[1] += high;
        }
        Ok(total)
    }
}

/// Checks the settings of the wheels of a task.
fn check_wheels(wheels: &WheelsConfig, kind: ActionKind) -> Result<(), TaskError> {
    if kind != ActionKind::BaseTwist {
        return Err(TaskError::value(
            "wheels",
            "settings",
            "no value, because the action is not a base twist",
        ));
    }
    wheels.check().map_err(|error| TaskError::Setting {
        key: error.key.map_or_else(|| "wheels".to_owned(), |key| format!("wheels.{key}")),
        message: error.message,
    })?;
    let default = WheelsConfig::default();
    for (key, is_default, expected) in [
        ("start", wheels.start == default.start, "no value, because a task has no odometry"),
        ("slip", wheels.slip == default.slip, "no value, because a task has no odometry"),
        ("gravity", wheels.gravity == default.gravity, "no value; set it in `[world]`"),
        (
            "state_timeout",
            wheels.state_timeout == default.state_timeout,
            "no value, because the states of a task have no age",
        ),
    ] {
        if !is_default {
            return Err(TaskError::value(format!("wheels.{key}"), "a value", expected));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
