//! The folder of a trained policy: `policy.toml` beside its network.
//!
//! The file names the joints of the action, so that a robot with another joint order gets each number at the right joint:
//!
//! ```
//! use motorium_models::policy::Policy;
//!
//! let policy = Policy::parse(
//!     r#"
//!     network = "policy.onnx"
//!     rate = 50.0
//!     observations = [{ term = "joint_positions" }, { term = "command", scale = 2.0 }]
//!     [action]
//!     joints = ["hip", "knee"]
//!     scale = 0.5
//!     default_pose = [0.1, -0.2]
//!     "#,
//! )?;
//! assert_eq!(policy.inputs(), Ok(5));
//! let targets = policy.joint_targets(&["knee", "hip"])?;
//! let mut q = [0.0; 2];
//! targets.apply(&[1.0, 2.0], &mut q);
//! assert_eq!(q, [0.8, 0.6]);
//! # Ok::<(), motorium_models::policy::PolicyError>(())
//! ```

mod targets;

use serde::Deserialize;

pub use targets::{JointTarget, JointTargets};

/// A policy as `policy.toml` describes it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Policy {
    /// File of the network, relative to the folder.
    pub network: String,
    /// Rate at which the policy was trained \[Hz\], above 0.
    pub rate: f64,
    /// Robot that it was trained for, as `motorium robot list` names it.
    pub robot: Option<String>,
    /// Observation terms, in the order of the network's inputs.
    pub observations: Vec<Observation>,
    /// Meaning of the network's outputs.
    pub action: Action,
}

/// A part of the observation.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// The quantity.
    pub term: Term,
    /// Factor of all its numbers, or of each. Default: 1.
    #[serde(default = "one")]
    pub scale: Numbers,
    /// Bounds before the factor. Default: unbounded.
    pub clip: Option<[f64; 2]>,
    /// Number of steps, the newest last. Default: 1. Range: 1 to 64.
    #[serde(default = "single")]
    pub history: usize,
    /// Number of rays of a height scan; for that term only.
    pub rays: Option<usize>,
}

/// A quantity that a policy observes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Term {
    /// Linear velocity of the base in its frame \[m/s\].
    BaseLinearVelocity,
    /// Angular velocity of the base in its frame \[rad/s\].
    BaseAngularVelocity,
    /// Direction of gravity in the frame of the base.
    ProjectedGravity,
    /// Desired velocity: forward, left \[m/s\], turn \[rad/s\].
    Command,
    /// Joint positions relative to the default pose \[rad or m\].
    JointPositions,
    /// Joint velocities \[rad/s or m/s\].
    JointVelocities,
    /// The action of the step before.
    LastAction,
    /// Heights around the robot \[m\].
    HeightScan,
    /// Sine and cosine of the gait phase.
    Phase,
}

impl Term {
    /// Name of the term in `policy.toml`.
    pub fn name(self) -> &'static str {
        match self {
            Self::BaseLinearVelocity => "base_linear_velocity",
            Self::BaseAngularVelocity => "base_angular_velocity",
            Self::ProjectedGravity => "projected_gravity",
            Self::Command => "command",
            Self::JointPositions => "joint_positions",
            Self::JointVelocities => "joint_velocities",
            Self::LastAction => "last_action",
            Self::HeightScan => "height_scan",
            Self::Phase => "phase",
        }
    }

    /// Message that carries the quantity; `None` for those that the policy computes.
    pub fn message(self) -> Option<&'static str> {
        Some(match self {
            Self::BaseLinearVelocity => "motorium.BaseState",
            Self::BaseAngularVelocity | Self::ProjectedGravity => "motorium.ImuSample",
            Self::Command => "motorium.TwistTarget",
            Self::JointPositions | Self::JointVelocities => "motorium.JointState",
            Self::HeightScan => "motorium.HeightScan",
            Self::LastAction | Self::Phase => return None,
        })
    }
}

/// One number for all, or one for each.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Numbers {
    /// The same for all.
    All(f64),
    /// In the order of the policy's joints, or of the term's numbers.
    Each(Vec<f64>),
}

impl Numbers {
    fn get(&self, index: usize) -> f64 {
        match self {
            Self::All(value) => *value,
            Self::Each(values) => values[index],
        }
    }

