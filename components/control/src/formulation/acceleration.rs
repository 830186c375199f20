//! Costs on accelerations.

use motorium_robots::Model;
use nalgebra::{DMatrix, DVector, Matrix3};

use super::equation::Equation;
use super::impedance::Impedance;
use super::response::Response;

impl Equation {
    /// Replaces the acceleration feedback by springs and dampers, with a stiffness and a damping for each
    /// row. The rows request the accelerations that the forces `f = K e + D e'` cause on a robot without
    /// contacts, `J M^-1 J' f`.
    ///
    /// # Panics
    /// If the length of either differs from the number of rows.
    pub(crate) fn set_impedance(&mut self, model: &Model, stiffness: &[f64], damping: &[f64]) {
        assert_eq!([stiffness.len(), damping.len()], [self.rows(); 2], "length of the impedance");
        let springs = [stiffness, damping].map(DVector::from_column_slice);
        self.impedance = Some(Impedance::new(model, springs));
    }

    /// Returns the stiffness and damping of the rows for writing, or `None` without an impedance.
    pub(crate) fn springs_mut(&mut self) -> Option<(&mut DVector<f64>, &mut DVector<f64>)> {
        self.impedance.as_mut().map(|impedance| (&mut impedance.stiffness, &mut impedance.damping))
    }

    /// Gives the impedance a separate Jacobian that replaces `J` for its forces.
    pub(crate) fn separate_force_jacobian(&mut self) {
        let shape = self.cost.matrix().shape();
        if let Some(impedance) = &mut self.impedance {
            impedance.jacobian = Some(DMatrix::zeros(shape.0, shape.1));
        }
    }

    /// Copies the current `J` to the impedance's separate Jacobian, if there is one, and rotates both halves
    /// of its rows by `rotation`.
    pub(crate) fn copy_force_jacobian(&mut self, rotation: Option<&Matrix3<f64>>) {
        let own = self.impedance.as_mut().and_then(|impedance| impedance.jacobian.as_mut());
        let Some(own) = own else { return };
        own.copy_from(self.cost.matrix());
        let Some(rotation) = rotation else { return };
        for mut column in own.column_iter_mut() {
            for first in [0, 3] {
                let mut rows = column.fixed_rows_mut::<3>(first);
                let rotated = rotation * &rows;
                rows.copy_from(&rotated);
            }
        }
    }

    /// Writes `b` for the accelerations of a robot with this mass matrix.
    pub(crate) fn request_acceleration(&mut self, mass: &DMatrix<f64>) {
        let Self { error, error_rate, response, cost, impedance, correction, .. } = self;
        let Response { feedback, max_speeds, .. } = *response;
        match impedance {
            Some(impedance) => {
                impedance.exert(error, error_rate, max_speeds);
                impedance.write(mass, cost, correction);
            }
            None => {
                let (error, rate) = (error.as_slice(), error_rate.as_slice());
                let speeds = max_speeds.into_iter().chain(std::iter::repeat(f64::INFINITY));
                for ((block, speed), first) in
                    correction.as_mut_slice().chunks_mut(3).zip(speeds).zip((0..).step_by(3))
                {
                    let rows = first..first + block.len();
                    feedback.write(&error[rows.clone()], &rate[rows], speed, block);
                }
            }
        }
        self.select(false);
        let Self { rate_derivative: ahead, drift, cost, correction, .. } = self;
        let desired = cost.desired_mut().iter_mut().zip(&*correction);
        for ((desired, correction), (ahead, drift)) in desired.zip(ahead.iter().zip(&*drift)) {
            *desired = correction + ahead - drift;
        }
    }
}
