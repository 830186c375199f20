//! An axis of a frame points at a point.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Matrix3xX, Matrix6xX, Unit, Vector3};

use super::{Rows, Task, residual};
use crate::{RobotState, solver::Problem};

/// Minimum distance from the frame origin to the target \[m\]; closer targets are ignored because the
/// direction is undefined.
const NEAREST: f64 = 1e-2;

/// Gain and weights of a [`GazeTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GazeSettings {
    /// Rate at which the error decays \[1/s\]. Useful below a tenth of the tick rate. Default 10.
    pub gain: f64,
    /// Cost of an angular velocity error \[1/(rad/s)\]. Default 1.
    pub weight: f64,
    /// Largest angular speed at which the error is corrected \[rad/s\]. Default infinite.
    pub max_speed: f64,
    /// Levenberg-Marquardt damping per correction speed \[s/rad\]. Prevents oscillation if the robot cannot
    /// look at the target, and vanishes when it does. Default 5e-3.
    pub damping: f64,
}

impl Default for GazeSettings {
    fn default() -> Self {
        Self { gain: 10.0, weight: 1.0, max_speed: f64::INFINITY, damping: 5e-3 }
    }
}

/// An axis `d` of a frame points at a point `p*` \[m, world axes\]: a camera looks at something, a welding
/// torch points at a seam. How the frame is turned about the axis is left open.
///
/// With `r` the point and `w` its velocity in the axes of the frame, `u = r / |r|`, and `J_v`, `J_w` the
/// linear and the angular rows of the frame's Jacobian in its own axes,
///
/// ```text
/// e  = the rotation vector that turns d onto u            [rad, axes of the frame]
/// u x u' = u x w / |r| - (P J_w + [u]x J_v / |r|) v       P = 1 - u u'
/// ```
///
/// Asking for `u x u' = -k`, `k = gain e`, gives the cost
///
/// ```text
/// 1/2 |W (A v - b)|^2 + 1/2 mu |v|^2
/// A = P J_w + [u]x J_v / |r|,   b = k + u x w / |r|,   mu = damping |W^2 k|
/// ```
///
/// (the gaze task of OpenSoT, there with two rows and for a point at rest). `k` is scaled down to the largest
/// speed.
///
/// ```
/// use motorium_control::{RobotState, tasks::{GazeTask, Task}};
/// use motorium_robots::{Kinematics, load};
/// use nalgebra::Vector3;
///
/// let panda = load("panda", std::path::Path::new("."))?;
/// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
/// let mut kinematics = Kinematics::new(model);
/// kinematics.update(model, home.as_slice());
///
/// // the hand points down: a point below it is looked at already
/// let mut gaze = GazeTask::new(model, model.frame("panda_hand_tcp")?, Vector3::z_axis());
/// let hand = kinematics.pose(model, gaze.frame()).translation.vector;
/// gaze.set_target(hand - Vector3::z());
/// gaze.update(&RobotState { model, kinematics: &kinematics, q: home.as_slice() });
/// assert!(gaze.angle() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct GazeTask {
    settings: GazeSettings,
    frame: FrameId,
    axis: Unit<Vector3<f64>>,
    target: Vector3<f64>,
    velocity: Vector3<f64>,
    error: Vector3<f64>,
    desired: Vector3<f64>,
    frame_jacobian: Matrix6xX<f64>,
    jacobian: Matrix3xX<f64>,
}

impl GazeTask {
    /// Creates a task for an axis of `frame`, given in the frame's axes, with the world's origin as target.
    pub fn new(model: &Model, frame: FrameId, axis: Unit<Vector3<f64>>) -> Self {
        Self {
            settings: GazeSettings::default(),
            frame,
            axis,
            target: Vector3::zeros(),
            velocity: Vector3::zeros(),
            error: Vector3::zeros(),
            desired: Vector3::zeros(),
            frame_jacobian: Matrix6xX::zeros(model.nv()),
            jacobian: Matrix3xX::zeros(model.nv()),
        }
    }

