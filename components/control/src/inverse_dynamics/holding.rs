//! Torques that hold a robot in place.

use super::MotionState;
use super::control::InverseDynamics;

impl InverseDynamics {
    /// Writes the torques \[Nm or N, one per independent joint\] that support the weight of the robot at
    /// rest, within the torque limits:
    ///
    /// ```text
    /// tau = g(q) - J_a' f        f: the contact forces of the last solution, of the contacts that are active
    /// ```
    ///
    /// `state` must be the state of the last [`begin`](Self::begin). These torques are the feed-forward of
    /// held joints in a tick without a solution; the previous torques would continue to accelerate the
    /// joints.
    ///
    /// ```
    /// use motorium_control::inverse_dynamics::{InverseDynamics, MotionState};
    /// use motorium_robots::{Dynamics, Kinematics, load};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let (q, v) = (home.as_slice(), vec![1.0; model.nv()]);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update_with_velocity(model, q, &v);
    /// let state = MotionState { model, kinematics: &kinematics, q, v: &v };
    /// let mut control = InverseDynamics::new(model, Vec::new());
    /// control.begin(&state, 1e-3);
    /// let (mut torque, mut weight) = (vec![0.0; model.joint_count()], vec![0.0; model.nv()]);
    /// control.write_holding_torque(&state, &mut torque);
    /// Dynamics::new(model).gravity(model, q, control.settings().gravity, &mut weight);
    /// assert_eq!(torque, weight);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    /// If the length of `torque` differs from the number of independent joints.
    pub fn write_holding_torque(&mut self, state: &MotionState<'_>, torque: &mut [f64]) {
        let Self { order, dynamics, weight, settings, contacts, problem, solution, torque_limit, .. } = self;
        dynamics.gravity(state.model, state.q, settings.gravity, weight.as_mut_slice());
        torque.copy_from_slice(&weight.as_slice()[order.base..]);
        for place in contacts.iter().filter(|place| place.active) {
            let first = 3 * place.first_point;
            for force in first..first + 3 * place.contact.points() {
                let column = problem.row_matrix.column(order.velocities + force);
                for (torque, entry) in torque.iter_mut().zip(column.iter()) {
                    *torque += entry * solution.forces[force];
                }
            }
        }
        for (torque, limit) in torque.iter_mut().zip(torque_limit.iter()) {
            *torque = torque.max(-limit).min(*limit);
        }
    }
}
