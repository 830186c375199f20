//! Tasks of the robot, each as a least-squares cost on the joint velocity.

mod axes;
mod cartesian;
mod centre_of_mass;
mod contact;
mod gaze;
mod manipulability;
mod minimum_effort;
mod minimum_velocity;
mod momentum;
mod posture;
mod relative;
mod rigid_rotation;
mod rolling;
mod unicycle;

pub use axes::{AxisShares, PoseAxes};
pub use cartesian::{CartesianSettings, CartesianTask};
pub use centre_of_mass::{CentreOfMassSettings, CentreOfMassTask};
pub use contact::ContactTask;
pub(crate) use gaze::least_turn;
pub use gaze::{GazeSettings, GazeTask};
pub use manipulability::{ManipulabilityTask, Measure};
pub use minimum_effort::MinimumEffortTask;
pub use minimum_velocity::MinimumVelocityTask;
pub use momentum::MomentumTask;
pub use posture::{PostureSettings, PostureTask};
pub use relative::{RelativeSettings, RelativeTask};
pub use rigid_rotation::RigidRotationTask;
pub(crate) use rigid_rotation::SteeredWheel;
pub use rolling::RollingTask;
pub(crate) use rolling::RollingWheel;
pub use unicycle::{UnicycleSettings, UnicycleTask};

use nalgebra::{Dim, Dyn, Matrix, RawStorage};

pub use crate::cost::Cost;
pub use crate::levels::Rows;
use crate::{RobotState, solver::Problem};

/// A cost on the joint velocity `v` \[rad/s or m/s\]: `1/2 |W (A v - b)|^2`, convex and finite for every `v`.
pub trait Task {
    /// Maximum number of rows of `A`.
    fn rows(&self) -> usize;

    /// Evaluates error, `A` and `b` at this state.
    fn update(&mut self, state: &RobotState<'_>);

    /// Length of `A v - b` as of the last update over the rows with a weight, in the units of the task \[m/s,
    /// rad/s\].
    fn residual(&self, velocity: &[f64]) -> f64;

    /// Adds the cost as of the last update to the quadratic and the linear part of `problem` (upper triangle
    /// of the Hessian), whose unknowns are the joint velocities.
    fn add_to(&self, problem: &mut Problem);

    /// Appends the rows of `W A`, and of `W b`, as of the last update: at most [`rows`](Self::rows) of them,
    /// for a row without weight may be left out.
    fn write_rows(&self, rows: &mut Rows);
}

/// Length of `A v - b` over these rows.
fn residual<R: Dim, S: RawStorage<f64, R, Dyn>>(
    rows: impl IntoIterator<Item = usize>,
    matrix: &Matrix<f64, R, Dyn, S>,
    desired: &[f64],
    velocity: &[f64],
) -> f64 {
    let of_row = |row: usize| {
        let product: f64 = (0..velocity.len()).map(|column| matrix[(row, column)] * velocity[column]).sum();
        product - desired[row]
    };
    rows.into_iter().map(|row| of_row(row).powi(2)).sum::<f64>().sqrt()
}
