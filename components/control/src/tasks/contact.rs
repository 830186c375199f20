//! Contact task: keeps a frame in place.

use motorium_qp::Problem;
use motorium_robots::{FrameId, Model, Reference};

use super::{Cost, Rows, VelocityTask};
use crate::RobotState;

/// Keeps a frame in contact with the world at rest:
///
/// ```text
/// A = J                                 Jacobian of the frame, world axes: 3 rows of a point, 6 of a surface
/// b = 0
/// W = weight                            1/(m/s), 1/(rad/s)
/// ```
///
/// OpenSoT has the same task. On the first of several [levels](crate::DifferentialIk::levels), the task holds
/// the feet of a floating-base robot in place.
#[derive(Clone, Debug)]
pub struct ContactTask {
    frame: FrameId,
    weight: f64,
    turns: bool,
    cost: Cost,
}

impl ContactTask {
    /// Creates a point contact: the origin of `frame` does not move; the frame may rotate.
    pub fn point(model: &Model, frame: FrameId) -> Self {
        Self { frame, weight: 1.0, turns: true, cost: Cost::dense(6, 0, model.nv()) }
    }

    /// Creates a surface contact: `frame` neither translates nor rotates.
    pub fn surface(model: &Model, frame: FrameId) -> Self {
        Self { turns: false, ..Self::point(model, frame) }
    }

    /// Sets the weight of the task \[1/(m/s), 1/(rad/s)\].
    #[must_use]
    pub fn weight(mut self, weight: f64) -> Self {
        self.weight = weight;
        self
    }

    /// Returns the cost of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl VelocityTask for ContactTask {
    fn rows(&self) -> usize {
        if self.turns { 3 } else { 6 }
    }

    fn update(&mut self, state: &RobotState<'_>) {
        let reference = Reference::LocalWorldAligned;
        state.kinematics.jacobian(state.model, self.frame, reference, self.cost.matrix_mut());
        let (weight, turning) = (self.weight, if self.turns { 0.0 } else { self.weight });
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(weight);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(turning);
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        self.cost.residual(velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        self.cost.add_to(problem);
    }

    fn write_rows(&self, rows: &mut Rows) {
        self.cost.write_rows(rows);
    }
}
