//! Names of contradictory constraints, as in the configuration.

use motorium_robots::Model;

use super::setup::RowLimits;
use crate::inverse_dynamics::{Conflicting, ConstraintName, Contact};
use crate::tasks::Held;

/// Names of the rows of limits and constraint tasks, in the order in which a controller adds them.
pub(super) struct ConstraintRows {
    tasks: Rows,
    limits: Rows,
}

/// Names with their numbers of rows.
#[derive(Default)]
struct Rows(Vec<(String, usize)>);

impl Rows {
    fn push(&mut self, name: String, rows: usize) {
        self.0.push((name, rows));
    }

    /// Returns the name of a row and its index among the rows of this name.
    fn name(&self, row: usize) -> String {
        let mut first = 0;
        for (name, rows) in &self.0 {
            if row - first < *rows {
                return format!("{name}, row {}", row - first);
            }
            first += rows;
        }
        format!("row {row}")
    }
}

impl ConstraintRows {
    pub(super) fn new(held: &mut [Held], of_robot: &RowLimits) -> Self {
        let (mut tasks, mut limits) = (Rows::default(), Rows::default());
        for held in held {
            let (rows, soft) = held.task.cost().rows();
            let name = format!("task `{}`", held.name);
            match held.is_constraint {
                true => tasks.push(name, rows),
                false => limits.push(name, soft),
            }
        }
        for (name, limit) in of_robot.names.iter().zip(&of_robot.rows) {
            limits.push(format!("`{name}`"), limit.rows());
        }
        limits.push("`limits.support`".to_owned(), usize::MAX);
        Self { tasks, limits }
    }

    /// Describes contradictory constraints with the names of the configuration.
    pub(super) fn describe(&self, conflict: &Conflicting, model: &Model, contacts: &[Contact]) -> String {
        let descriptions = conflict.names().map(|name| match name {
            ConstraintName::Limit { row, side } => format!("{side} side of {}", self.limits.name(row)),
            ConstraintName::Task { row } => self.tasks.name(row),
            name => name.describe(model, contacts).to_string(),
        });
        descriptions.collect::<Vec<_>>().join(", ")
    }
}
