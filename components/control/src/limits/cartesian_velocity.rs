//! Velocity limits of frames.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::Matrix6xX;

use super::{LimitRows, RowLimit};
use crate::RobotState;

/// Keeps the velocity of a frame within bounds along each axis of the world:
///
/// ```text
/// -linear  <= J_v v <= linear                     m/s
/// -angular <= J_w v <= angular                    rad/s
/// ```
///
/// OpenSoT has the same constraint. If a bound is infinite, its three rows are omitted.
#[derive(Clone, Debug)]
pub struct CartesianVelocityLimit {
    frame: FrameId,
    linear: f64,
    angular: f64,
    jacobian: Matrix6xX<f64>,
}

impl CartesianVelocityLimit {
    /// Creates a limit for `frame` of `model`. The bounds `linear` \[m/s\] and `angular` \[rad/s\] are at
    /// least 0 and apply to each axis separately.
    pub fn new(model: &Model, frame: FrameId, linear: f64, angular: f64) -> Self {
        Self { frame, linear, angular, jacobian: Matrix6xX::zeros(model.nv()) }
    }
}

impl RowLimit for CartesianVelocityLimit {
    fn rows(&self) -> usize {
        6
    }

    fn write(&mut self, state: &RobotState<'_>, _: f64, rows: &mut LimitRows<'_>) {
        let reference = Reference::LocalWorldAligned;
        state.kinematics.jacobian(state.model, self.frame, reference, &mut self.jacobian);
        for (axis, row) in self.jacobian.row_iter().enumerate() {
            let most = if axis < 3 { self.linear } else { self.angular };
            if most.is_finite() {
                rows.push(row.iter().copied(), -most, most);
            }
        }
    }
}
