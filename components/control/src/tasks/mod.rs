//! Tasks of the robot: the equations of their errors, from which the formulations make costs.
//!
//! Most tasks are a [`Task`], for velocities and for accelerations alike. Those that implement only
//! [`VelocityTask`] are for velocities.

/// Defines the methods of a task with settings, which determine its response.
macro_rules! settings {
    ($task:ident, $settings:ident) => {
        impl $task {
            /// The same task with these settings.
            #[must_use]
            pub fn with(mut self, settings: $settings) -> Self {
                self.set_settings(settings);
                self
            }

            /// Changes the settings from the next update on. Accelerations reduce the error critically
            /// damped at the gain.
            pub fn set_settings(&mut self, settings: $settings) {
                self.settings = settings;
                self.equation.response = settings.response();
            }

            /// The settings.
            pub fn settings(&self) -> &$settings {
                &self.settings
            }

            /// The same task with another feedback of accelerations. [`set_settings`](Self::set_settings)
            /// replaces it.
            #[must_use]
            pub fn feedback(mut self, feedback: Feedback) -> Self {
                self.equation.response.feedback = feedback;
                self
            }

            /// The cost as of the last update.
            pub fn cost(&self) -> &Cost {
                self.equation.cost()
            }
        }
    };
}

/// Defines the builder of the weight of a task with settings.
macro_rules! weight {
    ($task:ident) => {
        impl $task {
            /// The same task with another weight.
            #[must_use]
            pub fn weight(mut self, weight: f64) -> Self {
                self.settings.weight = weight;
                self
            }
        }
    };
}

/// Defines the accessors that [`Task`] requires.
macro_rules! equation {
    () => {
        fn equation(&self) -> &Equation {
            &self.equation
        }

        fn equation_mut(&mut self) -> &mut Equation {
            &mut self.equation
        }
    };
}

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
pub use cartesian::{CartesianImpedance, CartesianSettings, CartesianTask, PoseError};
pub use centre_of_mass::{CentreOfMassSettings, CentreOfMassTask};
pub use contact::ContactTask;
pub use gaze::{GazeSettings, GazeTask};
pub use manipulability::{ManipulabilityTask, Measure};
pub use minimum_effort::MinimumEffortTask;
pub use minimum_velocity::MinimumVelocityTask;
pub use momentum::MomentumTask;
pub use posture::{PostureSettings, PostureTask};
pub use relative::{RelativeSettings, RelativeTask};
pub use rigid_rotation::RigidRotationTask;
pub use rolling::RollingTask;
pub use unicycle::{UnicycleSettings, UnicycleTask};

use nalgebra::{Const, Dyn, MatrixView, U1};

use crate::MotionState;
pub use crate::cost::Cost;
pub use crate::formulation::{Equation, Feedback, Response, Task, VelocityTask};
pub use crate::levels::Rows;

/// The Jacobian of a task with `R` rows, R x nv.
pub type JacobianView<'a, const R: usize> = MatrixView<'a, f64, Const<R>, Dyn, U1, Dyn>;

/// Rate at which accelerations reduce an error of a velocity, unless another is set \[1/s\].
const RATE: f64 = 20.0;

/// Differentiates the equation of a task on all velocities. At the level of accelerations a floating base is
/// left to other tasks.
fn differentiate_velocities(equation: &mut Equation, state: &MotionState<'_>) {
    let base = state.model.nv() - state.model.joint_count();
    equation.weights_mut().rows_mut(0, base).fill(0.0);
    for (error_rate, (rate, v)) in equation.error_rate.iter_mut().zip(equation.rate.iter().zip(state.v)) {
        *error_rate = rate - v;
    }
}
