//! The joints move to where a frame is moved more easily.

use motorium_robots::{FrameId, Model, TaskRows};

use super::{Cost, Rows, Task};
use crate::{RobotState, solver::Problem};

/// Joint velocities follow the slope of the manipulability `m` of a frame, away from singular configurations:
///
/// ```text
/// m = sqrt(det(J J'))                             Yoshikawa's measure of the rows that count
/// A = 1 on all velocities,   b = gain dm/dq,   W = weight       1/(rad/s)
/// ```
///
/// (OpenSoT's task.) In a singular configuration there is no slope, and the joints are asked to rest. A floating base is asked to
/// rest, too: it does not change the measure.
#[derive(Clone, Debug)]
pub struct ManipulabilityTask {
    frame: FrameId,
    rows: TaskRows,
    gain: f64,
    weight: f64,
    measure: f64,
    cost: Cost,
}

impl ManipulabilityTask {
    /// A task for `frame` of `model` and these rows of its velocity, with gain 1 and weight 1e-2.
    pub fn new(model: &Model, frame: FrameId, rows: TaskRows) -> Self {
        let cost = Cost::identity(0, model.nv());
        Self { frame, rows, gain: 1.0, weight: 1e-2, measure: 0.0, cost }
    }

    /// The same task with a gain \[(rad/s)^2 per unit of the measure\] and a weight \[1/(rad/s)\].
    #[must_use]
    pub fn with(mut self, gain: f64, weight: f64) -> Self {
        (self.gain, self.weight) = (gain, weight);
        self
    }

    /// The manipulability at the last update.
    pub fn measure(&self) -> f64 {
        self.measure
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl Task for ManipulabilityTask {
    fn rows(&self) -> usize {
        self.cost.rows()
    }

    fn update(&mut self, state: &RobotState<'_>) {
        let slope = self.cost.desired_mut().as_mut_slice();
        self.measure = state.kinematics.manipulability_gradient(state.model, self.frame, self.rows, slope);
        slope.iter_mut().for_each(|slope| *slope *= self.gain);
        self.cost.weights_mut().fill(self.weight);
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
