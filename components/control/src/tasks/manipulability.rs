//! The joints move to where a frame is moved more easily, or exerts forces more easily.

use motorium_robots::{FrameId, Model, TaskRows};
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Cost, Equation, RATE, Response, Task, differentiate_velocities};
use crate::{MotionState, RobotState};

/// The measure that a [`ManipulabilityTask`] increases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Velocities: `sqrt(det(J J'))`, the volume of the ellipsoid of the velocities that joint velocities of
    /// length 1 give the frame.
    #[default]
    Velocity,
    /// Forces: `sqrt(det((J J')^-1))`, the volume of the ellipsoid of the forces that joint torques of length
    /// 1 exert there.
    Force,
}

/// Moves the joints along the gradient of a manipulability `m` of a frame:
///
/// ```text
/// m = sqrt(det(J J'))                             Yoshikawa's measure of the rows that count: of velocities
/// m = sqrt(det((J J')^-1))                        or of forces, its reciprocal
/// J = 1 on all velocities,   nu = gain dm/dq      no longer than the largest speed
/// W = weight                                      1/(rad/s)
/// ```
///
/// (OpenSoT's task, and PyRoboLearn's task of force manipulability.) Velocity manipulability moves the robot
/// away from singular configurations. Force manipulability moves it towards them, where the gradient is
/// unbounded and the maximum speed applies. In a singular configuration there is no gradient, and the task
/// commands zero velocity. A floating base does not change the measure and is commanded to rest.
/// Accelerations reduce an error of a velocity at the [`rate`](Self::rate).
#[derive(Clone, Debug)]
pub struct ManipulabilityTask {
    frame: FrameId,
    rows: TaskRows,
    of: Measure,
    gain: f64,
    weight: f64,
    max_speed: f64,
    measure: f64,
    equation: Equation,
}

impl ManipulabilityTask {
    /// A task for `frame` of `model` and these rows of its velocity, with gain 1 and weight 1e-2.
    pub fn new(model: &Model, frame: FrameId, rows: TaskRows) -> Self {
        let (of, mut equation) = (Measure::Velocity, Equation::identity(0, model.nv()));
        equation.response = Response::velocity(RATE);
        Self { frame, rows, of, gain: 1.0, weight: 1e-2, max_speed: f64::INFINITY, measure: 0.0, equation }
    }

    /// The same task for the manipulability of forces.
    ///
    /// ```
    /// use motorium_control::{RobotState, tasks::{ManipulabilityTask, VelocityTask}};
    /// use motorium_robots::{Kinematics, TaskRows, load};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, home.as_slice());
    /// let hand = model.frame("panda_hand_tcp")?;
    /// let mut force = ManipulabilityTask::new(model, hand, TaskRows::POSITION).of_forces();
    /// force.update(&RobotState { model, kinematics: &kinematics, q: home.as_slice() });
    /// let velocity = kinematics.manipulability(model, hand, TaskRows::POSITION);
    /// assert!((force.measure() * velocity - 1.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn of_forces(self) -> Self {
        self.with_measure(Measure::Force)
    }

    /// The same task for this measure.
    #[must_use]
    pub fn with_measure(mut self, measure: Measure) -> Self {
        self.of = measure;
        self
    }

    /// The same task with a gain \[(rad/s)^2 per unit of the measure\] and a weight \[1/(rad/s)\].
    #[must_use]
    pub fn with(mut self, gain: f64, weight: f64) -> Self {
        self.set(gain, weight);
        self
    }

    /// The same task with a rate \[1/s\] at which accelerations reduce an error of a joint velocity.
    #[must_use]
    pub fn rate(mut self, rate: f64) -> Self {
        self.equation.response = Response::velocity(rate);
        self
    }

    /// Changes gain and weight from the next update on.
    pub fn set(&mut self, gain: f64, weight: f64) {
        (self.gain, self.weight) = (gain, weight);
    }

    /// The same task with a largest length of `nu` \[rad/s\].
    #[must_use]
    pub fn max_speed(mut self, speed: f64) -> Self {
        self.max_speed = speed;
        self
    }

    /// The manipulability at the last update: of forces infinite in a singular configuration.
    pub fn measure(&self) -> f64 {
        self.measure
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        self.equation.cost()
    }
}

impl Task for ManipulabilityTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let slope = self.equation.rate.as_mut_slice();
        let velocity = state.kinematics.manipulability_gradient(state.model, self.frame, self.rows, slope);
        let (measure, factor) = match self.of {
            Measure::Velocity => (velocity, 1.0),
            // d(1/m) = -dm / m^2
            Measure::Force => (velocity.recip(), -velocity.powi(-2)),
        };
        self.measure = measure;
        let length = slope.iter().map(|slope| slope * slope).sum::<f64>().sqrt();
        let most = self.max_speed / length;
        let factor = (self.gain * factor).clamp(-most, most);
        let usable = length > 0.0 && factor.is_finite();
        slope.iter_mut().for_each(|slope| *slope = if usable { *slope * factor } else { 0.0 });
        self.equation.weights_mut().fill(self.weight);
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        differentiate_velocities(&mut self.equation, state);
    }

    equation!();
}
