//! Quantities of a robot that rewards and terminations measure.

use core::f64::consts::PI;

use serde::Deserialize;

use super::TaskError;

/// A quantity of the state after a step, which rewards and terminations can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The constant 1.
    Alive,
    /// Position of `joint` \[rad or m\].
    JointPosition,
    /// Velocity of `joint` \[rad/s or m/s\].
    JointVelocity,
    /// Cosine of the sum of the positions of `joints`, -1 to 1.
    JointCosine,
    /// Effort of the drive of `joint` in the last physics step \[Nm or N\].
    JointEffort,
    /// Root mean square of the applied (clipped) action.
    Action,
    /// Root mean square of the difference between the applied (clipped) actions of this step and the previous
    /// step.
    ActionChange,
    /// Root mean square of the efforts of the action's joints in the last physics step \[Nm or N\].
    Effort,
    /// Root mean square deviation of the action's joints from the default pose \[rad or m\].
    PoseError,
    /// Norm of the difference between the horizontal velocity of the base and the command \[m/s\].
    VelocityError,
    /// Absolute difference between the yaw rate of the base and the command \[rad/s\].
    TurnError,
    /// Velocity of the base along its vertical axis \[m/s\].
    VerticalVelocity,
    /// Norm of the angular velocity of the base about its horizontal axes \[rad/s\].
    RollPitchRate,
    /// Angle between the vertical axis of the base and the vertical of the world, 0 to pi \[rad\].
    Tilt,
    /// Height of the base in the world \[m\].
    BaseHeight,
    /// Sum of the forces of contacts on `links` in the last physics step \[N\].
    ContactForce,
    /// Distance between the two `points`, or between a single point and the world origin \[m\].
    Distance,
    /// Height of the first of `points` above the second point, or of a single point above the world origin
    /// \[m\].
    Height,
    /// Relative speed of the two `points`, or speed of a single point in the world \[m/s\].
    Speed,
}

/// Function that maps a quantity to a reward.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// `x`.
    #[default]
    Linear,
    /// `|x|`.
    Absolute,
    /// `x^2`.
    Square,
    /// `exp(-(x / width)^2)`, 0 to 1.
    Kernel,
}

/// A term of the reward: `weight * clip(shape(quantity - target))`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reward {
    /// Quantity that is rewarded.
    pub term: Quantity,
    /// Name of the joint if the quantity refers to a joint.
    pub joint: Option<String>,
    /// Names of the joints if the quantity is `joint_cosine`.
    pub joints: Option<Vec<String>>,
    /// Names of the links if the quantity is `contact_force`.
    pub links: Option<Vec<String>>,
    /// One or two points if the quantity is `distance`, `height` or `speed`. A point is a link, an object, or
    /// `target`.
    pub points: Option<Vec<String>>,
    /// Value subtracted from the quantity. Default: 0.
    #[serde(default)]
    pub target: f64,
    /// Function that maps the difference between the quantity and `target` to a reward. Default: `linear`.
    #[serde(default)]
    pub shape: Shape,
    /// Width of a kernel, in units of the quantity, more than 0.
    pub width: Option<f64>,
    /// Minimum and maximum of the shaped value, before the weight. Default: unbounded.
    pub clip: Option<[f64; 2]>,
    /// Factor of the term. Default: 1.
    #[serde(default = "one")]
    pub weight: f64,
    /// Terms by which this term is multiplied. These terms cannot contain `times`. Default: no factors.
    #[serde(default)]
    pub times: Vec<Self>,
}

/// Result of an episode that ends by a termination.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The episode failed.
    #[default]
    Failure,
    /// The episode succeeded.
    Success,
}

