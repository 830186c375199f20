//! Steers a wheel into the direction of motion of its base, at acceleration level.

use motorium_robots::{FrameId, Model};
use nalgebra::{Unit, Vector3};

use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};
use crate::tasks::SteeredWheel;

/// Steers a wheel until it rolls along the velocity of its centre, given the rigid motion of the base.
///
/// With the angle `e` of the [velocity task](crate::tasks::RigidRotationTask), the normal `n` of the ground,
/// the yaw rate `W` of the base, and the angular velocity `w` of the wheel and its angular acceleration `w'`
/// without accelerations of the joints,
///
/// ```text
/// A = n' J_w                                      1 x nv, on the accelerations
/// b = kp e + kd (W - n' w) - n' w'                rad/s2; the base keeps its velocity
/// W = weight                                      1/(rad/s2)
/// ```
///
/// The task is inactive for a standing or flat wheel.
///
/// ```
/// use motorium_control::inverse_dynamics::tasks::{Feedback, RigidRotationAcceleration};
/// use motorium_robots::load;
/// use nalgebra::Vector3;
///
/// let panda = load("panda", std::path::Path::new("."))?.model;
/// let (wheel, base) = (panda.frame("panda_hand")?, panda.frame("panda_link0")?);
/// let mut steering =
///     RigidRotationAcceleration::new(&panda, wheel, base, Vector3::y_axis(), Feedback::critical(10.0));
/// steering.set_twist(0.5, 0.0, 0.0); // the base drives along its x
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RigidRotationAcceleration {
    steering: SteeredWheel,
    feedback: Feedback,
    weight: f64,
    cost: Cost,
}

impl RigidRotationAcceleration {
    /// A task for the wheel whose centre is the origin of the frame `wheel`, with its axis in the axes of
    /// that frame, on a base with the frame `base` at rest on level ground; with weight 1.
    pub fn new(
        model: &Model,
        wheel: FrameId,
        base: FrameId,
        axis: Unit<Vector3<f64>>,
        feedback: Feedback,
    ) -> Self {
        let steering = SteeredWheel::new(model, wheel, base, axis);
        Self { steering, feedback, weight: 1.0, cost: Cost::dense(1, 0, model.nv()) }
    }

    /// The same task on ground with another normal, world axes.
    #[must_use]
    pub fn on(mut self, normal: Unit<Vector3<f64>>) -> Self {
        self.steering.set_normal(normal);
        self
    }

    /// Changes feedback and weight \[1/(rad/s2)\] from the next update on.
    pub fn set(&mut self, feedback: Feedback, weight: f64) {
        (self.feedback, self.weight) = (feedback, weight);
    }

    /// Sets the velocity of the base in its own axes: along x and y \[m/s\], and about z \[rad/s\].
    pub fn set_twist(&mut self, x: f64, y: f64, yaw: f64) {
        self.steering.set_twist([x, y, yaw]);
    }

    /// `e` at the last update \[rad\], from -pi/2 to pi/2; 0 while the task is inactive.
    pub fn error(&self) -> f64 {
        self.steering.error()
    }
}

impl AccelerationTask for RigidRotationAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, kinematics, .. } = *state;
        let steers = self.steering.steer(model, kinematics, &mut self.cost);
        let (rate, drift) = self.steering.turning(model, kinematics);
        let Feedback { kp, kd } = self.feedback;
        let damped = kd * (self.steering.yaw_rate() - rate);
        self.cost.desired_mut()[0] = kp * self.steering.error() + damped - drift;
        self.cost.weights_mut()[0] = if steers { self.weight } else { 0.0 };
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
