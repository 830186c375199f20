//! Costs on accelerations.

use motorium_robots::{MassFactor, Model};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::velocity::length;
use super::{Equation, Response};
use crate::cost::Cost;

/// Feedback of a task: the acceleration `kp e + kd e'` for an error `e`.
///
/// ```
/// use motorium_control::tasks::Feedback;
///
/// // both eigenvalues of the error at -10 / s: kd = 2 sqrt(kp)
/// assert_eq!(Feedback::critical(10.0), Feedback { kp: 100.0, kd: 20.0 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Gain of the position error \[1/s^2\].
    pub kp: f64,
    /// Gain of the velocity error \[1/s\].
    pub kd: f64,
}

impl Feedback {
    /// Critically damped, both eigenvalues of the error at `-rate` \[1/s\].
    pub fn critical(rate: f64) -> Self {
        Self { kp: rate * rate, kd: 2.0 * rate }
    }

    /// Acceleration for a vector error `e` and its rate `e'`, with the correction speed limited to
    /// `max_speed`: `kd (clip(kp / kd e) + e')`.
    pub fn acceleration(&self, error: &Vector3<f64>, rate: &Vector3<f64>, max_speed: f64) -> Vector3<f64> {
        let mut found = Vector3::zeros();
        self.write(error.as_slice(), rate.as_slice(), max_speed, found.as_mut_slice());
        found
    }

    /// The same for any number of rows.
    fn write(&self, error: &[f64], rate: &[f64], max_speed: f64, acceleration: &mut [f64]) {
        let Self { kp, kd } = *self;
        for (out, error) in acceleration.iter_mut().zip(error) {
            *out = error * kp;
        }
        if max_speed < f64::INFINITY {
            let (length, most) = (length(acceleration.iter().copied()), kd * max_speed);
            if length > most {
                acceleration.iter_mut().for_each(|out| *out *= most / length);
            }
        }
        for (out, rate) in acceleration.iter_mut().zip(rate) {
            *out += rate * kd;
        }
    }
}

impl Equation {
    /// Replaces the feedback of accelerations by springs and dampers: a stiffness and a damping for each row.
    /// The rows request the accelerations that the forces `f = K e + D e'` cause on a robot without contacts,
    /// `J M^-1 J' f`.
    ///
    /// # Panics
    /// If one of them has not one entry per row.
    pub(crate) fn set_impedance(&mut self, model: &Model, stiffness: &[f64], damping: &[f64]) {
        assert_eq!([stiffness.len(), damping.len()], [self.rows(); 2], "length of the impedance");
        let springs = [stiffness, damping].map(DVector::from_column_slice);
        self.impedance = Some(Impedance::new(model, springs));
    }

    /// Stiffness and damping of the rows, to be written; `None` without an impedance.
    pub(crate) fn springs_mut(&mut self) -> Option<(&mut DVector<f64>, &mut DVector<f64>)> {
        self.impedance.as_mut().map(|impedance| (&mut impedance.stiffness, &mut impedance.damping))
    }

    /// Gives the impedance a separate Jacobian, at whose rows the forces act, instead of `J`.
    pub(crate) fn separate_force_jacobian(&mut self) {
        let shape = self.cost.matrix().shape();
        if let Some(impedance) = &mut self.impedance {
            impedance.jacobian = Some(DMatrix::zeros(shape.0, shape.1));
        }
    }

    /// Copies `J` as it is now to the Jacobian of the impedance, if it has its own, with both halves of its
    /// rows rotated by `rotation`.
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

    /// Writes `b` for accelerations of a robot with this mass matrix.
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

/// Springs and dampers, and the accelerations that their forces cause on a robot without contacts.
#[derive(Clone, Debug)]
pub(crate) struct Impedance {
    stiffness: DVector<f64>,
    damping: DVector<f64>,
    force: DVector<f64>,
    /// Jacobian at whose rows the forces act; `None` for the task's own.
    jacobian: Option<DMatrix<f64>>,
    factor: MassFactor,
    moving: DVector<f64>,
}

impl Impedance {
    fn new(model: &Model, [stiffness, damping]: [DVector<f64>; 2]) -> Self {
        let (force, moving) = (DVector::zeros(stiffness.len()), DVector::zeros(model.nv()));
        Self { stiffness, damping, force, jacobian: None, factor: MassFactor::new(model), moving }
    }

    /// Computes the forces `K e + D e'`; `K e` of a block of three rows is at most `D` times its largest
    /// speed.
    fn exert(&mut self, error: &DVector<f64>, rate: &DVector<f64>, max_speeds: [f64; 2]) {
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

    /// Writes `J M^-1 J' f`; zero for a robot without inertia somewhere.
    fn write(&mut self, mass: &DMatrix<f64>, cost: &Cost, acceleration: &mut DVector<f64>) {
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