/// A condition that ends an episode: a quantity is outside or inside a range.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Termination {
    /// Quantity that is monitored.
    pub term: Quantity,
    /// Name of the joint if the quantity refers to a joint.
    pub joint: Option<String>,
    /// Names of the joints if the quantity is `joint_cosine`.
    pub joints: Option<Vec<String>>,
    /// Names of the links if the quantity is `contact_force`.
    pub links: Option<Vec<String>>,
    /// One or two points if the quantity is `distance`, `height` or `speed`. A point is a link, an object, or
    /// `target`.
    pub points: Option<Vec<String>>,
    /// The episode ends if the quantity is outside this range.
    pub outside: Option<[f64; 2]>,
    /// The episode ends if the quantity is inside this range.
    pub inside: Option<[f64; 2]>,
    /// Result of the episode if this condition ends it. Default: `failure`.
    #[serde(default)]
    pub verdict: Verdict,
    /// Further conditions that must hold at the same time to end the episode. These conditions cannot contain
    /// `and` or `verdict`. Default: no further conditions.
    #[serde(default)]
    pub and: Vec<Self>,
}

fn one() -> f64 {
    1.0
}

/// A quantity and the parts of the robot that it measures.
#[derive(Clone, Copy, Debug)]
pub(super) struct Subject<'a> {
    pub(super) term: Quantity,
    pub(super) joint: Option<&'a String>,
    pub(super) joints: Option<&'a Vec<String>>,
    pub(super) links: Option<&'a Vec<String>>,
    pub(super) points: Option<&'a Vec<String>>,
}

impl Subject<'_> {
    /// Checks that the parts fit the quantity. Keys in errors start with `key`.
    fn check(self, key: &str) -> Result<(), TaskError> {
        let Self { term, joint, joints, links, points } = self;
        let takes_one =
            matches!(term, Quantity::JointPosition | Quantity::JointVelocity | Quantity::JointEffort);
        match joint {
            None if takes_one => return Err(TaskError::value(format!("{key}.joint"), "none", "a joint")),
            Some(name) if !takes_one => {
                return Err(TaskError::value(format!("{key}.joint"), name, "no joint for this term"));
            }
            _ => {}
        }
        for (names, part, takes) in [
            (joints, "joint", term == Quantity::JointCosine),
            (links, "link", term == Quantity::ContactForce),
            (points, "point", term.needs_points()),
        ] {
            let key = || format!("{key}.{part}s");
            match names {
                Some(names) if !takes => {
                    let expected = format!("no {part}s for this term");
                    return Err(TaskError::value(key(), names.join(", "), expected));
                }
                None if takes => {
                    return Err(TaskError::value(key(), "none", format!("at least one {part}")));
                }
                Some(names) if names.is_empty() => {
                    return Err(TaskError::value(key(), "none", format!("at least one {part}")));
                }
                _ => {}
            }
        }
        match points.map(Vec::as_slice) {
            None | Some([_]) => Ok(()),
            Some([first, second]) if first != second => Ok(()),
            Some(found) => {
                let expected = "one point, or two different points";
                Err(TaskError::value(format!("{key}.points"), found.join(", "), expected))
            }
        }
    }
}

fn is_ordered(range: Option<[f64; 2]>) -> bool {
    range.is_none_or(|[low, high]| low < high)
}

impl Quantity {
    /// Returns the range of the quantity. `clip` contains the bounds of the actions.
    fn range(self, clip: Option<[f64; 2]>) -> [f64; 2] {
        let largest = clip.map_or(f64::INFINITY, |[low, high]| low.abs().max(high.abs()));
        match self {
            Self::Alive => [1.0, 1.0],
            Self::JointCosine => [-1.0, 1.0],
            Self::JointPosition
            | Self::JointVelocity
            | Self::JointEffort
            | Self::VerticalVelocity
            | Self::BaseHeight
            | Self::Height => [f64::NEG_INFINITY, f64::INFINITY],
            Self::Action => [0.0, largest],
            Self::ActionChange => [0.0, clip.map_or(f64::INFINITY, |[low, high]| high - low)],
            Self::Tilt => [0.0, PI],
            Self::Effort
            | Self::PoseError
            | Self::VelocityError
            | Self::TurnError
            | Self::RollPitchRate
            | Self::ContactForce
            | Self::Distance
            | Self::Speed => [0.0, f64::INFINITY],
        }
    }

