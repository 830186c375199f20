//! The contact wrench task of `control.qp`.

use motorium::prelude::*;
use motorium_robots::Twist;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    ActsOn, Fades, Formulations, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace,
    WEIGHTS,
};
use crate::inverse_dynamics::tasks::{AccelerationTask, ContactWrench};

/// A contact wrench task: force and torque of a contact follow a target; with `inverse_dynamics`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ContactWrenchConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "contact_wrench".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
    pub level: u32,
    /// Name of the contact, as in `inverse_dynamics`.
    pub contact: String,
    /// Name of the input port of the target: the wrench exerted by the world on the robot, in world axes
    /// about the origin of the contact's frame. Without a target, `force` and `torque` apply. Default
    /// "wrench_target".
    pub target: String,
    /// Force without a target, axes of the world, N. Default [0, 0, 0].
    pub force: [f64; 3],
    /// Torque without a target, axes of the world, Nm. Default [0, 0, 0].
    pub torque: [f64; 3],
    /// Cost of a force error, 1/N, 0 to 1000. Default 1e-2.
    pub force_weight: f64,
    /// Cost of a torque error, 1/Nm, 0 to 1000. Default 1e-2.
    pub torque_weight: f64,
}

impl Default for ContactWrenchConfig {
    fn default() -> Self {
        Self {
            name: "contact_wrench".to_owned(),
            level: 1,
            contact: String::new(),
            target: "wrench_target".to_owned(),
            force: [0.0; 3],
            torque: [0.0; 3],
            force_weight: 1e-2,
            torque_weight: 1e-2,
        }
    }
}

impl ContactWrenchConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<ContactWrench, ConfigError> {
        let contact = place.contact("contact", &self.contact)?;
        for value in self.force.iter().chain(&self.torque) {
            place.in_range("force", *value, f64::MIN..=f64::MAX)?;
        }
        let force = place.in_range("force_weight", self.force_weight, WEIGHTS)?;
        let torque = place.in_range("torque_weight", self.torque_weight, WEIGHTS)?;
        let mut task =
            ContactWrench::for_contact(place.model, place.contacts, contact).weights(force, torque);
        task.set_target(Twist { linear: self.force.into(), angular: self.torque.into() });
        Ok(task)
    }
}

impl TaskKind for ContactWrenchConfig {
    fn head(&self) -> TaskHead<'_> {
        let head = TaskHead::new(&self.name, self.level).target(&self.target);
        head.only(Formulations::Torque).acts_on(ActsOn::Forces)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![
            TaskParameter::new("force_weight", self.force_weight, WEIGHTS, "1/N", "cost of a force error"),
            TaskParameter::new(
                "torque_weight",
                self.torque_weight,
                WEIGHTS,
                "1/Nm",
                "cost of a torque error",
            ),
        ]
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let doc = "force and torque of the contact on the robot, in the axes of the world";
        declare.optional_input::<Wrench>(&self.target, doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let (task, input, weights) = (self.build(place)?, setup.input(&self.target)?, self.open(setup)?);
        Ok(Box::new(HeldWrench { task, input, weights }))
    }
}

/// A contact whose wrench follows an input.
struct HeldWrench {
    task: ContactWrench,
    input: Input<Wrench>,
    weights: [Ramped; 2],
}

impl HeldTask for HeldWrench {
    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let [force, torque] = self.weights.each_mut().map(|parameter| parameter.follow(bounds, fades));
        self.task.set_weights(force, torque);
    }

    fn prepare(&mut self, _: &TaskBounds) {
        if let Some(target) = self.input.latest() {
            self.task.set_target(Twist { linear: target.force.into(), angular: target.torque.into() });
        }
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        Some(&mut self.task)
    }
}
