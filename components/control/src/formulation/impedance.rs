//! Springs and dampers as the response to an error.

use motorium_robots::{MassFactor, Model};
use nalgebra::{DMatrix, DVector};

use super::response::length;
use crate::cost::Cost;

/// Springs and dampers, and the accelerations caused by their forces on a robot without contacts.
#[derive(Clone, Debug)]
pub(super) struct Impedance {
    pub(super) stiffness: DVector<f64>,
    pub(super) damping: DVector<f64>,
    force: DVector<f64>,
    /// Jacobian of the points where the forces act; `None` for the task's `J`.
    pub(super) jacobian: Option<DMatrix<f64>>,
    factor: MassFactor,
    moving: DVector<f64>,
}

impl Impedance {
    pub(super) fn new(model: &Model, [stiffness, damping]: [DVector<f64>; 2]) -> Self {
        let (force, moving) = (DVector::zeros(stiffness.len()), DVector::zeros(model.nv()));
        Self { stiffness, damping, force, jacobian: None, factor: MassFactor::new(model), moving }
    }

    /// Computes the forces `K e + D e'`. `K e` of a block of three rows is limited to `D` times the block's
    /// largest speed.
    pub(super) fn exert(&mut self, error: &DVector<f64>, rate: &DVector<f64>, max_speeds: [f64; 2]) {
        let Self { stiffness, damping, force, .. } = self;
        for row in 0..force.len() {
            force[row] = stiffness[row] * error[row];
        }
        for ((block, damping), speed) in
            force.as_mut_slice().chunks_mut(3).zip(damping.iter().step_by(3)).zip(max_speeds)
        {
            let (length, most) = (length(block.iter().copied()), damping * speed);
            if speed < f64::INFINITY && length > most {
                block.iter_mut().for_each(|force| *force *= most / length);
            }
        }
        for row in 0..force.len() {
            force[row] += damping[row] * rate[row];
        }
    }

    /// Writes `J M^-1 J' f`, or zero if the mass matrix is singular.
    pub(super) fn write(&mut self, mass: &DMatrix<f64>, cost: &Cost, acceleration: &mut DVector<f64>) {
        let Self { force, jacobian, factor, moving, .. } = self;
        match &*jacobian {
            Some(jacobian) => moving.gemv_tr(1.0, jacobian, force, 0.0),
            None => cost.multiply_transposed(force, moving),
        }
        match factor.factor(mass) {
            Ok(()) => factor.solve(moving.as_mut_slice()),
            Err(_) => moving.fill(0.0),
        }
        match &*jacobian {
            Some(jacobian) => acceleration.gemv(1.0, jacobian, moving, 0.0),
            None => cost.multiply(moving, acceleration),
        }
    }
}
