//! A frame reaches a pose.

use motorium_robots::{
    FrameId, Model, Reference, Twist,
    lie::{se3, so3},
};
use nalgebra::{Isometry3, Matrix3, Matrix6xX, Vector3, Vector6};

use super::{AxisShares, PoseAxes, Rows, VelocityTask};
use crate::{RobotState, solver::Problem};

/// Gains and weights of a [`CartesianTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartesianSettings {
    /// Rate at which the error decays \[1/s\]. Useful below a tenth of the tick rate.
    pub gain: f64,
    /// Cost of a velocity error \[1/(m/s)\].
    pub position_weight: f64,
    /// Cost of an angular velocity error \[1/(rad/s)\].
    pub orientation_weight: f64,
    /// Largest speed at which the error is corrected \[m/s\].
    pub max_linear_speed: f64,
    /// Largest angular speed at which the error is corrected \[rad/s\].
    pub max_angular_speed: f64,
    /// Levenberg-Marquardt damping per speed of correction \[s m/rad^2\]: keeps the robot calm where the
    /// target is out of reach, and vanishes at the target. Should exceed half the tick period times the reach
    /// of the robot.
    pub damping: f64,
    /// Factors of the weights by axis. Default: none, the whole pose counts.
    pub shares: Option<AxisShares>,
}

impl Default for CartesianSettings {
    fn default() -> Self {
        Self {
            gain: 10.0,
            position_weight: 1.0,
            orientation_weight: 0.5,
            max_linear_speed: f64::INFINITY,
            max_angular_speed: f64::INFINITY,
            damping: 5e-3,
            shares: None,
        }
    }
}

/// A frame `b` of the robot follows a target pose `t`.
///
/// With `T_bt` the pose of the target in the frame, the error is the twist that would carry the frame onto
/// the target in one unit of time, linear \[m\] then angular \[rad\], in the axes of the frame:
///
/// ```text
/// e  = log(T_bt)
/// e' = Jlog(T_bt) nu_t - Jlog(T_tb) J_b v
/// ```
///
/// where `J_b` is the Jacobian of the frame in its own axes, `nu_t` the velocity of the target in the
/// target's axes, and `Jlog` the derivative of the logarithm. Requesting the decay `e' = -c`, `c = gain e`,
/// gives the cost
///
/// ```text
/// 1/2 |W (A v - b)|^2 + 1/2 mu |v|^2
/// A = Jlog(T_tb) J_b,   b = c + Jlog(T_bt) nu_t,   mu = damping |W^2 c|
/// ```
///
/// (the error and Jacobian of Pink's frame task, there per step and for a target at rest). `c` is scaled down
/// as a whole where it would exceed the largest speeds, so that the direction is kept.
///
/// With [`shares`](CartesianSettings::shares) position and rotation are separate, so that one may be free
/// without affecting the other. [`AxisShares`] defines `e`; with the velocities `v*`, `w*` of the target, in
/// the axes `R` of the shares,
///
/// ```text
/// A = S (R'J_v - [e_p]x R'J_w;  J(e_o) J_w)        the term of e_p for the axes of the frame alone
/// b = S (c + (R'v* - w* x e_p;  J(-e_o) w*))       the term of e_p for the axes of the target alone
/// ```
///
/// where `J(e_o) J_w` is the derivative of the rotation vector by the motion of the frame, and `mu = damping
/// |S'W^2 S c|`.
///
/// The damping follows the error, not its square: an error that no motion can reduce bends the cost by about
/// `|W^2 c|` times the reach of the robot, which a step of `dt` must not overshoot. With less damping than
/// `dt reach / 2` a stretched arm chatters between its velocity limits, however slow the correction.
#[derive(Clone, Debug)]
pub struct CartesianTask {
    frame: FrameId,
    settings: CartesianSettings,
    target: Isometry3<f64>,
    feed_forward: Twist,
    error: Vector6<f64>,
    position_error: f64,
    orientation_error: f64,
    /// Correction of the error in terms of the rows: `c`, or `S'S c`.
    pull: Vector6<f64>,
    desired: Vector6<f64>,
    jacobian: Matrix6xX<f64>,
}

