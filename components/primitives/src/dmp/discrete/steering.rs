//! Another goal or another duration while a primitive runs.

use super::{DiscreteDmp, MoveError, REPLANNING_TIME};
use crate::dmp::model::DmpModel;
use crate::dmp::quintic::{Jet, Quintic};

impl DiscreteDmp {
    /// Takes the weights of another model of the same settings and dimensions, without allocating. Between movements: one
    /// that runs would change its forcing term at once.
    ///
    /// # Errors
    /// Other settings or another number of dimensions.
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

    /// Sets another goal while it runs. Position and velocity stay continuous.
    ///
    /// A variant with a quintic goal keeps the acceleration continuous too: it plans a new polynomial from where the old one
    /// is to the end of the movement, or over [`REPLANNING_TIME`] of the duration if less is left; the end is put off
    /// accordingly. The other variants change the acceleration by `K / T^2` times the change of the goal, unless
    /// `goal_rate` lets the goal slide over.
    ///
    /// # Errors
    /// Wrong length, or numbers that are not finite.
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

    /// Sets another duration while it runs: the rest of the movement is stretched, position and velocity stay continuous.
    ///
    /// # Errors
    /// A duration that is no positive time.
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

    /// Changes the coordinates under a running movement: the same motion now reads `jets`, the goal `goal` and the place
    /// it started from `start`. The deviation from the minimum-jerk part is kept.
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