    /// The same task with these settings.
    #[must_use]
    pub fn with(mut self, settings: GazeSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Changes gain and weight from the next update on.
    pub fn set_settings(&mut self, settings: GazeSettings) {
        self.settings = settings;
    }

    /// Gain and weights.
    pub fn settings(&self) -> &GazeSettings {
        &self.settings
    }

    /// Sets the point `p*` \[m, world axes\], at rest.
    pub fn set_target(&mut self, target: Vector3<f64>) {
        self.set_moving_target(target, Vector3::zeros());
    }

    /// Sets the point `p*` \[m\] and its velocity \[m/s\], in world axes.
    pub fn set_moving_target(&mut self, target: Vector3<f64>, velocity: Vector3<f64>) {
        self.target = target;
        self.velocity = velocity;
    }

    /// The frame whose axis points.
    pub fn frame(&self) -> FrameId {
        self.frame
    }

    /// The axis, in the axes of the frame.
    pub fn axis(&self) -> &Unit<Vector3<f64>> {
        &self.axis
    }

    /// The point `p*` \[m, world axes\].
    pub fn target(&self) -> &Vector3<f64> {
        &self.target
    }

    /// `e` at the last update \[rad, axes of the frame\].
    pub fn error(&self) -> &Vector3<f64> {
        &self.error
    }

    /// The angle between the axis and the direction to the point at the last update \[rad\], in `[0, pi]`.
    pub fn angle(&self) -> f64 {
        self.error.norm()
    }

    /// `A` at the last update, 3 x nv, of rank 2.
    pub fn jacobian(&self) -> &Matrix3xX<f64> {
        &self.jacobian
    }

    /// `b` at the last update \[rad/s\].
    pub fn desired(&self) -> &Vector3<f64> {
        &self.desired
    }

    /// The direction to the point in the axes of the frame, and the distance.
    fn direction(&self, state: &RobotState<'_>) -> (Vector3<f64>, f64) {
        let pose = state.kinematics.pose(state.model, self.frame);
        let seen = pose.rotation.inverse() * (self.target - pose.translation.vector);
        let distance = seen.norm();
        if distance < NEAREST { (self.axis.into_inner(), NEAREST) } else { (seen / distance, distance) }
    }

    /// The angle between the axis and the direction to the point in a state \[rad\].
    pub fn angle_at(&self, state: &RobotState<'_>) -> f64 {
        least_turn(&self.axis, &self.direction(state).0).norm()
    }

    /// `gain e`, slowed to the largest speed.
    fn correction(&self) -> Vector3<f64> {
        let correction = self.error * self.settings.gain;
        let excess = correction.norm() / self.settings.max_speed;
        if excess > 1.0 { correction / excess } else { correction }
    }
}

/// The rotation vector of the least turn from one unit vector to another \[rad\].
pub(crate) fn least_turn(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let normal = from.cross(to);
    let (sine, cosine) = (normal.norm(), from.dot(to));
    if sine > 1e-9 {
        return normal * (sine.atan2(cosine) / sine);
    }
    if cosine > 0.0 {
        return normal;
    }
    // straight behind: about any axis across, and the same one each time
    let across = from.cross(&Vector3::ith(from.iamin(), 1.0)).normalize();
    across * core::f64::consts::PI
}

impl Task for GazeTask {
    fn rows(&self) -> usize {
        3
    }

    fn update(&mut self, state: &RobotState<'_>) {
        let (direction, distance) = self.direction(state);
        self.error = least_turn(&self.axis, &direction);
        let pose = state.kinematics.pose(state.model, self.frame);
        let velocity = pose.rotation.inverse() * self.velocity;
        self.desired = self.correction() + direction.cross(&velocity) / distance;
        state.kinematics.jacobian(state.model, self.frame, Reference::Local, &mut self.frame_jacobian);
        for (mut row, frame) in self.jacobian.column_iter_mut().zip(self.frame_jacobian.column_iter()) {
            let (linear, angular) = (frame.fixed_rows::<3>(0), frame.fixed_rows::<3>(3));
            let across = angular - direction * direction.dot(&angular);
            row.copy_from(&(across + direction.cross(&linear) / distance));
        }
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        let counted = if self.settings.weight > 0.0 { 0..3 } else { 0..0 };
        residual(counted, &self.jacobian, self.desired.as_slice(), velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        let squared = self.settings.weight.powi(2);
        let damping = self.settings.damping * squared * self.correction().norm();
        for j in 0..self.jacobian.ncols() {
            let weighted = self.jacobian.column(j) * squared;
            problem.gradient[j] -= weighted.dot(&self.desired);
            for i in 0..=j {
                problem.hessian[(i, j)] += weighted.dot(&self.jacobian.column(i));
            }
            problem.hessian[(j, j)] += damping;
        }
    }

    fn write_rows(&self, rows: &mut Rows) {
        if self.settings.weight > 0.0 {
            for (seen, desired) in self.jacobian.row_iter().zip(&self.desired) {
                let weight = self.settings.weight;
                rows.push(weight * desired)
                    .iter_mut()
                    .zip(seen.iter())
                    .for_each(|(row, a)| *row = weight * a);
            }
        }
    }
}