    fn check(&self, key: &str, count: usize) -> Result<(), PolicyError> {
        match self {
            Self::Each(values) if values.len() != count => Err(PolicyError::Value {
                key: key.to_owned(),
                message: format!("found {} numbers, expected 1 or {count}", values.len()),
            }),
            _ => {
                let values = (0..count).map(|index| self.get(index));
                finite(key, values)
            }
        }
    }
}

fn one() -> Numbers {
    Numbers::All(1.0)
}

fn zero() -> Numbers {
    Numbers::All(0.0)
}

fn single() -> usize {
    1
}

fn finite(key: &str, values: impl Iterator<Item = f64>) -> Result<(), PolicyError> {
    let mut values = values;
    match values.find(|value| !value.is_finite()) {
        Some(value) => Err(PolicyError::Value {
            key: key.to_owned(),
            message: format!("found {value}, expected finite numbers"),
        }),
        None => Ok(()),
    }
}

/// What an action commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActionKind {
    /// Joint positions \[rad or m\].
    #[default]
    Position,
    /// Joint velocities \[rad/s or m/s\].
    Velocity,
    /// Joint efforts \[Nm or N\].
    Effort,
}

/// The meaning of a network's outputs.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Action {
    /// Joint of each output.
    pub joints: Vec<String>,
    /// Quantity commanded. Default: position.
    #[serde(default)]
    pub kind: ActionKind,
    /// Factor of the action, for all joints or each. Default: 1.
    #[serde(default = "one")]
    pub scale: Numbers,
    /// Added after the factor, besides the default pose. Default: 0.
    #[serde(default = "zero")]
    pub offset: Numbers,
    /// Pose of a zero action \[rad or m\], in the order of `joints`.
    pub default_pose: Vec<f64>,
    /// Bounds of the network's outputs before the factor. Default: unbounded.
    pub clip: Option<[f64; 2]>,
    /// Stiffness of the drives \[Nm/rad or N/m\]; if left out, the robot's profile holds it.
    pub kp: Option<Numbers>,
    /// Damping of the drives \[Nms/rad or Ns/m\]; if left out, the robot's profile holds it.
    pub kd: Option<Numbers>,
}

/// A policy that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolicyError {
    /// The file does not parse.
    #[error("line {line}, column {column}: {message}")]
    Parse {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The defect, and what was expected.
        message: String,
    },
    /// A value is out of range.
    #[error("`{key}`: {message}")]
    Value {
        /// The key.
        key: String,
        /// The value found, and what was expected.
        message: String,
    },
    /// Joints of the policy and of the robot differ.
    #[error("{message}; help: rename the joints in `action.joints`, in the order of the network's outputs")]
    Joints {
        /// The joints that are missing.
        message: String,
    },
}

