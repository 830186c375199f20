//! A frame reaches a pose relative to another frame, by its acceleration.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Isometry3, Matrix6xX, Vector3};

use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};

/// Moves a frame `b` to a pose `t` relative to a frame `a` of the same robot, such as one hand relative to
/// the other.
///
/// All quantities are in the axes of `a`. With `d = p_b - p_a`, the velocities `v`, `w` of both frames and
/// their accelerations `v'`, `w'`,
///
/// ```text
/// e = (p* - R_a' d, log(R* R_ab'))                                 m, rad
/// s = R_a' (v_b - v_a - w_a x d, w_b - w_a)                        velocity of b as seen from a
/// A = R_a' (J_v,b - J_v,a + [d]x J_w,a; J_w,b - J_w,a)             6 x nv, on the accelerations
/// b = kp e - kd s - s'|(a = 0)
/// W = diag(p, p, p, o, o, o)
///
/// s' = R_a' (v_b' - v_a' - w_a' x d - w_a x (w_a x d) - 2 w_a x (v_b - v_a - w_a x d),
///            w_b' - w_a' - w_a x w_b)
/// ```
///
/// (the [relative task](crate::tasks::RelativeTask) of velocities at the level of accelerations). The motion
/// of a floating base cancels.
///
/// ```
/// use motorium_control::inverse_dynamics::tasks::{Feedback, RelativeAcceleration};
/// use motorium_robots::load;
/// use nalgebra::Isometry3;
///
/// let humanoid = load("humanoid", std::path::Path::new("."))?.model;
/// let (left, right) = (humanoid.frame("left_palm")?, humanoid.frame("right_palm")?);
/// let mut hands = RelativeAcceleration::new(&humanoid, left, right, Feedback::critical(10.0)).weights(1.0, 0.0);
/// hands.set_target(Isometry3::translation(0.0, -0.3, 0.0)); // 30 cm to the right of the left palm
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RelativeAcceleration {
    /// The frames `a` and `b`.
    frames: (FrameId, FrameId),
    feedback: Feedback,
    /// Of position and orientation.
    weights: (f64, f64),
    target: Isometry3<f64>,
    error: (Vector3<f64>, Vector3<f64>),
    other: Matrix6xX<f64>,
    own: Matrix6xX<f64>,
    cost: Cost,
}

impl RelativeAcceleration {
    /// A task for the frame `b` relative to `a`, with the frame `a` as target and the weights 1 \[1/(m/s2)\]
    /// and 0.5 \[1/(rad/s2)\].
    pub fn new(model: &Model, a: FrameId, b: FrameId, feedback: Feedback) -> Self {
        Self {
            frames: (a, b),
            feedback,
            weights: (1.0, 0.5),
            target: Isometry3::identity(),
            error: (Vector3::zeros(), Vector3::zeros()),
            other: Matrix6xX::zeros(model.nv()),
            own: Matrix6xX::zeros(model.nv()),
            cost: Cost::dense(6, 0, model.nv()),
        }
    }

    /// The same task with weights of position \[1/(m/s2)\] and orientation \[1/(rad/s2)\].
    #[must_use]
    pub fn weights(mut self, position: f64, orientation: f64) -> Self {
        self.weights = (position, orientation);
        self
    }

    /// Changes feedback and weights from the next update on.
    pub fn set(&mut self, feedback: Feedback, position: f64, orientation: f64) {
        (self.feedback, self.weights) = (feedback, (position, orientation));
    }

    /// The frames `a` and `b`.
    pub fn frames(&self) -> (FrameId, FrameId) {
        self.frames
    }

    /// Pose of `b` in the frame `a` that is aimed at.
    pub fn target(&self) -> &Isometry3<f64> {
        &self.target
    }

    /// Sets the pose of `b` in the frame `a`, at rest.
    pub fn set_target(&mut self, target: Isometry3<f64>) {
        self.target = target;
    }

    /// `e` at the last update: position \[m\] and orientation \[rad\], axes of `a`.
    pub fn error(&self) -> (&Vector3<f64>, &Vector3<f64>) {
        (&self.error.0, &self.error.1)
    }
}

impl AccelerationTask for RelativeAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, kinematics, .. } = *state;
        let (a, b) = self.frames;
        let [pose_a, pose_b] = [a, b].map(|frame| kinematics.pose(model, frame));
        let [at_a, at_b] = [a, b].map(|frame| kinematics.velocity(model, frame));
        let [drift_a, drift_b] = [a, b].map(|frame| kinematics.acceleration(model, frame));
        let axes = pose_a.rotation.inverse();
        let (d, w) = (pose_b.translation.vector - pose_a.translation.vector, at_a.angular);
        let seen = at_b.linear - at_a.linear - w.cross(&d);
        let linear = drift_b.linear
            - drift_a.linear
            - drift_a.angular.cross(&d)
            - w.cross(&w.cross(&d))
            - w.cross(&seen) * 2.0;
        let angular = drift_b.angular - drift_a.angular - w.cross(&at_b.angular);
        let turn = self.target.rotation * (axes * pose_b.rotation).inverse();
        self.error = (self.target.translation.vector - axes * d, turn.scaled_axis());
        let wanted = |error: &Vector3<f64>, rate: Vector3<f64>, drift: Vector3<f64>| {
            self.feedback.acceleration(error, &-(axes * rate), f64::INFINITY) - axes * drift
        };
        let linear = wanted(&self.error.0, seen, linear);
        let angular = wanted(&self.error.1, at_b.angular - w, angular);
        let desired = self.cost.desired_mut();
        desired.fixed_rows_mut::<3>(0).copy_from(&linear);
        desired.fixed_rows_mut::<3>(3).copy_from(&angular);
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(self.weights.0);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(self.weights.1);
        kinematics.jacobian(model, a, Reference::LocalWorldAligned, &mut self.other);
        kinematics.jacobian(model, b, Reference::LocalWorldAligned, &mut self.own);
        for ((mut column, own), other) in
            self.cost.matrix_mut().column_iter_mut().zip(self.own.column_iter()).zip(self.other.column_iter())
        {
            let (own_linear, own_angular) = (own.fixed_rows::<3>(0), own.fixed_rows::<3>(3));
            let (linear, angular) = (other.fixed_rows::<3>(0), other.fixed_rows::<3>(3));
            column.fixed_rows_mut::<3>(0).copy_from(&(axes * (own_linear - linear + d.cross(&angular))));
            column.fixed_rows_mut::<3>(3).copy_from(&(axes * (own_angular - angular)));
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
