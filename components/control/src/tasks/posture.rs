//! The joints keep a posture.

use motorium_robots::Model;
use nalgebra::DVector;

use super::{Rows, Task};
use crate::{RobotState, solver::Problem};

/// Gain and weight of a [`PostureTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PostureSettings {
    /// Rate at which the error decays \[1/s\].
    pub gain: f64,
    /// Cost of a joint velocity error \[1/(rad/s) or 1/(m/s)\].
    pub weight: f64,
}

impl Default for PostureSettings {
    /// Light enough to pull an end effector off its target by less than a micrometre.
    fn default() -> Self {
        Self { gain: 1.0, weight: 1e-3 }
    }
}

/// Moves joint positions `q` to a posture `q*` \[rad or m\]:
///
/// ```text
/// 1/2 |weight S (v - b)|^2,   b = gain (q* - q)
/// ```
///
/// with a diagonal `S` of factors, one per joint; a floating base is not affected. In a weighted sum it
/// determines the directions that other tasks leave free. Where they conflict the result is a compromise: at
/// rest a Cartesian task of weight `w` and gain `g` keeps an error of about `(weight^2 gain) / (w^2 g)` times
/// the posture's own.
#[derive(Clone, Debug)]
pub struct PostureTask {
    settings: PostureSettings,
    target: DVector<f64>,
    shares: DVector<f64>,
    error: DVector<f64>,
    /// Index of the first joint's unknown, after the unknowns of a floating base.
    first: usize,
}

impl PostureTask {
    /// A task for all joints of `model`, with default settings.
    ///
    /// # Panics
    /// If `target` has not one entry per independent joint.
    pub fn new(model: &Model, target: &[f64]) -> Self {
        let joints = model.joint_count();
        assert_eq!(target.len(), joints, "length of the posture");
        Self {
            settings: PostureSettings::default(),
            target: DVector::from_column_slice(target),
            shares: DVector::repeat(joints, 1.0),
            error: DVector::zeros(joints),
            first: model.nv() - joints,
        }
    }

    /// The same task with these settings.
    #[must_use]
    pub fn with(mut self, settings: PostureSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Changes gain and weight from the next update on.
    pub fn set_settings(&mut self, settings: PostureSettings) {
        self.settings = settings;
    }

    /// Gain and weight.
    pub fn settings(&self) -> &PostureSettings {
        &self.settings
    }

    /// Sets the posture `q*`.
    ///
    /// # Panics
    /// If `target` has not one entry per independent joint.
    pub fn set_target(&mut self, target: &[f64]) {
        self.target.copy_from_slice(target);
    }

    /// Sets the weight factor of one joint; zero removes it.
    ///
    /// # Panics
    /// If the joint does not exist.
    pub fn set_share(&mut self, joint: usize, share: f64) {
        self.shares[joint] = share;
    }

    /// The posture `q*`.
    pub fn target(&self) -> &[f64] {
        self.target.as_slice()
    }

    /// `q* - q` at the last update.
    pub fn error(&self) -> &[f64] {
        self.error.as_slice()
    }
}

impl Task for PostureTask {
    fn rows(&self) -> usize {
        self.shares.len()
    }

    fn update(&mut self, state: &RobotState<'_>) {
        for (error, (target, q)) in
            self.error.iter_mut().zip(self.target.iter().zip(state.model.joints_of_q(state.q)))
        {
            *error = target - q;
        }
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        let counted = (0..self.error.len()).filter(|joint| self.settings.weight * self.shares[*joint] != 0.0);
        let of_joint = |joint: usize| velocity[self.first + joint] - self.settings.gain * self.error[joint];
        counted.map(|joint| of_joint(joint).powi(2)).sum::<f64>().sqrt()
    }

    fn add_to(&self, problem: &mut Problem) {
        for (joint, error) in self.error.iter().enumerate() {
            let weight = self.settings.weight * self.shares[joint];
            let variable = self.first + joint;
            problem.hessian[(variable, variable)] += weight * weight;
            problem.gradient[variable] -= weight * weight * self.settings.gain * error;
        }
    }

    fn write_rows(&self, rows: &mut Rows) {
        for (joint, share) in self.shares.iter().enumerate() {
            let weight = self.settings.weight * share;
            rows.push(weight * self.settings.gain * self.error[joint])[self.first + joint] = weight;
        }
    }
}
