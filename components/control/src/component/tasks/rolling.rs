//! The rolling task of `control.qp`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::held::OnVelocities;
use super::{Formulations, HeldTask, TaskKind, TaskPlace, WEIGHTS};
use crate::tasks::RollingTask;

/// A rolling task: the point of a wheel that touches the ground rests.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RollingConfig {
    /// Name of the task, with which the names of its parameters begin. Default "rolling".
    pub name: String,
    /// Level of the task, 1 to 8: it decides only what the tasks of smaller numbers leave open. Default 1.
    pub level: u32,
    /// Link of the wheel: the origin of its frame is the centre of the wheel.
    pub frame: String,
    /// Axis of the wheel, in the axes of its frame. Default [0, 1, 0].
    pub axis: [f64; 3],
    /// Radius of the wheel, m, more than 0.
    pub radius: f64,
    /// Normal of the ground, in the axes of the world. Default [0, 0, 1].
    pub normal: [f64; 3],
    /// Cost of a velocity of the contact point, 1/(m/s), 0 to 1000. Default 1.
    pub weight: f64,
}

impl Default for RollingConfig {
    fn default() -> Self {
        Self {
            name: "rolling".to_owned(),
            level: 1,
            frame: String::new(),
            axis: [0.0, 1.0, 0.0],
            radius: 0.0,
            normal: [0.0, 0.0, 1.0],
            weight: 1.0,
        }
    }
}

impl RollingConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<RollingTask, ConfigError> {
        let frame = place.named_frame("frame", &self.frame)?;
        let (axis, normal) = (place.axis("axis", self.axis)?, place.axis("normal", self.normal)?);
        let radius = place.in_range("radius", self.radius, 1e-6..=1e3)?;
        let weight = place.in_range("weight", self.weight, WEIGHTS)?;
        Ok(RollingTask::new(place.model, frame, axis, radius).on(normal).weight(weight))
    }
}

impl TaskKind for RollingConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn level(&self) -> u32 {
        self.level
    }

    fn formulations(&self) -> Formulations {
        Formulations::Velocity
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        let (name, doc) = (format!("{}_weight", self.name), "cost of a velocity of the contact point");
        declare.float(&name, self.weight, WEIGHTS, "1/(m/s)", doc);
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        Ok(Box::new(OnVelocities {
            task: self.build(place)?,
            parameters: [setup.parameter(&format!("{}_weight", self.name))?],
            apply: |task, [weight]| task.set_weight(weight),
        }))
    }
}
