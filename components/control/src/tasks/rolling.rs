//! A wheel rolls without slipping.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::{Cost, Rows, Task};
use crate::{RobotState, solver::Problem};

/// Sine of the angle from the normal of the ground up to which the axis of a wheel counts as upright: the wheel lies flat.
const FLAT: f64 = 1e-6;

/// The point of a wheel that touches the ground rests: the wheel rolls along, and does not slip or slide.
///
/// In the axes of the world, with the axis `d` of the wheel, the normal `n` of the ground, and the way `c` from its centre to
/// the contact,
///
/// ```text
/// c = -radius (n - d d' n) / |n - d d' n|
/// A = J_v - [c]x J_w                              velocity v + w x c of the point of the wheel at the contact, 3 x nv
/// b = 0
/// W = weight                                      1/(m/s)
/// ```
///
/// (OpenSoT's pure rolling.) In the first of several levels it is what binds a base to the turning of its wheels. A wheel that lies
/// flat has no contact point, and is asked for nothing.
#[derive(Clone, Debug)]
pub struct RollingTask {
    frame: FrameId,
    axis: Unit<Vector3<f64>>,
    radius: f64,
    normal: Unit<Vector3<f64>>,
    weight: f64,
    contact: Vector3<f64>,
    jacobian: Matrix6xX<f64>,
    cost: Cost,
}

impl RollingTask {
    /// A task for the wheel whose centre is the origin of `frame`, with its axis in the axes of the frame and its radius \[m\], on
    /// level ground, with weight 1.
    pub fn new(model: &Model, frame: FrameId, axis: Unit<Vector3<f64>>, radius: f64) -> Self {
        Self {
            frame,
            axis,
            radius,
            normal: Vector3::z_axis(),
            weight: 1.0,
            contact: Vector3::zeros(),
            jacobian: Matrix6xX::zeros(model.nv()),
            cost: Cost::dense(3, 0, model.nv()),
        }
    }

    /// The same task on ground with another normal, world axes.
    #[must_use]
    pub fn on(mut self, normal: Unit<Vector3<f64>>) -> Self {
        self.normal = normal;
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

    /// `c` at the last update \[m, world axes\]; zero for a wheel that lies flat.
    pub fn contact(&self) -> &Vector3<f64> {
        &self.contact
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

/// The direction from the ground to the centre of a wheel with this axis (world axes), and the length of what the normal has across the
/// axis; `None` for a wheel that lies flat.
pub(crate) fn way_to_ground(axis: &Vector3<f64>, normal: &Unit<Vector3<f64>>) -> Option<(Vector3<f64>, f64)> {
    let across = normal.into_inner() - axis * axis.dot(normal);
    Unit::try_new_and_get(across, FLAT).map(|(up, length)| (up.into_inner(), length))
}

impl Task for RollingTask {
    fn rows(&self) -> usize {
        3
    }

    fn update(&mut self, state: &RobotState<'_>) {
        let axis = state.kinematics.pose(state.model, self.frame).rotation * self.axis;
        let upright = way_to_ground(&axis, &self.normal);
        self.contact = upright.map_or(Vector3::zeros(), |(up, _)| -up * self.radius);
        let weight = if upright.is_some() { self.weight } else { 0.0 };
        self.cost.weights_mut().fill(weight);
        let reference = Reference::LocalWorldAligned;
        state.kinematics.jacobian(state.model, self.frame, reference, &mut self.jacobian);
        let contact = self.contact;
        for (mut row, frame) in self.cost.matrix_mut().column_iter_mut().zip(self.jacobian.column_iter()) {
            let (linear, angular) = (frame.fixed_rows::<3>(0), frame.fixed_rows::<3>(3));
            row.copy_from(&(linear + angular.cross(&contact)));
        }
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