impl Policy {
    /// Reads the text of a `policy.toml`.
    ///
    /// # Errors
    ///
    /// [`PolicyError`] with the line and column, or the key.
    pub fn parse(text: &str) -> Result<Self, PolicyError> {
        let policy: Self = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start).min(text.len());
            let before = text.get(..start).unwrap_or("");
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
            PolicyError::Parse { line, column, message: error.message().to_owned() }
        })?;
        policy.check()?;
        Ok(policy)
    }

    fn check(&self) -> Result<(), PolicyError> {
        let wrong = |key: &str, message: String| Err(PolicyError::Value { key: key.to_owned(), message });
        if !(self.rate > 0.0 && self.rate.is_finite()) {
            return wrong("rate", format!("found {}, expected a rate above 0 Hz", self.rate));
        }
        let Action { joints, scale, offset, default_pose, clip, kp, kd, .. } = &self.action;
        let count = joints.len();
        if count == 0 {
            return wrong("action.joints", "found no joint, expected at least one".to_owned());
        }
        if let Some(name) = joints.iter().enumerate().find(|(k, name)| joints[..*k].contains(name)) {
            return wrong("action.joints", format!("found \"{}\" twice, expected each joint once", name.1));
        }
        if default_pose.len() != count {
            let message =
                format!("found {} numbers, expected {count}, one for each joint", default_pose.len());
            return wrong("action.default_pose", message);
        }
        finite("action.default_pose", default_pose.iter().copied())?;
        for (key, numbers) in
            [("scale", Some(scale)), ("offset", Some(offset)), ("kp", kp.as_ref()), ("kd", kd.as_ref())]
        {
            numbers.map_or(Ok(()), |numbers| numbers.check(&format!("action.{key}"), count))?;
        }
        for numbers in [("action.kp", kp), ("action.kd", kd)] {
            let negative = |numbers: &Numbers| (0..count).any(|index| numbers.get(index) < 0.0);
            if numbers.1.as_ref().is_some_and(negative) {
                return wrong(numbers.0, "found a negative gain, expected at least 0".to_owned());
            }
        }
        let ordered = |clip: &Option<[f64; 2]>| clip.is_none_or(|[low, high]| low < high);
        if !ordered(clip) {
            return wrong("action.clip", format!("found {clip:?}, expected a lower and a higher bound"));
        }
        for (index, observation) in self.observations.iter().enumerate() {
            let key = |name: &str| format!("observations[{index}].{name}");
            if !(1..=64).contains(&observation.history) {
                return wrong(&key("history"), format!("found {}, expected 1 to 64", observation.history));
            }
            if !ordered(&observation.clip) {
                let message = format!("found {:?}, expected a lower and a higher bound", observation.clip);
                return wrong(&key("clip"), message);
            }
            let is_scan = observation.term == Term::HeightScan;
            match observation.rays {
                Some(1..) if is_scan => {}
                None if !is_scan => {}
                Some(_) if !is_scan => {
                    return wrong(&key("rays"), "expected for a height scan only".to_owned());
                }
                _ => {
                    return wrong(
                        &key("rays"),
                        "missing, expected the number of rays of the height scan".to_owned(),
                    );
                }
            }
            observation.scale.check(&key("scale"), self.width(observation))?;
        }
        self.inputs().map(drop)
    }

    /// Numbers of one step of a term.
    pub fn width(&self, observation: &Observation) -> usize {
        match observation.term {
            Term::BaseLinearVelocity | Term::BaseAngularVelocity | Term::ProjectedGravity | Term::Command => {
                3
            }
            Term::JointPositions | Term::JointVelocities | Term::LastAction => self.action.joints.len(),
            Term::HeightScan => observation.rays.unwrap_or(0),
            Term::Phase => 2,
        }
    }

    /// Numbers of the whole observation, with histories.
    ///
    /// # Errors
    ///
    /// [`PolicyError::Value`] if there is no term, or there are too many numbers.
    pub fn inputs(&self) -> Result<usize, PolicyError> {
        let widths = self.observations.iter().map(|term| self.width(term).checked_mul(term.history));
        let sum = widths.into_iter().try_fold(0_usize, |sum, width| sum.checked_add(width?));
        sum.filter(|sum| (1..1 << 20).contains(sum)).ok_or_else(|| PolicyError::Value {
            key: "observations".to_owned(),
            message: "expected between one number and a million in all terms together".to_owned(),
        })
    }

    /// Maps actions to the joints of a robot, in its order. Joints of the robot that the policy does not command are
    /// left alone.
    ///
    /// # Errors
    ///
    /// [`PolicyError::Joints`] that names the joints which the robot does not have.
    pub fn joint_targets(&self, robot: &[impl AsRef<str>]) -> Result<JointTargets, PolicyError> {
        let Action { joints, scale, offset, default_pose, clip, .. } = &self.action;
        let (mut targets, mut missing) = (Vec::new(), Vec::new());
        for (index, name) in joints.iter().enumerate() {
            let Some(joint) = robot.iter().position(|joint| joint.as_ref() == name) else {
                missing.push(format!("\"{name}\""));
                continue;
            };
            let shift = if self.action.kind == ActionKind::Position { default_pose[index] } else { 0.0 };
            targets.push(JointTarget { joint, scale: scale.get(index), offset: shift + offset.get(index) });
        }
        if missing.is_empty() {
            return Ok(JointTargets::new(targets, clip.unwrap_or([f64::NEG_INFINITY, f64::INFINITY])));
        }
        let names: Vec<&str> = robot.iter().map(AsRef::as_ref).collect();
        let message =
            format!("the robot has no joint {}; its joints are {}", missing.join(", "), names.join(", "));
        Err(PolicyError::Joints { message })
    }
}

#[cfg(test)]
mod tests;
