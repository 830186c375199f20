//! Velocity errors.

use crate::formulation::Equation;
use crate::state::MotionState;

/// Default rate at which velocity errors decay with accelerations \[1/s\].
pub(super) const RATE: f64 = 20.0;

/// Differentiates the equation of a task on all velocities. At acceleration level, a floating base is left to
/// other tasks.
pub(super) fn differentiate_velocities(equation: &mut Equation, state: &MotionState<'_>) {
    let base = state.model.nv() - state.model.joint_count();
    equation.weights_mut().rows_mut(0, base).fill(0.0);
    for (error_rate, (rate, v)) in equation.error_rate.iter_mut().zip(equation.rate.iter().zip(state.v)) {
        *error_rate = rate - v;
    }
}
