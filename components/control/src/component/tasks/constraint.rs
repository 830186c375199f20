//! A task used as a constraint of `control.qp`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Fades, HeldTask, TaskBounds, TaskConfig, TaskHead, TaskKind, TaskParameter, TaskPlace};
use crate::inverse_dynamics::tasks::AccelerationTask;
use crate::tasks::VelocityTask;
use crate::{GoalRecord, RobotState};

/// A task as a constraint: it holds exactly, above all levels. Rows with zero weight stay free; otherwise
/// weights and damping are ignored.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstraintConfig {
    /// The task, a table with one key as in `tasks`; its `level` is ignored.
    pub task: Box<TaskConfig>,
}

impl ConstraintConfig {
    fn inner(&self) -> &dyn TaskKind {
        self.task.kind().1
    }

    fn task_place<'a>(&self, place: &TaskPlace<'a>) -> TaskPlace<'a> {
        place.within(&format!("task.{}", self.task.kind().0))
    }
}

impl TaskKind for ConstraintConfig {
    fn head(&self) -> TaskHead<'_> {
        self.inner().head()
    }

    fn parameters(&self) -> Vec<TaskParameter> {
        self.inner().parameters()
    }

    fn is_constraint(&self) -> bool {
        true
    }

    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        if let TaskConfig::Constraint(_) | TaskConfig::Limit(_) = *self.task {
            let (key, _) = self.task.kind();
            return Err(ConfigError::key(
                place.key("task"),
                format!("`{key}` is not a task that can hold exactly"),
            )
            .advise("name a task, such as task = { cartesian = {} }"));
        }
        self.inner().declare(&self.task_place(place), declare)
    }

    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError> {
        Ok(Box::new(Constraint(self.inner().configure(&self.task_place(place), setup)?)))
    }
}

/// A task that holds exactly.
struct Constraint(Box<dyn HeldTask>);

impl HeldTask for Constraint {
    fn begin(&mut self, start: &RobotState<'_>) {
        self.0.begin(start);
    }

    fn reset(&mut self) {
        self.0.reset();
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        self.0.weigh(bounds, fades);
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        self.0.prepare(bounds);
    }

    fn task(&mut self) -> Option<&mut dyn VelocityTask> {
        self.0.task()
    }

    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        self.0.acceleration()
    }

    fn while_lifted(&self) -> Option<usize> {
        self.0.while_lifted()
    }

    fn is_constraint(&self) -> bool {
        true
    }

    fn solved(&mut self, velocity: &[f64]) {
        self.0.solved(velocity);
    }

    fn record(&mut self, measured: &RobotState<'_>, dt: f64) {
        self.0.record(measured, dt);
    }

    fn goals(&self) -> Option<&GoalRecord> {
        self.0.goals()
    }

    fn result(&self) -> Option<serde_json::Value> {
        self.0.result()
    }
}
