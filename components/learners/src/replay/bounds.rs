//! Continuous actions between -1 and 1.

use rand::RngExt as _;

use super::Exploration;
use crate::learner::{Algorithm, Head};
use crate::task::{TaskError, Terms};

/// Maps actions between -1 and 1 to the bounds of a task's action. Numbers that move no joint stay in the
/// middle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) active: Vec<bool>,
    scale: Vec<f32>,
    offset: Vec<f32>,
}

impl Bounds {
    /// The bounds of a task with continuous actions.
    pub(crate) fn new(terms: &Terms, algorithm: Algorithm) -> Result<Self, TaskError> {
        if let Some(choices) = terms.choices() {
            let expected =
                format!("no choices for `{}`; help: train with dqn, ppo, a2c or reinforce", algorithm.name());
            return Err(TaskError::value("action.choices", format!("{} rows", choices.count()), expected));
        }
        let Some([low, high]) = terms.policy().action.bounds() else {
            return Err(TaskError::Value {
                key: "action.clip".to_owned(),
                found: "none".to_owned(),
                expected: "bounds of the action, which off-policy algorithms explore".to_owned(),
            });
        };
        let active = terms.active_actions();
        let half = (0.5 * (high - low)) as f32;
        let scale = active.iter().map(|active| if *active { half } else { 0.0 }).collect();
        let offset = vec![(0.5 * (high + low)) as f32; active.len()];
        Ok(Self { active, scale, offset })
    }

    /// Returns the length of an action.
    pub(crate) fn width(&self) -> usize {
        self.active.len()
    }

    /// Returns the count of numbers that move a joint.
    pub(crate) fn moving(&self) -> usize {
        self.active.iter().filter(|active| **active).count()
    }

    /// Writes uniformly distributed actions, one world after the other.
    pub(crate) fn act_randomly(&self, exploration: Exploration, out: &mut [f32]) {
        for (world, action) in out.chunks_exact_mut(self.width()).enumerate() {
            let mut random = exploration.random(world);
            for (number, active) in action.iter_mut().zip(&self.active) {
                let share: f32 = random.random();
                *number = if *active { 2.0 * share - 1.0 } else { 0.0 };
            }
        }
    }

    /// Maps an action between -1 and 1 to the bounds.
    pub(crate) fn command(&self, stored: &[f32], action: &mut [f32]) {
        for (((action, stored), scale), offset) in
            action.iter_mut().zip(stored).zip(&self.scale).zip(&self.offset)
        {
            *action = offset + scale * stored;
        }
    }

    /// Returns the map as the head of a network, after `tanh`.
    pub(crate) fn head(&self) -> Head {
        Head::Squashed { scale: self.scale.clone(), offset: self.offset.clone() }
    }
}
