//! Costs on velocities.

use motorium_qp::Problem;

use super::Task;
use super::equation::Equation;
use super::response::{Response, length};
use crate::levels::Rows;
use crate::state::RobotState;

/// A cost on the joint velocity `v` \[rad/s or m/s\]: `1/2 |W (A v - b)|^2`, convex and finite for every `v`.
///
/// Every [`Task`] implements this trait, with `c = gain e`, which is scaled down as a whole if it exceeds a
/// maximum speed:
///
/// ```text
/// 1/2 |W (A v - b)|^2 + 1/2 mu |v|^2
/// A = J,   b = S c + nu,   mu = damping |W^2 S' S c|        S: selection of rows, usually the identity
/// ```
pub trait VelocityTask {
    /// Returns the maximum number of rows of `A`.
    fn rows(&self) -> usize;

    /// Evaluates the error, `A` and `b` at `state`.
    fn update(&mut self, state: &RobotState<'_>);

    /// Returns the norm of `A v - b` at the last update, over the rows with nonzero weight, in the units of
    /// the task \[m/s, rad/s\].
    fn residual(&self, velocity: &[f64]) -> f64;

    /// Adds the cost of the last update to the Hessian and the gradient of `problem`, whose unknowns are the
    /// joint velocities. Writes only the upper triangle of the Hessian.
    fn add_to(&self, problem: &mut Problem);

    /// Appends the rows of `W A` and `W b` of the last update, at most [`rows`](Self::rows). Rows with zero
    /// weight may be omitted.
    fn write_rows(&self, rows: &mut Rows);
}

impl<T: Task + ?Sized> VelocityTask for T {
    fn rows(&self) -> usize {
        self.equation().rows()
    }

    fn update(&mut self, state: &RobotState<'_>) {
        self.evaluate(state);
        self.equation_mut().request_velocity();
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        self.equation().cost.residual(velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        let Equation { cost, damping, .. } = self.equation();
        cost.add_to(problem);
        if *damping > 0.0 {
            cost.columns().for_each(|variable| problem.hessian[(variable, variable)] += damping);
        }
    }

    fn write_rows(&self, rows: &mut Rows) {
        self.equation().cost.write_rows(rows);
    }
}

impl Equation {
    /// Writes `b` and the damping for velocities.
    fn request_velocity(&mut self) {
        let Self { error, response, correction, .. } = self;
        let Response { gain, max_speeds, damping, .. } = *response;
        correction.zip_apply(error, |correction, error| *correction = error * gain);
        let mut excess = 0.0_f64;
        for (block, speed) in correction.as_slice().chunks(3).zip(max_speeds) {
            if speed < f64::INFINITY {
                excess = excess.max(length(block.iter().copied()) / speed);
            }
        }
        if excess > 1.0 {
            correction.apply(|correction| *correction /= excess);
        }
        self.select(false);
        let Self { rate, cost, correction, .. } = self;
        for ((desired, correction), rate) in cost.desired_mut().iter_mut().zip(&*correction).zip(&*rate) {
            *desired = correction + rate;
        }
        self.damping = 0.0;
        if damping > 0.0 {
            self.select(true);
            let weighted = self.cost.weights().iter().zip(&self.correction).map(|(w, c)| w * w * c);
            self.damping = damping * length(weighted);
        }
    }
}