impl CartesianTask {
    /// A task for `frame` of `model`, with the world's origin as target and default settings.
    pub fn new(model: &Model, frame: FrameId) -> Self {
        Self {
            frame,
            settings: CartesianSettings::default(),
            target: Isometry3::identity(),
            feed_forward: Twist::zero(),
            error: Vector6::zeros(),
            position_error: 0.0,
            orientation_error: 0.0,
            pull: Vector6::zeros(),
            desired: Vector6::zeros(),
            jacobian: Matrix6xX::zeros(model.nv()),
        }
    }

    /// The same task with these settings.
    #[must_use]
    pub fn with(mut self, settings: CartesianSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Changes gains and weights from the next update on.
    pub fn set_settings(&mut self, settings: CartesianSettings) {
        self.settings = settings;
    }

    /// Gains and weights.
    pub fn settings(&self) -> &CartesianSettings {
        &self.settings
    }

    /// Sets the target pose in the world, at rest.
    pub fn set_target(&mut self, target: Isometry3<f64>) {
        self.set_moving_target(target, Twist::zero());
    }

    /// Sets the target pose in the world and its velocity: of the target's origin \[m/s\] and angular
    /// \[rad/s\], in world axes.
    pub fn set_moving_target(&mut self, target: Isometry3<f64>, velocity: Twist) {
        self.target = target;
        self.feed_forward = velocity;
    }

    /// The frame that is controlled.
    pub fn frame(&self) -> FrameId {
        self.frame
    }

    /// Target pose in the world.
    pub fn target(&self) -> &Isometry3<f64> {
        &self.target
    }

    /// `e` at the last update: linear \[m\], angular \[rad\], in the axes of the frame, or of the shares
    /// without free directions.
    pub fn error(&self) -> &Vector6<f64> {
        &self.error
    }

    /// Distance between the origins of frame and target at the last update \[m\].
    pub fn position_error(&self) -> f64 {
        self.position_error
    }

    /// Angle between frame and target at the last update \[rad\], in `[0, pi]`.
    pub fn orientation_error(&self) -> f64 {
        self.orientation_error
    }

    /// `A` at the last update, 6 x nv. The error changes at the rate `-A v` for a target at rest; with
    /// shares, `S e` does.
    pub fn jacobian(&self) -> &Matrix6xX<f64> {
        &self.jacobian
    }

    /// `b` at the last update: linear \[m/s\], angular \[rad/s\].
    pub fn desired(&self) -> &Vector6<f64> {
        &self.desired
    }

    fn weights(&self) -> Vector6<f64> {
        let (p, o) = (self.settings.position_weight, self.settings.orientation_weight);
        let weights = Vector6::new(p, p, p, o, o, o);
        // a row without a factor is ignored
        self.settings.shares.map_or(weights, |shares| weights.component_mul(&shares.rows()))
    }

    /// Error, `A` and `b` of the whole pose.
    fn update_pose(&mut self, state: &RobotState<'_>, pose: &Isometry3<f64>) {
        let target_in_frame = pose.inv_mul(&self.target);
        self.error = se3::log(&target_in_frame);

        let axes = self.target.rotation.inverse();
        let velocity = se3::stack(&(axes * self.feed_forward.linear), &(axes * self.feed_forward.angular));
        self.pull = self.correction();
        self.desired = self.pull + se3::log_jacobian(&target_in_frame) * velocity;

        state.kinematics.jacobian(state.model, self.frame, Reference::Local, &mut self.jacobian);
        let derivative = se3::log_jacobian(&target_in_frame.inverse());
        for mut column in self.jacobian.column_iter_mut() {
            let rotated = derivative * column.fixed_rows::<6>(0);
            column.copy_from(&rotated);
        }
    }

    /// The same of the directions that have a share.
    fn update_axes(&mut self, state: &RobotState<'_>, pose: &Isometry3<f64>, shares: &AxisShares) {
        let Twist { linear, angular } = self.feed_forward;
        let from_world = shares.world_to_axes(pose, &self.target);
        // free directions also affect the motion of the axes
        let place = from_world * (self.target.translation.vector - pose.translation.vector);
        let turn = from_world * so3::log(&(self.target.rotation * pose.rotation.inverse()));
        let (counted_place, counted_turn) = shares.error(pose, &self.target);
        self.error = se3::stack(&counted_place, &counted_turn);
        let correction = self.correction();
        self.pull = shares.weigh_twice(&correction);

        // in the axes of frame and target the rotation vector is the same
        let [frame, target] = [pose.rotation, self.target.rotation].map(|rotation| rotation.inverse());
        let [frame, target] = match shares.axes() {
            PoseAxes::World => [Matrix3::identity(); 2],
            _ => [frame, target].map(|rotation| rotation.to_rotation_matrix().into_inner()),
        };
        let (by_frame, by_target) = match shares.axes() {
            PoseAxes::World => (so3::right_jacobian_inverse(&turn), so3::left_jacobian_inverse(&turn)),
            _ => (so3::left_jacobian_inverse(&turn), so3::right_jacobian_inverse(&turn)),
        };
        let carried = match shares.axes() {
            PoseAxes::Target => (from_world * angular).cross(&place),
            _ => Vector3::zeros(),
        };
        let moving = shares.weigh(&(from_world * linear - carried), &(by_target * (target * angular)));
        let (slow, turned) = (correction.fixed_rows::<3>(0), correction.fixed_rows::<3>(3));
        self.desired = shares.weigh(&slow.into(), &turned.into()) + moving;

        let reference = Reference::LocalWorldAligned;
        state.kinematics.jacobian(state.model, self.frame, reference, &mut self.jacobian);
        let (by_frame, carries) = (by_frame * frame, shares.follow_frame());
        for mut column in self.jacobian.column_iter_mut() {
            let (v, w) = (column.fixed_rows::<3>(0).into_owned(), column.fixed_rows::<3>(3).into_owned());
            let mut linear = from_world * v;
            if carries {
                linear -= place.cross(&(from_world * w));
            }
            column.copy_from(&shares.weigh(&linear, &(by_frame * w)));
        }
    }

    /// `gain e`, slowed to the largest speeds.
    fn correction(&self) -> Vector6<f64> {
        let correction = self.error * self.settings.gain;
        let linear = correction.fixed_rows::<3>(0).norm();
        let angular = correction.fixed_rows::<3>(3).norm();
        let excess = (linear / self.settings.max_linear_speed).max(angular / self.settings.max_angular_speed);
        if excess > 1.0 { correction / excess } else { correction }
    }
}

impl VelocityTask for CartesianTask {
    fn rows(&self) -> usize {
        6
    }

