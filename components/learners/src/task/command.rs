//! Commands of a task: desired velocities of a base or positions of a target, which change at regular
//! intervals.

use rand::RngExt as _;
use serde::Deserialize;

use super::TaskError;
use crate::random::{Counter, Purpose};

/// Ranges from which the commands of a task are sampled: velocities of a base, or positions of a target. A
/// command is sampled uniformly at the start of an episode and after every interval.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandRanges {
    /// Range of the forward velocity \[m/s\]. Default: 0.
    #[serde(default)]
    pub forward: [f64; 2],
    /// Range of the velocity to the left \[m/s\]. Default: 0.
    #[serde(default)]
    pub left: [f64; 2],
    /// Range of the yaw rate, positive to the left \[rad/s\]. Default: 0.
    #[serde(default)]
    pub turn: [f64; 2],
    /// Ranges of x, y and z of the target in the world \[m\]. Default: no target; the task commands
    /// velocities.
    pub target: Option<[[f64; 2]; 3]>,
    /// Time between two commands \[s\], more than 0. Default: 5.
    #[serde(default = "five")]
    pub interval: f64,
    /// Probability that a command of velocities is a command to stand still, 0 to 1. Default: 0.
    #[serde(default)]
    pub standing: f64,
    /// Growth of the ranges during training. Default: the full ranges from the start.
    pub curriculum: Option<Curriculum>,
}

/// Linear growth of the command ranges during a training run. Ranges of velocities grow around 0; ranges of a
/// target position grow around their middle.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curriculum {
    /// Factor of the ranges at the start, 0 to 1.
    pub start: f64,
    /// Number of steps, in all worlds together, after which the ranges have their full size, at least 1.
    pub steps: u64,
}

fn five() -> f64 {
    5.0
}

impl CommandRanges {
    /// Checks all numbers.
    pub(super) fn check(&self) -> Result<(), TaskError> {
        for (key, range) in [("forward", self.forward), ("left", self.left), ("turn", self.turn)] {
            let [low, high] = range;
            if !(low <= high && low.is_finite() && high.is_finite()) {
                let expected = "a lower and a higher velocity";
                return Err(TaskError::value(format!("command.{key}"), format!("{range:?}"), expected));
            }
        }
        for (axis, range) in ["x", "y", "z"].into_iter().zip(self.target.iter().flatten()) {
            let [low, high] = *range;
            if !(low <= high && low.is_finite() && high.is_finite()) {
                let expected = format!("a lower and a higher {axis}");
                return Err(TaskError::value("command.target", format!("{range:?}"), expected));
            }
        }
        let has_velocities = [self.forward, self.left, self.turn] != [[0.0; 2]; 3] || self.standing != 0.0;
        if self.target.is_some() && has_velocities {
            let expected = "either `target`, or velocities and `standing`";
            return Err(TaskError::value("command", "both", expected));
        }
        if !(self.interval > 0.0 && self.interval.is_finite()) {
            return Err(TaskError::value("command.interval", self.interval, "a time above 0 s"));
        }
        if !(0.0..=1.0).contains(&self.standing) {
            return Err(TaskError::value("command.standing", self.standing, "0 to 1"));
        }
        let Some(Curriculum { start, steps }) = self.curriculum else { return Ok(()) };
        if !(0.0..=1.0).contains(&start) {
            return Err(TaskError::value("command.curriculum.start", start, "0 to 1"));
        }
        if steps == 0 {
            return Err(TaskError::value("command.curriculum.steps", steps, "at least 1"));
        }
        Ok(())
    }

    /// Returns the factor of the ranges after some steps of a training run, 0 to 1.
    pub(super) fn level(&self, steps: u64) -> f64 {
        self.curriculum.map_or(1.0, |curriculum| {
            let share = (steps as f64 / curriculum.steps as f64).min(1.0);
            curriculum.start + (1.0 - curriculum.start) * share
        })
    }

    /// Returns a command: forward, left \[m/s\], turn \[rad/s\], or x, y and z of the target \[m\]. The step
    /// of the counter is the number of the command in its episode. All ranges are scaled by `level`, around 0
    /// for velocities and around the middle for a target.
    pub(super) fn sample(&self, counter: Counter, level: f64) -> [f64; 3] {
        let mut random = counter.stream(Purpose::Command);
        if let Some(target) = self.target {
            return target.map(|[low, high]| {
                let share: f64 = random.random();
                f64::midpoint(low, high) + level * (share - 0.5) * (high - low)
            });
        }
        if random.random::<f64>() < self.standing {
            return [0.0; 3];
        }
        [self.forward, self.left, self.turn].map(|[low, high]| {
            let share: f64 = random.random();
            level * (low + share * (high - low))
        })
    }
}
