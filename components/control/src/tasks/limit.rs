//! Soft limits as a task.

use motorium::prelude::*;
use motorium_worlds::World;

use super::context::TaskContext;
use super::held::{HeldTask, TaskCost};
use super::kind::{BuiltTask, Formulations, TaskHead, TaskKind, TaskTable, WEIGHTS};
use super::ramp::{Fades, Ramped, TaskBounds};
use crate::limits::{CollisionConfig, FrameLimitConfig, RowLimit};

task_config! {
    /// A limit task: soft limits that yield to tasks with lower level numbers, and partially to tasks on the
    /// same level.
    LimitConfig "limit" {
        /// Cost of a velocity beyond a limit, 1/(m/s) or 1/(rad/s), more than 0, at most 1000. Default 10.
        weight: f64 = 10.0 => live(1e-6..=*WEIGHTS.end(), "1/(m/s)", "cost of a velocity beyond a limit");
        /// Limits of the positions and velocities of frames, as in `limits.frames`.
        frames: Vec<FrameLimitConfig> = Vec::new();
        /// Minimum distances of links from each other, from the ground and from objects, as in
        /// `limits.collision`.
        collision: Option<CollisionConfig> = None;
    }
}

impl LimitConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<Vec<Box<dyn RowLimit>>, ConfigError> {
        let mut limits = Vec::new();
        for (index, frame) in self.frames.iter().enumerate() {
            let path = context.key(&format!("frames[{index}]"));
            frame.build(&path, context.model, context.profile, &mut limits)?;
        }
        if let Some(collision) = &self.collision {
            limits.push(Box::new(collision.build(
                &context.key("collision"),
                context.model,
                context.profile,
                context.world,
            )?));
        }
        if limits.is_empty() {
            return Err(ConfigError::key(&context.path, "a task without a limit")
                .advise("add `frames` or `collision`, as under `limits`"));
        }
        Ok(limits)
    }
}

impl TaskKind for LimitConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().only(Formulations::Velocity(
            "with `inverse_dynamics`, list limits under `limits`, where `on_infeasible` decides how they are relaxed",
        ))
    }

    fn has_moving_objects(&self, world: &World) -> bool {
        self.collision.as_ref().is_some_and(|collision| collision.has_moving_objects(world))
    }

    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let [weight] = self.open(setup)?;
        Ok(Box::new(SoftLimits { limits: self.build(context)?, weight, cost: self.weight }))
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

    fn cost(&mut self) -> TaskCost<'_> {
        TaskCost::Limits(&mut self.limits, self.cost)
    }
}
