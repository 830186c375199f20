//! A frame follows a pose, by its acceleration.

use motorium_robots::{FrameId, Model, Reference, Twist};
use nalgebra::{Isometry3, Matrix3, Vector3};

use super::impedance::{CartesianImpedance, Mobility};
use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};
use crate::tasks::AxisShares;

/// Weights and largest speeds of a [`CartesianAcceleration`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartesianWeights {
    /// Cost of an acceleration error \[1/(m/s2)\]; 0 leaves the position free. Default 1.
    pub position: f64,
    /// Cost of an angular acceleration error \[1/(rad/s2)\]; 0 leaves the orientation free. Default 0.5.
    pub orientation: f64,
    /// Largest speed at which an error is corrected \[m/s\]. Default infinite.
    pub max_linear_speed: f64,
    /// Largest angular speed at which an error is corrected \[rad/s\]. Default infinite.
    pub max_angular_speed: f64,
    /// Factors of the weights by axis. Default: none, the whole pose counts.
    pub shares: Option<AxisShares>,
}

impl Default for CartesianWeights {
    fn default() -> Self {
        let (max_linear_speed, max_angular_speed) = (f64::INFINITY, f64::INFINITY);
        Self { position: 1.0, orientation: 0.5, max_linear_speed, max_angular_speed, shares: None }
    }
}

/// Moves a frame to a target pose: its position, its orientation, or both.
///
/// All quantities are in world axes at the origin of the frame. With the orientations `R` of the frame and
/// `R*` of the target,
///
/// ```text
/// e = (p* - p, log(R* R'))                   m, rad
/// A = J                                      Jacobian of the frame, world axes, 6 x nv, on the accelerations
/// b = nu*' + kd (nu* - nu) + kp e - J' v     J' v: classical drift, the acceleration of the frame at a = 0
/// W = diag(p, p, p, o, o, o)
/// ```
///
/// (OpenSoT's and TSID's task). For the error near zero the closed loop is `e'' = -kd e' - kp e`. `kp e` is
/// limited so that the error is corrected no faster than the maximum speeds.
///
/// With [`shares`](CartesianWeights::shares) the error of the controlled directions is expressed in their
/// axes, which may rotate with the angular velocity `u`. With the error `p` of the position in the axes of
/// the world, its rate `p'`, and `S` and `R` of [`AxisShares`],
///
/// ```text
/// A_p = S R'(J_v - [p]x J_w)                      the term of p for the axes of the frame alone
/// b_p = S (R'(v*' - J_v' v - u' x p - 2 u x p' + u x (u x p)) + kd R'(p' - u x p) + kp e_p)
/// A_o, b_o: as above, by S R'
/// ```
#[derive(Clone, Debug)]
pub struct CartesianAcceleration {
    frame: FrameId,
    feedback: Feedback,
    impedance: Option<CartesianImpedance>,
    mobility: Mobility,
    weights: CartesianWeights,
    target: Isometry3<f64>,
    velocity: Twist,
    acceleration: Twist,
    error: (Vector3<f64>, Vector3<f64>),
    cost: Cost,
}

impl CartesianAcceleration {
    /// A task for `frame` of `model`, with the world's origin as target and default weights.
    pub fn new(model: &Model, frame: FrameId, feedback: Feedback) -> Self {
        Self {
            frame,
            feedback,
            impedance: None,
            mobility: Mobility::new(model),
            weights: CartesianWeights::default(),
            target: Isometry3::identity(),
            velocity: Twist::zero(),
            acceleration: Twist::zero(),
            error: (Vector3::zeros(), Vector3::zeros()),
            cost: Cost::dense(6, 0, model.nv()),
        }
    }

    /// The same task with these weights.
    #[must_use]
    pub fn with(mut self, weights: CartesianWeights) -> Self {
        self.weights = weights;
        self
    }

    /// The same task with a spring and a damper in place of the feedback.
    #[must_use]
    pub fn impedance(mut self, impedance: CartesianImpedance) -> Self {
        self.set_impedance(impedance);
        self
    }

    /// Replaces the feedback by this spring and damper from the next update.
    pub fn set_impedance(&mut self, impedance: CartesianImpedance) {
        self.impedance = Some(impedance);
    }

    /// Returns the acceleration towards the target for an error and its rate, in axes rotated to the world by
    /// `to_world`. The cost contains the Jacobian of the frame.
    fn response(
        &mut self,
        dynamics: &InverseDynamics,
        (error, turn): (&Vector3<f64>, &Vector3<f64>),
        (rate, turn_rate): (&Vector3<f64>, &Vector3<f64>),
        to_world: &Matrix3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let CartesianWeights { max_linear_speed, max_angular_speed, .. } = self.weights;
        let [place, rotation] = self.impedance.map_or([self.feedback; 2], |impedance| impedance.feedback());
        let linear = to_world * place.acceleration(error, rate, max_linear_speed);
        let angular = to_world * rotation.acceleration(turn, turn_rate, max_angular_speed);
        match self.impedance {
            None => (linear, angular),
            Some(_) => self.mobility.of_frame(dynamics, self.cost.matrix(), &linear, &angular),
        }
    }

