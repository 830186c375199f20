//! The rolling task of `control.qp`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::held::OnMotions;
use super::{ActsOn, HeldTask, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS};
use crate::tasks::RollingTask;

/// A rolling task: the point of a wheel that touches the ground rests.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RollingConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "rolling".
    pub name: String,
    /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
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
    /// With `inverse_dynamics`: decay rate of velocity errors of the contact point, 1/s, 0 to 1000; limited
    /// to half the tick rate. Default 20.
    pub rate: Option<f64>,
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
            rate: None,
        }
    }
}

impl RollingConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<RollingTask, ConfigError> {
        let frame = place.named_frame("frame", &self.frame)?;
        let (axis, normal) = (place.axis("axis", self.axis)?, place.axis("normal", self.normal)?);
        let radius = place.in_range("radius", self.radius, 1e-6..=1e3)?;
        let weight = place.in_range("weight", self.weight, WEIGHTS)?;
        let rate = place.rate(self.rate)?;
        Ok(RollingTask::new(place.model, frame, axis, radius).on(normal).weight(weight).rate(rate))
    }
}

impl TaskKind for RollingConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).acts_on(ActsOn::Joints)
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![TaskParameter::new(
            "weight",
            self.weight,
            WEIGHTS,
            "1/(m/s)",
            "cost of a velocity of the contact point",
        )]
    }

    fn declare(&self, place: &TaskPlace<'_>, _: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        Ok(Box::new(OnMotions {
            task: self.build(place)?,
            parameters: self.open(setup)?,
            apply: |task, [weight], _| task.set_weight(weight),
        }))
    }
}