    /// Returns the name of the quantity in a task.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alive => "alive",
            Self::JointPosition => "joint_position",
            Self::JointVelocity => "joint_velocity",
            Self::JointCosine => "joint_cosine",
            Self::JointEffort => "joint_effort",
            Self::Action => "action",
            Self::ActionChange => "action_change",
            Self::Effort => "effort",
            Self::PoseError => "pose_error",
            Self::VelocityError => "velocity_error",
            Self::TurnError => "turn_error",
            Self::VerticalVelocity => "vertical_velocity",
            Self::RollPitchRate => "roll_pitch_rate",
            Self::Tilt => "tilt",
            Self::BaseHeight => "base_height",
            Self::ContactForce => "contact_force",
            Self::Distance => "distance",
            Self::Height => "height",
            Self::Speed => "speed",
        }
    }

    /// Returns `true` if the quantity is the motion or the pose of a floating base.
    pub(super) fn needs_base(self) -> bool {
        matches!(
            self,
            Self::VelocityError
                | Self::TurnError
                | Self::VerticalVelocity
                | Self::RollPitchRate
                | Self::Tilt
                | Self::BaseHeight
        )
    }

    /// Returns `true` if the quantity depends on the desired velocity of the base.
    pub(super) fn needs_command(self) -> bool {
        matches!(self, Self::VelocityError | Self::TurnError)
    }

    /// Returns `true` if the quantity is measured at points.
    pub(super) fn needs_points(self) -> bool {
        matches!(self, Self::Distance | Self::Height | Self::Speed)
    }
}

impl Reward {
    /// Returns the quantity and its parts.
    pub(super) fn subject(&self) -> Subject<'_> {
        let Self { term, joint, joints, links, points, .. } = self;
        let (joint, joints, links) = (joint.as_ref(), joints.as_ref(), links.as_ref());
        Subject { term: *term, joint, joints, links, points: points.as_ref() }
    }

    /// Checks the term and derives its range, including weight and factors. Keys in errors start with `key`.
    pub(super) fn range(&self, key: &str, clip: Option<[f64; 2]>) -> Result<[f64; 2], TaskError> {
        let [mut low, mut high] = self.own_range(key, clip)?;
        for (number, factor) in self.times.iter().enumerate() {
            let key = format!("{key}.times[{number}]");
            if !factor.times.is_empty() {
                return Err(TaskError::value(
                    format!("{key}.times"),
                    "terms",
                    "all factors in the list of the first term",
                ));
            }
            let [least, most] = factor.own_range(&key, clip)?;
            let products = [low * least, low * most, high * least, high * most];
            // 0 times infinity
            if products.iter().any(|product| product.is_nan()) {
                return Ok([f64::NEG_INFINITY, f64::INFINITY]);
            }
            low = products.into_iter().fold(f64::INFINITY, f64::min);
            high = products.into_iter().fold(f64::NEG_INFINITY, f64::max);
        }
        Ok([low, high])
    }

    /// Returns the range without factors.
    fn own_range(&self, key: &str, clip: Option<[f64; 2]>) -> Result<[f64; 2], TaskError> {
        self.subject().check(key)?;
        for (name, value) in [("target", self.target), ("weight", self.weight)] {
            if !value.is_finite() {
                return Err(TaskError::value(format!("{key}.{name}"), value, "a finite number"));
            }
        }
        if !is_ordered(self.clip) {
            let found = format!("{:?}", self.clip);
            return Err(TaskError::value(format!("{key}.clip"), found, "a lower and a higher bound"));
        }
        match (self.shape, self.width) {
            (Shape::Kernel, Some(width)) if width > 0.0 && width.is_finite() => {}
            (Shape::Kernel, width) => {
                let found = width.map_or_else(|| "none".to_owned(), |width| width.to_string());
                return Err(TaskError::value(format!("{key}.width"), found, "a width above 0"));
            }
            (_, Some(width)) => {
                return Err(TaskError::value(
                    format!("{key}.width"),
                    width,
                    "no width, except for the shape `kernel`",
                ));
            }
            _ => {}
        }
        let [low, high] = self.term.range(clip).map(|bound| bound - self.target);
        let crosses = low <= 0.0 && high >= 0.0;
        let [near, far] = [low.abs().min(high.abs()), low.abs().max(high.abs())];
        let near = if crosses { 0.0 } else { near };
        let [low, high] = match self.shape {
            Shape::Linear => [low, high],
            Shape::Absolute => [near, far],
            Shape::Square => [near * near, far * far],
            Shape::Kernel => [self.shaped(far + self.target), self.shaped(near + self.target)],
        };
        let [least, most] = self.clip.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let ends = [low.clamp(least, most), high.clamp(least, most)].map(|end| {
            // 0 times infinity is NaN: a term with weight 0 contributes 0
            if self.weight == 0.0 { 0.0 } else { self.weight * end }
        });
        Ok([ends[0].min(ends[1]), ends[0].max(ends[1])])
    }

    /// Returns the shaped quantity, before clip and weight.
    fn shaped(&self, value: f64) -> f64 {
        let away = value - self.target;
        match self.shape {
            Shape::Linear => away,
            Shape::Absolute => away.abs(),
            Shape::Square => away * away,
            Shape::Kernel => (-(away / self.width.unwrap_or(1.0)).powi(2)).exp(),
        }
    }

    /// Returns the reward for a value of the quantity.
    pub(super) fn evaluate(&self, value: f64) -> f64 {
        let shaped = self.shaped(value);
        self.weight * self.clip.map_or(shaped, |[low, high]| shaped.clamp(low, high))
    }
}

