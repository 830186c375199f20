//! The joints keep a posture.

use motorium_robots::Model;
use nalgebra::DVector;

use super::{Cost, Equation, Feedback, Response, Task};
use crate::{MotionState, RobotState};

/// Gain and weight of a [`PostureTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PostureSettings {
    /// Rate at which the error decays \[1/s\].
    pub gain: f64,
    /// Cost of a joint velocity error \[1/(rad/s) or 1/(m/s)\], or of an acceleration error \[1/(rad/s2) or
    /// 1/(m/s2)\].
    pub weight: f64,
}

impl Default for PostureSettings {
    /// Light enough to pull an end effector off its target by less than a micrometre.
    fn default() -> Self {
        Self { gain: 1.0, weight: 1e-3 }
    }
}

impl PostureSettings {
    fn response(&self) -> Response {
        Response::decay(self.gain)
    }
}

/// Moves joint positions `q` to a posture `q*` \[rad or m\], which may move:
///
/// ```text
/// e = q* - q,   nu = q*',   J = S                 the velocities of the independent joints
/// W = weight diag(shares)
/// ```
///
/// A floating base is not affected. In a weighted sum the task determines the directions that other tasks
/// leave free. Where they conflict the result is a compromise: at rest a Cartesian task of weight `w` and
/// gain `g` keeps an error of about `(weight^2 gain) / (w^2 g)` times the posture's own.
///
/// With an [impedance](Self::impedance) the joints accelerate as springs and dampers would move a robot
/// without contacts: `M^-1 (K (q* - q) + D (q*' - q'))` instead of `kp (q* - q) + kd (q*' - q')`.
#[derive(Clone, Debug)]
pub struct PostureTask {
    settings: PostureSettings,
    target: DVector<f64>,
    shares: DVector<f64>,
    equation: Equation,
}

settings!(PostureTask, PostureSettings);
weight!(PostureTask);

impl PostureTask {
    /// A task for all joints of `model`, with default settings.
    ///
    /// # Panics
    /// If `target` has not one entry per independent joint.
    pub fn new(model: &Model, target: &[f64]) -> Self {
        let joints = model.joint_count();
        assert_eq!(target.len(), joints, "length of the posture");
        let settings = PostureSettings::default();
        let mut equation = Equation::identity(model.nv() - joints, joints);
        equation.response = settings.response();
        Self {
            settings,
            target: DVector::from_column_slice(target),
            shares: DVector::repeat(joints, 1.0),
            equation,
        }
    }

    /// The same task with springs and dampers in place of the feedback of accelerations: a stiffness \[N
    /// m/rad or N/m\] and a damping \[N m s/rad or N s/m\] for each independent joint.
    ///
    /// # Panics
    /// If one of them has not one entry per independent joint.
    #[must_use]
    pub fn impedance(mut self, model: &Model, stiffness: &[f64], damping: &[f64]) -> Self {
        self.equation.set_impedance(model, stiffness, damping);
        self
    }

    /// Sets the posture `q*`, at rest.
    ///
    /// # Panics
    /// If `target` has not one entry per independent joint.
    pub fn set_target(&mut self, target: &[f64]) {
        self.target.copy_from_slice(target);
        self.equation.rate.fill(0.0);
        self.equation.rate_derivative.fill(0.0);
    }

    /// Sets the posture, its velocity and its acceleration.
    ///
    /// # Panics
    /// If one of them has not one entry per independent joint.
    pub fn set_moving_target(&mut self, target: &[f64], velocity: &[f64], acceleration: &[f64]) {
        self.target.copy_from_slice(target);
        self.equation.rate.copy_from_slice(velocity);
        self.equation.rate_derivative.copy_from_slice(acceleration);
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
        self.equation.error.as_slice()
    }
}

impl Task for PostureTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let q = state.model.joints_of_q(state.q);
        for (error, (target, q)) in self.equation.error.iter_mut().zip(self.target.iter().zip(q)) {
            *error = target - q;
        }
        for (weight, share) in self.equation.weights_mut().iter_mut().zip(&self.shares) {
            *weight = self.settings.weight * share;
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let Equation { rate, error_rate, .. } = &mut self.equation;
        for (error_rate, (rate, v)) in
            error_rate.iter_mut().zip(rate.iter().zip(state.model.joints_of_v(state.v)))
        {
            *error_rate = rate - v;
        }
    }

    equation!();
}
