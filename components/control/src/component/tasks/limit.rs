//! The task of `control.qp` that consists of soft limits.

use motorium::prelude::*;
use motorium_robots::World;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    Fades, Formulations, HeldTask, Ramped, TaskBounds, TaskHead, TaskKind, TaskParameter, TaskPlace, WEIGHTS,
};
use crate::component::{collision_limits::CollisionConfig, frame_limits::FrameLimitConfig};
use crate::limits::RowLimit;

/// A task of soft limits: they yield to tasks of smaller level numbers, and partially to tasks of the same
/// level.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LimitConfig {
    /// Name of the task, used as a prefix of its parameter names. Default "limit".
    pub name: String,
    /// Level of the task, 1 to 8. Default 1.
    pub level: u32,
    /// Cost of a velocity beyond a limit, 1/(m/s) or 1/(rad/s), more than 0, at most 1000. Default 10.
    pub weight: f64,
    /// Boxes and speeds of frames, as in `limits.frames`.
    pub frames: Vec<FrameLimitConfig>,
    /// Distances between links, as in `limits.collision`.
    pub collision: Option<CollisionConfig>,
}

impl Default for LimitConfig {
    fn default() -> Self {
        Self { name: "limit".to_owned(), level: 1, weight: 10.0, frames: Vec::new(), collision: None }
    }
}

impl LimitConfig {
    fn build(&self, place: &TaskPlace<'_>) -> Result<Vec<Box<dyn RowLimit>>, ConfigError> {
        let mut limits = Vec::new();
        for (index, frame) in self.frames.iter().enumerate() {
            let path = place.key(&format!("frames[{index}]"));
            frame.build(&path, place.model, place.profile, &mut limits)?;
        }
        if let Some(collision) = &self.collision {
            limits.push(Box::new(collision.build(
                &place.key("collision"),
                place.model,
                place.profile,
                place.world,
            )?));
        }
        if limits.is_empty() {
            return Err(ConfigError::key(&place.path, "a task without a limit")
                .advise("add `frames` or `collision`, as under `limits`"));
        }
        Ok(limits)
    }
}

impl TaskKind for LimitConfig {
    fn head(&self) -> TaskHead<'_> {
        TaskHead::new(&self.name, self.level).only(Formulations::Velocity(
            "with `inverse_dynamics` limits stand under `limits`, where they give way by the policy of `on_infeasible`",
        ))
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        vec![TaskParameter::new(
            "weight",
            self.weight,
            1e-6..=*WEIGHTS.end(),
            "1/(m/s)",
            "cost of a velocity beyond a limit",
        )]
    }

    fn has_moving_objects(&self, world: &World) -> bool {
        self.collision.as_ref().is_some_and(|collision| collision.has_moving_objects(world))
    }

    fn declare(&self, place: &TaskPlace<'_>, _: &mut Declare) -> Result<(), ConfigError> {
        self.build(place)?;
        place.in_range("weight", self.weight, 1e-6..=*WEIGHTS.end())?;
        Ok(())
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        let [weight] = self.open(setup)?;
        Ok(Box::new(SoftLimits { limits: self.build(place)?, weight, cost: self.weight }))
    }
}

/// Soft limits.
struct SoftLimits {
    limits: Vec<Box<dyn RowLimit>>,
    weight: Ramped,
    /// Cost at this step.
    cost: f64,
}

impl HeldTask for SoftLimits {
    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        self.cost = self.weight.follow(bounds, fades);
    }

    fn limits(&mut self) -> Option<(&mut [Box<dyn RowLimit>], f64)> {
        Some((&mut self.limits, self.cost))
    }
}
