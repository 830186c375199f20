//! Names of contradictory constraints, as in the configuration.

use motorium_robots::Model;

use super::setup::RowLimits;
use super::tasks::Held;
use crate::inverse_dynamics::{Conflicting, ConstraintName, Contact};
use crate::solver::Side;
use crate::{IkConflict, IkConstraint};

/// Names of the rows of limits and constraint tasks, in the order in which a controller adds them.
pub(super) struct ConstraintRows {
    held: Rows,
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
    pub(super) fn new(tasks: &mut [Held], of_robot: &RowLimits) -> Self {
        let (mut held, mut limits) = (Rows::default(), Rows::default());
        for Held { name, task, .. } in tasks {
            if task.is_constraint() {
                held.push(format!("task `{name}`"), task.rows());
            }
            if let Some((rows, _)) = task.limits() {
                limits.push(format!("task `{name}`"), rows.iter().map(|limit| limit.rows()).sum());
            }
        }
        for (name, limit) in of_robot.names.iter().zip(&of_robot.rows) {
            limits.push(format!("`{name}`"), limit.rows());
        }
        limits.push("`limits.support`".to_owned(), usize::MAX);
        Self { held, limits }
    }

    /// Names the contradictory velocity constraints as in the configuration.
    pub(super) fn describe_velocities(&self, conflict: &IkConflict, model: &Model) -> String {
        let base = model.nv() - model.joint_count();
        let words = conflict.constraints().map(|constraint| match constraint {
            IkConstraint::Held { row } => self.held.name(row),
            IkConstraint::Limit { row, side } => format!("{} side of {}", word(side), self.limits.name(row)),
            IkConstraint::Joint { velocity, side } => match velocity.checked_sub(base) {
                Some(joint) => {
                    let joint = &model.joint_names()[joint];
                    format!("{} position or velocity limit of joint `{joint}`", word(side))
                }
                None => format!("{} bound of velocity {velocity} of the base", word(side)),
            },
        });
        words.collect::<Vec<_>>().join(", ")
    }

    /// Names the contradictory torque and force constraints as in the configuration.
    pub(super) fn describe_torques(
        &self,
        conflict: &Conflicting,
        model: &Model,
        contacts: &[Contact],
    ) -> String {
        let words = conflict.names().map(|name| match name {
            ConstraintName::Limit { row, side } => {
                format!("{} side of {}", word(side), self.limits.name(row))
            }
            ConstraintName::Task { row } => self.held.name(row),
            name => name.describe(model, contacts).to_string(),
        });
        words.collect::<Vec<_>>().join(", ")
    }
}

fn word(side: Side) -> &'static str {
    match side {
        Side::Lower => "lower",
        Side::Upper => "upper",
    }
}
