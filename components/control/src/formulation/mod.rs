//! Formulations: costs made of the equations of tasks.
//!
//! A [`Task`] states an error `e` of the robot, and how it changes with the joint velocity `v`:
//!
//! ```text
//! e'  = nu  - J v                    nu: rate of the target
//! e'' = nu' - J' v - J a             at the acceleration a
//! ```
//!
//! It does not know the unknowns of the controller. A formulation turns the equation into a least-squares
//! cost `1/2 |W (J x - b)|^2` on its unknowns `x`:
//!
//! | formulation | unknowns | desired value |
//! |---|---|---|
//! | [`VelocityTask`] | `v` | `b = gain e + nu` |
//! | [`AccelerationTask`] | `a` | `b = kp e + kd e' + nu' - J' v` |
//!
//! [`AccelerationTask`]: crate::inverse_dynamics::AccelerationTask
//!
//! Each task is both. Costs on contact forces, torques or bounds implement one of the two traits directly, so
//! their types say which controller they are for.

mod acceleration;
mod velocity;

pub use acceleration::Feedback;
pub(crate) use acceleration::Impedance;
pub use velocity::VelocityTask;

use nalgebra::{DMatrix, DVector, Matrix3};

use crate::cost::Cost;
use crate::state::{MotionState, RobotState};

/// A motion of the robot with an error, whose equation holds for velocities and for accelerations.
///
/// A task keeps its [`Equation`], whose memory is allocated at construction. A tick evaluates it with
/// [`evaluate`](Self::evaluate), and for accelerations with [`differentiate`](Self::differentiate)
/// afterwards.
pub trait Task {
    /// Evaluates `e`, `J`, `nu` and the weights `W` at `state`.
    fn evaluate(&mut self, state: &RobotState<'_>);

    /// Evaluates `e'`, `nu'` and `J' v` at `state`, which was [evaluated](Self::evaluate) before.
    fn differentiate(&mut self, state: &MotionState<'_>);

    /// The equation as of the last evaluation.
    fn equation(&self) -> &Equation;

    /// The equation, to be written.
    fn equation_mut(&mut self) -> &mut Equation;
}

impl<T: Task + ?Sized> Task for &mut T {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        (**self).evaluate(state);
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        (**self).differentiate(state);
    }

    fn equation(&self) -> &Equation {
        (**self).equation()
    }

    fn equation_mut(&mut self) -> &mut Equation {
        (**self).equation_mut()
    }
}

/// The requested motion of an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Rate at which velocities reduce the error \[1/s\].
    pub gain: f64,
    /// Feedback by which accelerations reduce the error.
    pub feedback: Feedback,
    /// Largest speeds of the correction: of the first three rows, and of the following three \[units of `e`
    /// per second\]. The direction is kept. Default infinite.
    pub max_speeds: [f64; 2],
    /// Levenberg-Marquardt damping per speed of the correction, for velocities. Default 0.
    pub damping: f64,
}

impl Response {
    /// An error that decays at the rate `gain` \[1/s\]: exponentially by velocities, critically damped by
    /// accelerations.
    pub fn decay(gain: f64) -> Self {
        let (feedback, max_speeds) = (Feedback::critical(gain), [f64::INFINITY; 2]);
        Self { gain, feedback, max_speeds, damping: 0.0 }
    }

    /// The velocity `nu` without an error of the position: reached at once by velocities, at the `rate`
    /// \[1/s\] by accelerations.
    pub fn velocity(rate: f64) -> Self {
        Self { gain: 0.0, feedback: Feedback { kp: 0.0, kd: rate }, ..Self::decay(0.0) }
    }
}

/// The equation of a task at a state, and the cost that a formulation makes of it.
#[derive(Clone, Debug)]
pub struct Equation {
    /// `e`, one entry per row; zero for a task without a position.
    pub error: DVector<f64>,
    /// `nu`, the rate of the target: `e' = nu - J v`.
    pub rate: DVector<f64>,
    /// `nu'`.
    pub rate_derivative: DVector<f64>,
    /// `e'` at the velocity of the robot.
    pub error_rate: DVector<f64>,
    /// `J' v`, the part of `(J v)'` that no acceleration changes.
    pub drift: DVector<f64>,
    /// The requested motion of the error.
    pub response: Response,
    /// Factors `S` of the first and the following three rows, which the error `e` and its rate do not
    /// contain; `J`, `nu`, `nu'` and `J' v` do. A formulation requests `S e`. Default: the identity.
    pub selection: Option<[Matrix3<f64>; 2]>,
    cost: Cost,
    /// `gain e`, slowed to the largest speeds.
    correction: DVector<f64>,
    /// Levenberg-Marquardt damping as of the last update.
    damping: f64,
    impedance: Option<Impedance>,
}

impl Equation {
    /// `rows` rows on `width` velocities from `first` on: everything zero, all weights 1.
    pub fn dense(rows: usize, first: usize, width: usize) -> Self {
        Self::new(Cost::dense(rows, first, width))
    }

    /// `count` velocities from `first` on themselves: `J` the identity, everything else zero, all weights 1.
    pub fn identity(first: usize, count: usize) -> Self {
        Self::new(Cost::identity(first, count))
    }

    fn new(cost: Cost) -> Self {
        let zero = DVector::zeros(cost.rows());
        Self {
            error: zero.clone(),
            rate: zero.clone(),
            rate_derivative: zero.clone(),
            error_rate: zero.clone(),
            drift: zero.clone(),
            response: Response::decay(0.0),
            selection: None,
            cost,
            correction: zero,
            damping: 0.0,
            impedance: None,
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.error.len()
    }

    /// `J`, to be written.
    ///
    /// # Panics
    /// If `J` is the identity.
    pub fn jacobian_mut(&mut self) -> &mut DMatrix<f64> {
        self.cost.matrix_mut()
    }

    /// `J` as of the last evaluation.
    ///
    /// # Panics
    /// If `J` is the identity.
    pub fn jacobian(&self) -> &DMatrix<f64> {
        self.cost.matrix()
    }

    /// The diagonal of `W`, to be written.
    pub fn weights_mut(&mut self) -> &mut DVector<f64> {
        self.cost.weights_mut()
    }

    /// Replaces `correction` by `S correction`, or by `S' correction`.
    fn select(&mut self, transposed: bool) {
        let Some(factors) = &self.selection else { return };
        for (block, factor) in factors.iter().enumerate() {
            let mut rows = self.correction.fixed_rows_mut::<3>(3 * block);
            let selected = if transposed { factor.tr_mul(&rows) } else { factor * &rows };
            rows.copy_from(&selected);
        }
    }

    /// The cost as of the last update by a formulation.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}
