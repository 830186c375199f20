//! The wrench of a contact follows a target.

use motorium_robots::{Model, Twist};
use nalgebra::Matrix3;

use super::{AccelerationTask, Cost};
use crate::inverse_dynamics::{Contact, InverseDynamics, MotionState};

/// Tracks a target for the force of one contact and its torque about the origin of the contact's frame, in
/// world axes:
///
/// ```text
/// A = (   R        R    ... )           R: axes of the contact, on the forces of its points, at the arms r_i
///     ([r_1]x R [r_2]x R ...)           6 x 3 points
/// b = (f*, n*)                          N, Nm: the wrench of the world on the robot
/// W = diag(f, f, f, n, n, n)            1/N, 1/Nm
/// ```
///
/// (PyRoboLearn's wrench task.) A point or a ball has only the torque of its lever arm.
#[derive(Clone, Debug)]
pub struct ContactWrench {
    contact: usize,
    force_weight: f64,
    torque_weight: f64,
    target: Twist,
    cost: Cost,
}

impl ContactWrench {
    /// A task for a contact of `dynamics`, with target zero and weights 1 \[1/N, 1/Nm\].
    ///
    /// # Panics
    /// If there is no such contact.
    pub fn new(dynamics: &InverseDynamics, contact: usize) -> Self {
        let place = &dynamics.contacts[contact];
        let first = dynamics.order.velocities + 3 * place.first_point;
        let cost = Cost::dense(6, first, 3 * place.contact.points());
        Self { contact, force_weight: 1.0, torque_weight: 1.0, target: Twist::zero(), cost }
    }

    /// The same for an inverse dynamics of `model` with these contacts.
    pub(crate) fn for_contact(model: &Model, contacts: &[Contact], contact: usize) -> Self {
        let points: usize = contacts[..contact].iter().map(Contact::points).sum();
        let cost = Cost::dense(6, model.nv() + 3 * points, 3 * contacts[contact].points());
        Self { contact, force_weight: 1.0, torque_weight: 1.0, target: Twist::zero(), cost }
    }

    /// The same task with weights of the force \[1/N\] and of the torque \[1/Nm\]; 0 leaves one free.
    #[must_use]
    pub fn weights(mut self, force: f64, torque: f64) -> Self {
        (self.force_weight, self.torque_weight) = (force, torque);
        self
    }

    /// Changes the weights from the next update on.
    pub fn set_weights(&mut self, force: f64, torque: f64) {
        (self.force_weight, self.torque_weight) = (force, torque);
    }

    /// Sets the target: force \[N\] as linear part, torque about the origin of the contact's frame \[Nm\] as
    /// angular part, world axes.
    pub fn set_target(&mut self, wrench: Twist) {
        self.target = wrench;
    }
}

impl AccelerationTask for ContactWrench {
    fn update(&mut self, _: &MotionState<'_>, dynamics: &InverseDynamics) {
        let place = &dynamics.contacts[self.contact];
        for (point, arm) in place.arms.iter().enumerate() {
            let turned: Matrix3<f64> = arm.cross_matrix() * place.axes;
            self.cost.matrix_mut().fixed_view_mut::<3, 3>(0, 3 * point).copy_from(&place.axes);
            self.cost.matrix_mut().fixed_view_mut::<3, 3>(3, 3 * point).copy_from(&turned);
        }
        let (force, torque) = (self.target.linear, self.target.angular);
        self.cost.desired_mut().fixed_rows_mut::<3>(0).copy_from(&force);
        self.cost.desired_mut().fixed_rows_mut::<3>(3).copy_from(&torque);
        let (force, torque) = (self.force_weight, self.torque_weight);
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(force);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(torque);
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
