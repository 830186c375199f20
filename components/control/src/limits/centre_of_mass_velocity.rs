//! The centre of mass stays within a largest velocity.

use motorium_robots::Model;
use nalgebra::{Matrix3xX, Vector3};

use super::{LimitRows, RowLimit};
use crate::RobotState;

/// The velocity of the centre of mass stays within bounds along each axis of the world:
///
/// ```text
/// -most <= J_com v <= most                                m/s
/// ```
///
/// (OpenSoT's constraint.) An infinite bound leaves its axis free.
#[derive(Clone, Debug)]
pub struct CentreOfMassVelocityLimit {
    most: Vector3<f64>,
    jacobian: Matrix3xX<f64>,
}

impl CentreOfMassVelocityLimit {
    /// A limit for `model`: the largest speeds along x, y and z of the world \[m/s\], at least 0.
    pub fn new(model: &Model, most: Vector3<f64>) -> Self {
        Self { most, jacobian: Matrix3xX::zeros(model.nv()) }
    }
}

impl RowLimit for CentreOfMassVelocityLimit {
    fn rows(&self) -> usize {
        3
    }

    fn write(&mut self, state: &RobotState<'_>, _: f64, rows: &mut LimitRows<'_>) {
        state.kinematics.com_jacobian(state.model, &mut self.jacobian);
        for (row, most) in self.jacobian.row_iter().zip(&self.most) {
            if most.is_finite() {
                rows.push(row.iter().copied(), -most, *most);
            }
        }
    }
}
