//! Order of the constraints in a problem of inverse dynamics.

use motorium_qp::{Conflict, Constraint};

use crate::conflict::{Conflicting, ConstraintName};

/// Order of the constraints in a problem.
#[derive(Clone, Debug)]
pub(crate) struct Order {
    /// Equations of motion of the base: 6 for a floating base, otherwise 0.
    pub(super) base: usize,
    /// Velocities, base and joints.
    pub(crate) velocities: usize,
    /// Independent joints.
    pub(super) joints: usize,
    /// Contact and axis of each row of contact motion.
    pub(super) motions: Vec<(usize, usize)>,
    /// Contact and point of each contact force.
    pub(super) points: Vec<(usize, usize)>,
    /// Rows of tasks that are constraints.
    pub(super) constrained: usize,
    /// Contact of each row of a wrench cone.
    pub(super) wrenches: Vec<usize>,
    /// Rows of limits.
    pub(super) limits: usize,
}

impl Order {
    /// Number of unknowns: accelerations, then three numbers for each contact point.
    pub(super) fn variables(&self) -> usize {
        self.velocities + 3 * self.points.len()
    }

    /// Equalities: the base, then the motion of the contacts, then tasks.
    pub(super) fn equalities(&self) -> usize {
        self.base + self.motions.len() + self.constrained
    }

    /// Rows: torques, then four faces of each friction pyramid, then wrench cones, then limits.
    pub(super) fn rows(&self) -> usize {
        self.first_limit() + self.limits
    }

    /// First row of the limits.
    pub(super) fn first_limit(&self) -> usize {
        self.joints + 4 * self.points.len() + self.wrenches.len()
    }

    /// Returns the name of a constraint of the problem.
    pub(super) fn name(&self, constraint: Constraint) -> Option<ConstraintName> {
        match constraint {
            Constraint::Equality(row) if row < self.base => Some(ConstraintName::Base { axis: row }),
            Constraint::Equality(row) => {
                let Some((contact, axis)) = self.motions.get(row - self.base).copied() else {
                    return Some(ConstraintName::Task { row: row - self.base - self.motions.len() });
                };
                Some(ConstraintName::Motion { contact, axis })
            }
            Constraint::Row(row, side) if row < self.joints => {
                Some(ConstraintName::Torque { joint: row, side })
            }
            Constraint::Row(row, side) if row >= self.first_limit() => {
                Some(ConstraintName::Limit { row: row - self.first_limit(), side })
            }
            Constraint::Row(row, _) if row >= self.joints + 4 * self.points.len() => {
                let contact = *self.wrenches.get(row - self.joints - 4 * self.points.len())?;
                Some(ConstraintName::Wrench { contact })
            }
            Constraint::Row(row, _) => {
                let (contact, point) = *self.points.get((row - self.joints) / 4)?;
                Some(ConstraintName::Friction { contact, point })
            }
            Constraint::Cone(point) => {
                let (contact, point) = *self.points.get(point)?;
                Some(ConstraintName::Friction { contact, point })
            }
            Constraint::Bound(variable, side) if variable < self.velocities => {
                let joint = variable.checked_sub(self.velocities - self.joints)?;
                Some(ConstraintName::Acceleration { joint, side })
            }
            Constraint::Bound(variable, side) => {
                let (contact, point) = *self.points.get((variable - self.velocities) / 3)?;
                Some(ConstraintName::Force { contact, point, side })
            }
        }
    }

    pub(super) fn conflicting(&self, conflict: &Conflict) -> Conflicting {
        conflict.constraints().filter_map(|constraint| self.name(constraint)).collect()
    }
}
