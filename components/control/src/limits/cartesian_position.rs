//! Keeps the origin of a frame on one side of planes.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::{LimitRows, RowLimit};
use crate::RobotState;

/// Maximum speed of a frame's return from beyond a plane \[m/s\].
const RECOVERY: f64 = 0.01;

/// Keeps the origin `p` of a frame within half-spaces `n' p <= d` of the world, reduced by a margin:
///
/// ```text
/// n' J_v v  <=  min(rate, 1/dt) (d - margin - n' p)               m/s, at least -0.01
/// ```
///
/// OpenSoT has the same constraint. Use this limit for a table, a wall or a box around the hand. A frame
/// beyond a plane returns at up to 1 cm per second, or stays if other limits prevent the return.
#[derive(Clone, Debug)]
pub struct CartesianPositionLimit {
    frame: FrameId,
    rate: f64,
    margin: f64,
    /// Outward normals and offsets along them.
    planes: Vec<(Unit<Vector3<f64>>, f64)>,
    jacobian: Matrix6xX<f64>,
}

impl CartesianPositionLimit {
    /// Creates a limit that keeps `frame` of `model` on the inner side of `planes`. Each plane has an outward
    /// normal and an offset `d` along the normal \[m\]. The default rate is 5 1/s.
    pub fn new(model: &Model, frame: FrameId, planes: Vec<(Unit<Vector3<f64>>, f64)>) -> Self {
        Self { frame, rate: 5.0, margin: 0.0, planes, jacobian: Matrix6xX::zeros(model.nv()) }
    }

    /// Creates a limit that keeps `frame` in a box along the axes of the world, between two corners \[m\].
    /// Infinite coordinates are not limited.
    pub fn within(model: &Model, frame: FrameId, lower: Vector3<f64>, upper: Vector3<f64>) -> Self {
        let mut planes = Vec::with_capacity(6);
        for (axis, unit) in [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()].into_iter().enumerate()
        {
            planes.extend(upper[axis].is_finite().then_some((unit, upper[axis])));
            planes.extend(lower[axis].is_finite().then_some((-unit, -lower[axis])));
        }
        Self::new(model, frame, planes)
    }

    /// Sets the rate and the margin. The rate \[1/s\] is the fraction of the remaining distance that may be
    /// covered per second; the margin \[m\] is the distance kept from the planes.
    #[must_use]
    pub fn with(mut self, rate: f64, margin: f64) -> Self {
        (self.rate, self.margin) = (rate, margin);
        self
    }
}

impl RowLimit for CartesianPositionLimit {
    fn rows(&self) -> usize {
        self.planes.len()
    }

    fn write(&mut self, state: &RobotState<'_>, dt: f64, rows: &mut LimitRows<'_>) {
        let reference = Reference::LocalWorldAligned;
        state.kinematics.jacobian(state.model, self.frame, reference, &mut self.jacobian);
        let place = state.kinematics.pose(state.model, self.frame).translation.vector;
        let rate = self.rate.min(dt.recip());
        for (normal, distance) in &self.planes {
            let left = distance - self.margin - normal.dot(&place);
            let row = self.jacobian.column_iter().map(|column| normal.dot(&column.fixed_rows::<3>(0)));
            rows.push_upper_barrier(row, left, rate, RECOVERY);
        }
    }
}