    fn update(&mut self, state: &RobotState<'_>) {
        let pose = state.kinematics.pose(state.model, self.frame);
        self.position_error = (self.target.translation.vector - pose.translation.vector).norm();
        self.orientation_error = pose.rotation.angle_to(&self.target.rotation);
        match self.settings.shares {
            None => self.update_pose(state, &pose),
            Some(shares) => self.update_axes(state, &pose, &shares),
        }
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        let weights = self.weights();
        let counted = (0..6).filter(|axis| weights[*axis] > 0.0);
        residual(counted, &self.jacobian, self.desired.as_slice(), velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        let weights = self.weights();
        let squared = weights.component_mul(&weights);
        let damping = self.settings.damping * squared.component_mul(&self.pull).norm();
        for j in 0..self.jacobian.ncols() {
            let weighted = squared.component_mul(&self.jacobian.fixed_columns::<1>(j));
            problem.gradient[j] -= weighted.dot(&self.desired);
            for i in 0..=j {
                problem.hessian[(i, j)] += weighted.dot(&self.jacobian.fixed_columns::<1>(i));
            }
            problem.hessian[(j, j)] += damping;
        }
    }

    fn write_rows(&self, rows: &mut Rows) {
        for (axis, weight) in self.weights().iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            let row = rows.push(weight * self.desired[axis]).iter_mut();
            row.zip(self.jacobian.row(axis).iter()).for_each(|(row, a)| *row = weight * a);
        }
    }
}

/// Length of `A v - b` over these rows.
fn residual(
    rows: impl Iterator<Item = usize>,
    matrix: &Matrix6xX<f64>,
    desired: &[f64],
    velocity: &[f64],
) -> f64 {
    let of_row = |row: usize| {
        let product: f64 = (0..velocity.len()).map(|column| matrix[(row, column)] * velocity[column]).sum();
        product - desired[row]
    };
    rows.map(|row| of_row(row).powi(2)).sum::<f64>().sqrt()
}
