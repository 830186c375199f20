//! Makes the wrench of a contact follow a target.

use motorium::prelude::*;
use motorium_robots::{Model, Twist};
use nalgebra::Matrix3;

use super::Cost;
use super::context::TaskContext;
use super::held::Driven;
use super::kind::{ActsOn, BuiltTask, Formulations, TaskHead, TaskKind, TaskTable, WEIGHTS};
use crate::MotionState;
use crate::contact::Contact;
use crate::inverse_dynamics::{AccelerationTask, InverseDynamics};

/// Makes the force of one contact, and its torque about the origin of the contact's frame, follow a target in
/// world axes:
///
/// ```text
/// A = (   R        R    ... )           R: axes of the contact, on the forces of its points, at the arms r_i
///     ([r_1]x R [r_2]x R ...)           6 x 3 points
/// b = (f*, n*)                          N, Nm: the wrench of the world on the robot
/// W = diag(f, f, f, n, n, n)            1/N, 1/Nm
/// ```
///
/// PyRoboLearn has the same task. A point or ball contact transmits only the torque of its lever arm.
#[derive(Clone, Debug)]
pub struct ContactWrench {
    contact: usize,
    force_weight: f64,
    torque_weight: f64,
    target: Twist,
    cost: Cost,
}

impl ContactWrench {
    /// Creates a task for the contact with index `contact` of `dynamics`, with target zero and weights 1
    /// \[1/N, 1/Nm\].
    ///
    /// # Panics
    /// If `contact` is out of range.
    pub fn new(dynamics: &InverseDynamics, contact: usize) -> Self {
        let place = &dynamics.contacts[contact];
        let first = dynamics.order.velocities + 3 * place.first_point;
        let cost = Cost::dense(6, first, 3 * place.contact.points());
        Self { contact, force_weight: 1.0, torque_weight: 1.0, target: Twist::zero(), cost }
    }

    /// Creates a task for inverse dynamics of `model` with these contacts.
    pub(crate) fn for_contact(model: &Model, contacts: &[Contact], contact: usize) -> Self {
        let points: usize = contacts[..contact].iter().map(Contact::points).sum();
        let cost = Cost::dense(6, model.nv() + 3 * points, 3 * contacts[contact].points());
        Self { contact, force_weight: 1.0, torque_weight: 1.0, target: Twist::zero(), cost }
    }

    /// Sets the weights of the force \[1/N\] and of the torque \[1/Nm\]; 0 leaves the quantity free.
    #[must_use]
    pub fn weights(mut self, force: f64, torque: f64) -> Self {
        (self.force_weight, self.torque_weight) = (force, torque);
        self
    }

    /// Changes the weights from the next update on.
    pub fn set_weights(&mut self, force: f64, torque: f64) {
        (self.force_weight, self.torque_weight) = (force, torque);
    }

    /// Sets the target wrench in world axes. The linear part is the force \[N\]; the angular part is the
    /// torque \[N m\] about the origin of the contact's frame.
    pub fn set_target(&mut self, wrench: Twist) {
        self.target = wrench;
    }
}

impl AccelerationTask for ContactWrench {
    fn update(&mut self, _: &MotionState<'_>, dynamics: &InverseDynamics) {
        let place = &dynamics.contacts[self.contact];
        for (point, arm) in place.arms.iter().enumerate() {
            let turned: Matrix3<f64> = arm.cross_matrix() * place.axes;
            self.cost.matrix_mut().fixed_view_mut::<3, 3>(0, 3 * point).copy_from(&place.axes);
            self.cost.matrix_mut().fixed_view_mut::<3, 3>(3, 3 * point).copy_from(&turned);
        }
        let (force, torque) = (self.target.linear, self.target.angular);
        self.cost.desired_mut().fixed_rows_mut::<3>(0).copy_from(&force);
        self.cost.desired_mut().fixed_rows_mut::<3>(3).copy_from(&torque);
        let (force, torque) = (self.force_weight, self.torque_weight);
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(force);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(torque);
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}

task_config! {
    /// A contact-wrench task: force and torque of a contact follow a target. Requires `inverse_dynamics`.
    ContactWrenchConfig "contact_wrench" {
        /// Name of the contact in `inverse_dynamics`.
        contact: String = String::new();
        /// Name of the input port of the target: the wrench exerted by the world on the robot, in world axes
        /// about the origin of the contact's frame. Without a target, `force` and `torque` apply. Default
        /// "wrench_target".
        target: String = "wrench_target".to_owned() => target(
            optional Wrench, "force and torque of the contact on the robot, in the axes of the world"
        );
        /// Target force if the input has no target, world axes, N. Default [0, 0, 0].
        force: [f64; 3] = [0.0; 3];
        /// Target torque if the input has no target, world axes, Nm. Default [0, 0, 0].
        torque: [f64; 3] = [0.0; 3];
        /// Cost of a force error, 1/N, 0 to 1000. Default 1e-2.
        force_weight: f64 = 1e-2 => live(WEIGHTS, "1/N", "cost of a force error");
        /// Cost of a torque error, 1/Nm, 0 to 1000. Default 1e-2.
        torque_weight: f64 = 1e-2 => live(WEIGHTS, "1/Nm", "cost of a torque error");
    }
}

impl ContactWrenchConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<ContactWrench, ConfigError> {
        let contact = context.contact("contact", &self.contact)?;
        for value in self.force.iter().chain(&self.torque) {
            context.in_range("force", *value, f64::MIN..=f64::MAX)?;
        }
        let mut task = ContactWrench::for_contact(context.model, context.contacts, contact);
        task.set_target(Twist { linear: self.force.into(), angular: self.torque.into() });
        Ok(task)
    }
}

impl TaskKind for ContactWrenchConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().only(Formulations::Torque).acts_on(ActsOn::Forces)
    }

    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let mut input = setup.input::<Wrench>(&self.target)?;
        let task = Driven::forces(self.build(context)?, self.open(setup)?, |task, [force, torque], _| {
            task.set_weights(force, torque);
        });
        Ok(Box::new(task.following(move |task, _| {
            if let Some(target) = input.latest() {
                task.set_target(Twist { linear: target.force.into(), angular: target.torque.into() });
            }
        })))
    }
}
