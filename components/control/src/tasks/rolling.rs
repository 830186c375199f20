//! A wheel rolls without slipping.

use motorium_robots::{FrameId, Kinematics, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::{Cost, Rows, Task};
use crate::{RobotState, solver::Problem};

/// Sine of the angle between wheel axis and ground normal below which the wheel counts as flat.
const FLAT: f64 = 1e-6;

/// A wheel on the ground: its contact and the motion of the contact point, shared by the velocity and the
/// acceleration task.
#[derive(Clone, Debug)]
pub(crate) struct RollingWheel {
    frame: FrameId,
    axis: Unit<Vector3<f64>>,
    radius: f64,
    normal: Unit<Vector3<f64>>,
    jacobian: Matrix6xX<f64>,
}

/// Contact of a wheel that is not flat, in world axes.
pub(crate) struct RollingContact {
    axis: Vector3<f64>,
    /// Direction from the ground to the centre of the wheel, and the length of the normal's component across
    /// the axis.
    up: Vector3<f64>,
    length: f64,
    /// Vector from the centre of the wheel to the contact \[m\].
    pub(crate) way: Vector3<f64>,
}

impl RollingWheel {
    /// The wheel whose centre is the origin of `frame`, with its axis in the axes of the frame and its radius
    /// \[m\], on level ground.
    pub(crate) fn new(model: &Model, frame: FrameId, axis: Unit<Vector3<f64>>, radius: f64) -> Self {
        Self { frame, axis, radius, normal: Vector3::z_axis(), jacobian: Matrix6xX::zeros(model.nv()) }
    }

    /// Puts the wheel on ground with another normal, world axes.
    pub(crate) fn set_normal(&mut self, normal: Unit<Vector3<f64>>) {
        self.normal = normal;
    }

    /// Returns the contact; `None` for a flat wheel.
    pub(crate) fn contact(&self, model: &Model, kinematics: &Kinematics) -> Option<RollingContact> {
        let axis = kinematics.pose(model, self.frame).rotation * self.axis.into_inner();
        let across = self.normal.into_inner() - axis * axis.dot(&self.normal);
        let (up, length) = Unit::try_new_and_get(across, FLAT)?;
        let up = up.into_inner();
        Some(RollingContact { axis, up, length, way: -up * self.radius })
    }

    /// Writes the Jacobian `J_v - [c]x J_w` of the point of the wheel at the offset `c` from its centre, 3 x
    /// nv.
    pub(crate) fn write_jacobian(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        way: &Vector3<f64>,
        cost: &mut Cost,
    ) {
        kinematics.jacobian(model, self.frame, Reference::LocalWorldAligned, &mut self.jacobian);
        for (mut row, frame) in cost.matrix_mut().column_iter_mut().zip(self.jacobian.column_iter()) {
            let (linear, angular) = (frame.fixed_rows::<3>(0), frame.fixed_rows::<3>(3));
            row.copy_from(&(linear + angular.cross(way)));
        }
    }

    /// Velocity of the point of the wheel at the contact, and the part of its acceleration that no
    /// acceleration of the joints makes: `v' + w' x c + w x c'` \[m/s, m/s2, world axes\].
    pub(crate) fn slip(
        &self,
        model: &Model,
        kinematics: &Kinematics,
        contact: &RollingContact,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let moving = kinematics.velocity(model, self.frame);
        let drift = kinematics.acceleration(model, self.frame);
        let RollingContact { axis, up, length, way } = contact;
        let turning = moving.angular.cross(axis);
        let across = -turning * axis.dot(&self.normal) - axis * turning.dot(&self.normal);
        let way_rate = -(across - up * up.dot(&across)) * (self.radius / length);
        let slip = moving.linear + moving.angular.cross(way);
        (slip, drift.linear + drift.angular.cross(way) + moving.angular.cross(&way_rate))
    }
}

/// Keeps the contact point of a wheel at rest: the wheel rolls without slipping or sliding.
///
/// In the axes of the world, with the axis `d` of the wheel, the normal `n` of the ground, and the vector `c`
/// from its centre to the contact,
///
/// ```text
/// c = -radius (n - d d' n) / |n - d d' n|
/// A = J_v - [c]x J_w                     velocity v + w x c of the point of the wheel at the contact, 3 x nv
/// b = 0
/// W = weight                             1/(m/s)
/// ```
///
/// (OpenSoT's pure rolling.) On the first of several levels it couples a base to the rotation of its wheels.
/// The task is inactive for a flat wheel, which has no contact point.
#[derive(Clone, Debug)]
pub struct RollingTask {
    wheel: RollingWheel,
    weight: f64,
    contact: Vector3<f64>,
    cost: Cost,
}

impl RollingTask {
    /// A task for the wheel whose centre is the origin of `frame`, with its axis in the axes of the frame and
    /// its radius \[m\], on level ground, with weight 1.
    pub fn new(model: &Model, frame: FrameId, axis: Unit<Vector3<f64>>, radius: f64) -> Self {
        Self {
            wheel: RollingWheel::new(model, frame, axis, radius),
            weight: 1.0,
            contact: Vector3::zeros(),
            cost: Cost::dense(3, 0, model.nv()),
        }
    }

    /// The same task on ground with another normal, world axes.
    #[must_use]
    pub fn on(mut self, normal: Unit<Vector3<f64>>) -> Self {
        self.wheel.set_normal(normal);
        self
    }

    /// The same task with a weight \[1/(m/s)\].
    #[must_use]
    pub fn weight(mut self, weight: f64) -> Self {
        self.weight = weight;
        self
    }

    /// Changes the weight from the next update on.
    pub fn set_weight(&mut self, weight: f64) {
        self.weight = weight;
    }

    /// `c` at the last update \[m, world axes\]; zero for a flat wheel.
    pub fn contact(&self) -> &Vector3<f64> {
        &self.contact
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl Task for RollingTask {
    fn rows(&self) -> usize {
        3
    }

    fn update(&mut self, state: &RobotState<'_>) {
        let RobotState { model, kinematics, .. } = *state;
        let contact = self.wheel.contact(model, kinematics);
        let weight = if contact.is_some() { self.weight } else { 0.0 };
        self.contact = contact.map_or(Vector3::zeros(), |contact| contact.way);
        self.cost.weights_mut().fill(weight);
        self.wheel.write_jacobian(model, kinematics, &self.contact, &mut self.cost);
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
