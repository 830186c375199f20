//! Minimises drive torques.

use motorium_robots::Model;

use super::Cost;
use crate::MotionState;
use crate::contact::Contact;
use crate::inverse_dynamics::{AccelerationTask, InverseDynamics};

/// Minimises drive torques:
///
/// ```text
/// A = (M_a, -J_a')                         the rows of the joints, on accelerations and contact forces
/// b = -h_a                                 so that A x - b = tau
/// W = weight diag(1 / tau_max)             a torque as a share of its limit; of 1 Nm where there is no limit
/// ```
#[derive(Clone, Debug)]
pub struct TorqueMinimum {
    weight: f64,
    scale: Vec<f64>,
    cost: Cost,
}

methods!(TorqueMinimum: weight("1"), set_weight);

impl TorqueMinimum {
    /// Creates a task for all drives of `model`, the robot of `dynamics`, with weight 1.
    pub fn new(model: &Model, dynamics: &InverseDynamics) -> Self {
        Self::with_variables(model, dynamics.variables())
    }

    /// Creates a task for inverse dynamics with these contacts.
    pub(crate) fn for_contacts(model: &Model, contacts: &[Contact]) -> Self {
        let points: usize = contacts.iter().map(Contact::points).sum();
        Self::with_variables(model, model.nv() + 3 * points)
    }

    fn with_variables(model: &Model, variables: usize) -> Self {
        let share = |limit: &f64| if limit.is_finite() && *limit > 0.0 { 1.0 / limit } else { 1.0 };
        Self {
            weight: 1.0,
            scale: model.effort_limit().iter().map(share).collect(),
            cost: Cost::dense(model.joint_count(), 0, variables),
        }
    }
}

impl AccelerationTask for TorqueMinimum {
    fn update(&mut self, state: &MotionState<'_>, dynamics: &InverseDynamics) {
        let joints = state.model.joint_count();
        let base = state.model.nv() - joints;
        self.cost.matrix_mut().copy_from(&dynamics.problem.row_matrix.rows(0, joints));
        for (joint, scale) in self.scale.iter().enumerate() {
            self.cost.desired_mut()[joint] = -dynamics.bias[base + joint];
            self.cost.weights_mut()[joint] = self.weight * scale;
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
