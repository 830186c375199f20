//! Steers a wheel into the direction of motion of its base.

use motorium_robots::{FrameId, Kinematics, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::{Cost, Rows, Task};
use crate::{RobotState, solver::Problem};

/// Speed of a wheel below which its direction is undefined \[m/s\].
const STANDING: f64 = 1e-6;

/// A steered wheel of a base: its steering error and rotation, shared by the velocity and the acceleration
/// task.
#[derive(Clone, Debug)]
pub(crate) struct SteeredWheel {
    wheel: FrameId,
    base: FrameId,
    axis: Unit<Vector3<f64>>,
    normal: Unit<Vector3<f64>>,
    /// Velocity of the base in its own axes: along x, along y, about z.
    twist: [f64; 3],
    error: f64,
    jacobian: Matrix6xX<f64>,
}

impl SteeredWheel {
    /// The wheel whose centre is the origin of the frame `wheel`, with its axis in the axes of that frame, on
    /// a base with the frame `base` at rest on level ground.
    pub(crate) fn new(model: &Model, wheel: FrameId, base: FrameId, axis: Unit<Vector3<f64>>) -> Self {
        let (normal, jacobian) = (Vector3::z_axis(), Matrix6xX::zeros(model.nv()));
        Self { wheel, base, axis, normal, twist: [0.0; 3], error: 0.0, jacobian }
    }

    /// Puts the wheel on ground with another normal, world axes.
    pub(crate) fn set_normal(&mut self, normal: Unit<Vector3<f64>>) {
        self.normal = normal;
    }

    /// Sets the velocity of the base in its own axes: along x and y \[m/s\], and about z \[rad/s\].
    pub(crate) fn set_twist(&mut self, twist: [f64; 3]) {
        self.twist = twist;
    }

    /// Yaw rate of the base \[rad/s\].
    pub(crate) fn yaw_rate(&self) -> f64 {
        self.twist[2]
    }

    /// The angle at the last [`steer`](Self::steer) \[rad\], 0 without one.
    pub(crate) fn error(&self) -> f64 {
        self.error
    }

    /// Angle about the normal from the rolling direction of the wheel to the velocity of its centre, or to
    /// the opposite if that is closer \[rad\]; `None` for a standing or flat wheel.
    fn angle(&self, model: &Model, kinematics: &Kinematics) -> Option<f64> {
        let [wheel, base] = [self.wheel, self.base].map(|frame| kinematics.pose(model, frame));
        let (normal, [x, y, yaw]) = (self.normal.into_inner(), self.twist);
        let flat = |vector: Vector3<f64>| vector - normal * normal.dot(&vector);
        let arm = flat(wheel.translation.vector - base.translation.vector);
        let carried = flat(base.rotation * Vector3::new(x, y, 0.0)) + normal.cross(&arm) * yaw;
        let forward = (wheel.rotation * self.axis.into_inner()).cross(&normal);
        if carried.norm() <= STANDING || forward.norm() <= STANDING {
            return None;
        }
        let carried = if forward.dot(&carried) < 0.0 { -carried } else { carried };
        Some(normal.dot(&forward.cross(&carried)).atan2(forward.dot(&carried)))
    }

    /// Computes the angle, and writes `n' J_w`, the angular velocity of the wheel about the normal, 1 x nv.
    /// Returns `false` if the task is inactive.
    pub(crate) fn steer(&mut self, model: &Model, kinematics: &Kinematics, cost: &mut Cost) -> bool {
        let angle = self.angle(model, kinematics);
        self.error = angle.unwrap_or(0.0);
        let normal = self.normal.into_inner();
        kinematics.jacobian(model, self.wheel, Reference::LocalWorldAligned, &mut self.jacobian);
        for (mut row, frame) in cost.matrix_mut().column_iter_mut().zip(self.jacobian.column_iter()) {
            row[0] = normal.dot(&frame.fixed_rows::<3>(3));
        }
        angle.is_some()
    }

    /// Angular velocity of the wheel about the normal, and the part of its rate independent of joint
    /// accelerations \[rad/s, rad/s2\].
    pub(crate) fn turning(&self, model: &Model, kinematics: &Kinematics) -> (f64, f64) {
        let (moving, drift) =
            (kinematics.velocity(model, self.wheel), kinematics.acceleration(model, self.wheel));
        (self.normal.dot(&moving.angular), self.normal.dot(&drift.angular))
    }
}

/// Steers a wheel until it rolls along the velocity of its centre, given the rigid motion of the base. All
/// steered wheels of a base then roll about the same instantaneous centre of rotation.
///
/// With the axis `d` of the wheel, the normal `n` of the ground, the centre `p` of the wheel and `o` of the
/// base, all in the axes of the world, and the twist `(V, W)` of the base,
///
/// ```text
/// f = d x n / |d x n|                             direction in which the wheel rolls
/// u = V + W n x (p - o)                           velocity of its centre
/// e = angle from f to u about n                   rad; to -u where that is nearer: the wheel rolls backwards
/// A = n' J_w                                      angular velocity of the wheel about the normal, 1 x nv
/// b = gain e + W
/// W = weight                                      1/(rad/s)
/// ```
///
/// (OpenSoT's task, with the turning of the base as feed-forward.) The task is inactive for a standing or
/// flat wheel.
#[derive(Clone, Debug)]
pub struct RigidRotationTask {
    steering: SteeredWheel,
    gain: f64,
    weight: f64,
    cost: Cost,
}

impl RigidRotationTask {
    /// A task for the wheel whose centre is the origin of the frame `wheel`, with its axis in the axes of
    /// that frame, on a base with the frame `base` at rest on level ground; with gain 10 and weight 1.
    pub fn new(model: &Model, wheel: FrameId, base: FrameId, axis: Unit<Vector3<f64>>) -> Self {
        let steering = SteeredWheel::new(model, wheel, base, axis);
        Self { steering, gain: 10.0, weight: 1.0, cost: Cost::dense(1, 0, model.nv()) }
    }

    /// The same task with a gain \[1/s\] and a weight \[1/(rad/s)\].
    #[must_use]
    pub fn with(mut self, gain: f64, weight: f64) -> Self {
        self.set(gain, weight);
        self
    }

    /// Changes gain and weight from the next update on.
    pub fn set(&mut self, gain: f64, weight: f64) {
        (self.gain, self.weight) = (gain, weight);
    }

    /// The same task on ground with another normal, world axes.
    #[must_use]
    pub fn on(mut self, normal: Unit<Vector3<f64>>) -> Self {
        self.steering.set_normal(normal);
        self
    }

    /// Sets the velocity of the base in its own axes: along x and y \[m/s\], and about z \[rad/s\].
    pub fn set_twist(&mut self, x: f64, y: f64, yaw: f64) {
        self.steering.set_twist([x, y, yaw]);
    }

    /// `e` at the last update \[rad\], from -pi/2 to pi/2; 0 while the task is inactive.
    pub fn error(&self) -> f64 {
        self.steering.error()
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl Task for RigidRotationTask {
    fn rows(&self) -> usize {
        1
    }

    fn update(&mut self, state: &RobotState<'_>) {
        let steers = self.steering.steer(state.model, state.kinematics, &mut self.cost);
        self.cost.desired_mut()[0] = self.gain * self.steering.error() + self.steering.yaw_rate();
        self.cost.weights_mut()[0] = if steers { self.weight } else { 0.0 };
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        self.cost.residual(velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        self.cost.add_to(problem);
    }

    fn write_rows(&self, rows: &mut Rows) {
        self.cost.write_rows(rows);
    }
}