impl Termination {
    /// Returns the quantity and its parts.
    pub(super) fn subject(&self) -> Subject<'_> {
        let Self { term, joint, joints, links, points, .. } = self;
        let (joint, joints, links) = (joint.as_ref(), joints.as_ref(), links.as_ref());
        Subject { term: *term, joint, joints, links, points: points.as_ref() }
    }

    /// Checks the condition and its further conditions. Keys in errors start with `key`.
    pub(super) fn check(&self, key: &str) -> Result<(), TaskError> {
        for (number, other) in self.and.iter().enumerate() {
            let key = format!("{key}.and[{number}]");
            if !other.and.is_empty() {
                return Err(TaskError::value(
                    format!("{key}.and"),
                    "conditions",
                    "all conditions in the list of the first condition",
                ));
            }
            if other.verdict != Verdict::default() {
                let expected = "no value; set the verdict of the first condition";
                return Err(TaskError::value(format!("{key}.verdict"), "success", expected));
            }
            other.check(&key)?;
        }
        self.subject().check(key)?;
        let count = usize::from(self.outside.is_some()) + usize::from(self.inside.is_some());
        if count != 1 {
            let found = if count == 0 { "none" } else { "both" };
            return Err(TaskError::value(key, found, "one of `outside` and `inside`"));
        }
        if !(is_ordered(self.outside) && is_ordered(self.inside)) {
            let found = format!("{:?}", self.outside.or(self.inside));
            return Err(TaskError::value(key, found, "a lower and a higher bound"));
        }
        Ok(())
    }

    /// Returns `true` if a value of the quantity ends the episode.
    pub(super) fn is_met(&self, value: f64) -> bool {
        let within = |[low, high]: [f64; 2]| (low..=high).contains(&value);
        self.inside.is_some_and(within) || self.outside.is_some_and(|range| !within(range))
    }
}
