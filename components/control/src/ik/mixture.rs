//! Mixtures of solutions, for tasks that fade.

use super::DifferentialIk;
use crate::solver::QpSolver;

impl<S: QpSolver> DifferentialIk<S> {
    /// Adds the velocity of the last [`solve`](Self::solve) to a mixture, weighted by `share`. A mixture with
    /// nonnegative shares that sum to 1 satisfies all limits that its solutions satisfy.
    ///
    /// A task alone on its level acts the same with a small weight as with a large one, so reducing its
    /// weight cannot fade it out. Mixing the solutions with and without it can.
    ///
    /// ```
    /// use motorium_control::{DifferentialIk, RobotState, tasks::{CartesianTask, PostureTask, VelocityTask}};
    /// use motorium_robots::{Kinematics, load};
    /// use nalgebra::DVector;
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, home.as_slice());
    /// let mut hand = CartesianTask::new(model, model.frame("panda_hand_tcp")?);
    /// hand.set_target(kinematics.pose(model, hand.frame()));
    /// let mut posture = PostureTask::new(model, &vec![0.1; model.nv()]);
    /// let mut ik = DifferentialIk::new(model).levels(&[hand.rows(), posture.rows()]);
    /// let state = RobotState { model, kinematics: &kinematics, q: home.as_slice() };
    ///
    /// let mut solutions = Vec::new();
    /// for (with_hand, share) in [(false, 0.75), (true, 0.25)] {
    ///     ik.begin();
    ///     if with_hand {
    ///         ik.add_task(&state, 0, &mut hand);
    ///     }
    ///     ik.add_task(&state, 1, &mut posture);
    ///     solutions.push(DVector::from_column_slice(ik.solve()?) * share);
    ///     ik.mix(share);
    /// }
    /// let mixed = DVector::from_column_slice(ik.take_mixture());
    /// assert!((mixed - (&solutions[0] + &solutions[1])).norm() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn mix(&mut self, share: f64) {
        for (mixed, velocity) in self.mixture.iter_mut().zip(&self.velocity) {
            *mixed += share * velocity;
        }
    }

    /// Makes the mixture the [`velocity`](Self::velocity), and starts a new one.
    pub fn take_mixture(&mut self) -> &[f64] {
        std::mem::swap(&mut self.velocity, &mut self.mixture);
        self.mixture.fill(0.0);
        &self.velocity[..self.motions]
    }

    /// Begins a new mixture.
    pub fn drop_mixture(&mut self) {
        self.mixture.fill(0.0);
    }
}