    /// Changes feedback and weights from the next update on.
    pub fn set(&mut self, feedback: Feedback, weights: CartesianWeights) {
        (self.feedback, self.weights) = (feedback, weights);
    }

    /// Sets the target pose in the world, at rest.
    pub fn set_target(&mut self, target: Isometry3<f64>) {
        self.set_moving_target(target, Twist::zero(), Twist::zero());
    }

    /// Sets the target pose, its velocity and its classical acceleration, of the origin of the target, in
    /// world axes.
    pub fn set_moving_target(&mut self, target: Isometry3<f64>, velocity: Twist, acceleration: Twist) {
        (self.target, self.velocity, self.acceleration) = (target, velocity, acceleration);
    }

    /// The target pose.
    pub fn target(&self) -> &Isometry3<f64> {
        &self.target
    }

    /// The frame.
    pub fn frame(&self) -> FrameId {
        self.frame
    }

    /// Weights and largest speeds.
    pub fn weights(&self) -> &CartesianWeights {
        &self.weights
    }

    /// `e` at the last update: position \[m\] and orientation \[rad\], world axes.
    pub fn error(&self) -> (&Vector3<f64>, &Vector3<f64>) {
        (&self.error.0, &self.error.1)
    }
}

impl CartesianAcceleration {
    /// Computes error, `A` and `b` of the controlled directions. The cost contains the Jacobian of the frame.
    fn update_axes(
        &mut self,
        dynamics: &InverseDynamics,
        pose: &Isometry3<f64>,
        (moving, drift): (&Twist, &Twist),
        shares: &AxisShares,
    ) {
        self.error = shares.error(pose, &self.target);
        let from_world = shares.world_to_axes(pose, &self.target);
        let place = self.target.translation.vector - pose.translation.vector;
        let rate = self.velocity.linear - moving.linear;
        let spin = shares.turning(moving.angular, self.velocity.angular);
        let spin_rate = shares.turning(drift.angular, self.acceleration.angular);
        let linear =
            self.acceleration.linear - drift.linear - spin_rate.cross(&place) - spin.cross(&rate) * 2.0
                + spin.cross(&spin.cross(&place));
        let angular = self.acceleration.angular - drift.angular;
        let seen_rate = from_world * (rate - spin.cross(&place));
        let turn_rate = from_world * (self.velocity.angular - moving.angular);
        let (error, turn) = self.error;
        let (towards, turning) =
            self.response(dynamics, (&error, &turn), (&seen_rate, &turn_rate), &from_world.transpose());
        let (linear, angular) = (from_world * (linear + towards), from_world * (angular + turning));
        self.cost.desired_mut().copy_from(&shares.weigh(&linear, &angular));
        let follow_frame = shares.follow_frame();
        for mut column in self.cost.matrix_mut().column_iter_mut() {
            let (mut v, w) = (column.fixed_rows::<3>(0).into_owned(), column.fixed_rows::<3>(3).into_owned());
            if follow_frame {
                v -= place.cross(&w);
            }
            column.copy_from(&shares.weigh(&(from_world * v), &(from_world * w)));
        }
        self.cost.weights_mut().component_mul_assign(&shares.rows());
    }
}

impl AccelerationTask for CartesianAcceleration {
    fn update(&mut self, state: &MotionState<'_>, dynamics: &InverseDynamics) {
        let MotionState { model, kinematics, .. } = *state;
        let pose = kinematics.pose(model, self.frame);
        let moving = kinematics.velocity(model, self.frame);
        let drift = kinematics.acceleration(model, self.frame);
        let weights = self.weights;
        let (position, orientation) = (weights.position, weights.orientation);
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(position);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(orientation);
        kinematics.jacobian(model, self.frame, Reference::LocalWorldAligned, self.cost.matrix_mut());
        if let Some(shares) = &weights.shares {
            self.update_axes(dynamics, &pose, (&moving, &drift), shares);
            return;
        }
        let position = self.target.translation.vector - pose.translation.vector;
        let turn = (self.target.rotation * pose.rotation.inverse()).scaled_axis();
        self.error = (position, turn);
        let rates = (self.velocity.linear - moving.linear, self.velocity.angular - moving.angular);
        let errors = (&position, &turn);
        let (linear, angular) = self.response(dynamics, errors, (&rates.0, &rates.1), &Matrix3::identity());
        let linear = linear + self.acceleration.linear - drift.linear;
        let angular = angular + self.acceleration.angular - drift.angular;
        let desired = self.cost.desired_mut();
        desired.fixed_rows_mut::<3>(0).copy_from(&linear);
        desired.fixed_rows_mut::<3>(3).copy_from(&angular);
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
