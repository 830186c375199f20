//! Tasks that minimise contact forces, or make them follow a target.

use motorium_robots::Model;
use nalgebra::Vector3;

use super::Cost;
use crate::MotionState;
use crate::contact::Contact;
use crate::inverse_dynamics::{AccelerationTask, InverseDynamics};

/// Minimises contact forces, which spreads the load evenly over the points of all contacts:
///
/// ```text
/// A = the identity on all contact forces,   b = 0,   W = weight      1/N
/// ```
///
/// TSID has the same task, the force regularisation.
#[derive(Clone, Debug)]
pub struct ForceRegularisation {
    weight: f64,
    cost: Cost,
}

methods!(ForceRegularisation: weight("1/N"), set_weight);

impl ForceRegularisation {
    /// Creates a task for the contacts of `dynamics`, with weight 1e-3 \[1/N\].
    pub fn new(dynamics: &InverseDynamics) -> Self {
        let first = dynamics.mass().nrows();
        Self { weight: 1e-3, cost: Cost::identity(first, dynamics.variables() - first) }
    }

    /// Creates a task for inverse dynamics of `model` with these contacts.
    pub(crate) fn for_contacts(model: &Model, contacts: &[Contact]) -> Self {
        let points: usize = contacts.iter().map(Contact::points).sum();
        Self { weight: 1e-3, cost: Cost::identity(model.nv(), 3 * points) }
    }
}

impl AccelerationTask for ForceRegularisation {
    fn update(&mut self, _: &MotionState<'_>, _: &InverseDynamics) {
        let weight = self.weight;
        self.cost.weights_mut().fill(weight);
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}

/// Makes the force of one contact, the sum over its points, follow a target in world axes \[N\].
///
/// ```text
/// A = (R R ... R)                          R: axes of the contact, on the forces of its points, 3 x 3 points
/// b = f*,   W = weight                     1/N
/// ```
#[derive(Clone, Debug)]
pub struct ContactForce {
    contact: usize,
    weight: f64,
    target: Vector3<f64>,
    cost: Cost,
}

methods!(ContactForce: weight("1/N"));

impl ContactForce {
    /// Creates a task for the contact with index `contact` of `dynamics`, with target zero and weight 1
    /// \[1/N\].
    ///
    /// # Panics
    /// If `contact` is out of range.
    pub fn new(dynamics: &InverseDynamics, contact: usize) -> Self {
        let place = &dynamics.contacts[contact];
        let first = dynamics.order.velocities + 3 * place.first_point;
        let cost = Cost::dense(3, first, 3 * place.contact.points());
        Self { contact, weight: 1.0, target: Vector3::zeros(), cost }
    }

    /// Sets the target: the force that the world exerts on the robot \[N, world axes\].
    pub fn set_target(&mut self, force: Vector3<f64>) {
        self.target = force;
    }
}

impl AccelerationTask for ContactForce {
    fn update(&mut self, _: &MotionState<'_>, dynamics: &InverseDynamics) {
        let place = &dynamics.contacts[self.contact];
        for point in 0..place.contact.points() {
            self.cost.matrix_mut().fixed_view_mut::<3, 3>(0, 3 * point).copy_from(&place.axes);
        }
        let (target, weight) = (self.target, self.weight);
        self.cost.desired_mut().copy_from(&target);
        self.cost.weights_mut().fill(weight);
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
