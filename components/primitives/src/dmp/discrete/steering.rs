//! Changing goal, duration or weights of a running primitive.

use super::{DiscreteDmp, MoveError, REPLANNING_TIME};
use crate::dmp::model::DmpModel;
use crate::dmp::quintic::{Jet, Quintic};

impl DiscreteDmp {
    /// Exchanges the weights for a copy of the weights of `model`, without allocating. `model` must have the
    /// settings and dimensions of the current model. Call this between movements only: during a movement the
    /// forcing term would be discontinuous.
    ///
    /// # Errors
    /// [`MoveError`] if the settings or the number of dimensions differ.
    pub fn exchange(&mut self, model: &DmpModel) -> Result<(), MoveError> {
        if model.settings() != self.model.settings() {
            return Err(MoveError::OtherSettings);
        }
        let (found, expected) = (model.dimensions(), self.model.dimensions());
        if found != expected {
            return Err(MoveError::Dimensions { name: "the other model", found, expected });
        }
        self.model.copy_weights(model);
        Ok(())
    }

    /// Changes the goal during a movement. Position and velocity stay continuous.
    ///
    /// A variant with a quintic goal also keeps the acceleration continuous. Such a variant plans a new
    /// polynomial from the current state to the end of the movement. If less than [`REPLANNING_TIME`] of the
    /// duration remains, the polynomial lasts for that part of the duration, and the end is postponed. In the
    /// other variants the acceleration changes in a step by `K / T^2` times the change of the goal, unless
    /// `goal_rate` filters the goal.
    ///
    /// # Errors
    /// [`MoveError`] if the length is wrong, or a number is not finite.
    pub fn set_goal(&mut self, goal: &[f64]) -> Result<(), MoveError> {
        self.check("goal", goal)?;
        if self.goal == goal {
            return Ok(());
        }
        self.goal.copy_from_slice(goal);
        if self.model.settings().variant.plans_goal() {
            self.attractor.copy_from_slice(goal);
            self.end = self.end.max(self.progress + REPLANNING_TIME);
            for (d, quintic) in self.quintics.iter_mut().enumerate() {
                let from = quintic.sample(self.progress);
                let length = self.end - self.progress;
                *quintic = Quintic::passing(self.progress, length, from, goal[d], self.final_rate[d]);
            }
        } else if self.model.settings().goal_rate.is_none() {
            self.attractor.copy_from_slice(goal);
        }
        self.observe();
        Ok(())
    }

    /// Changes the duration during a movement. The remaining movement is stretched or compressed; position
    /// and velocity stay continuous.
    ///
    /// # Errors
    /// [`MoveError`] if the duration is not positive.
    pub fn set_duration(&mut self, duration: f64) -> Result<(), MoveError> {
        self.check_duration(duration)?;
        let stretch = duration / self.duration;
        self.duration = duration;
        self.spring.iter_mut().for_each(|(_, rate)| *rate *= stretch);
        self.pushed.iter_mut().for_each(|pushed| *pushed *= stretch * stretch);
        self.final_rate.iter_mut().for_each(|rate| *rate *= stretch);
        if self.progress < self.end && self.model.settings().variant.plans_goal() {
            for (d, quintic) in self.quintics.iter_mut().enumerate() {
                let mut from = quintic.sample(self.progress);
                from.rate *= stretch;
                from.acceleration *= stretch * stretch;
                let (length, goal) = (self.end - self.progress, self.attractor[d]);
                *quintic = Quintic::passing(self.progress, length, from, goal, self.final_rate[d]);
            }
        }
        self.observe();
        Ok(())
    }

    /// Changes the coordinates of a running movement: the same motion now has the state `jets`, the goal
    /// `goal` and the start `start`. The deviation from the minimum-jerk part is kept.
    pub(in crate::dmp) fn rebase(&mut self, jets: &[Jet], start: &[f64], goal: &[f64]) {
        self.goal.copy_from_slice(goal);
        self.attractor.copy_from_slice(goal);
        self.start.copy_from_slice(start);
        let duration = self.duration;
        let quintic_goal = self.model.settings().variant.plans_goal();
        self.end = if quintic_goal { self.end.max(self.progress + REPLANNING_TIME) } else { self.end };
        for (d, jet) in jets.iter().enumerate() {
            let (rate, acceleration) = (jet.rate * duration, jet.acceleration * duration * duration);
            if quintic_goal {
                let (x, x_rate) = self.spring[d];
                let x_acceleration = self.model.spring().acceleration(x, x_rate, self.forcing[d]);
                let from = Jet {
                    value: jet.value - x,
                    rate: rate - x_rate,
                    acceleration: acceleration - x_acceleration,
                };
                let length = self.end - self.progress;
                self.quintics[d] = Quintic::passing(self.progress, length, from, goal[d], self.final_rate[d]);
            } else {
                self.spring[d] = (jet.value, rate);
            }
        }
        self.observe();
    }
}
