//! Names of the constraints of inverse dynamics.

use std::fmt;

use motorium_robots::Model;

use super::Contact;
use crate::solver::{Conflict, Constraint, Side};

/// One scalar constraint of inverse dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ConstraintName {
    /// Equation of motion of a floating base: force along x, y, z, then torque about them, in the axes of the
    /// base.
    Base {
        /// 0 to 5.
        axis: usize,
    },
    /// A contact does not move: along x, y, z of the world, then about them.
    Motion {
        /// Index of the contact.
        contact: usize,
        /// 0 to 5.
        axis: usize,
    },
    /// Torque limit of a joint.
    Torque {
        /// Index of the joint among the independent joints.
        joint: usize,
        /// Which limit.
        side: Side,
    },
    /// Friction cone of a contact point, or a face of its pyramid.
    Friction {
        /// Index of the contact.
        contact: usize,
        /// Point of the contact.
        point: usize,
    },
    /// A contact force pulls, or exceeds its limit.
    Force {
        /// Index of the contact.
        contact: usize,
        /// Point of the contact.
        point: usize,
        /// `Lower` for a force that pulls.
        side: Side,
    },
    /// Limit of the whole wrench of a sole.
    Wrench {
        /// Index of the contact.
        contact: usize,
    },
    /// Row of a limit of velocities.
    Limit {
        /// Index among the rows of all limits.
        row: usize,
        /// Which side.
        side: Side,
    },
    /// Row of a task that is a constraint.
    Task {
        /// Index among the rows of all constraint tasks.
        row: usize,
    },
    /// Position, velocity or acceleration limit of a joint.
    Acceleration {
        /// Index of the joint among the independent joints.
        joint: usize,
        /// Which limit.
        side: Side,
    },
}

impl ConstraintName {
    /// The constraint in words.
    pub fn describe<'a>(&self, model: &'a Model, contacts: &'a [Contact]) -> impl fmt::Display + use<'a> {
        Described { name: *self, model, contacts }
    }
}

struct Described<'a> {
    name: ConstraintName,
    model: &'a Model,
    contacts: &'a [Contact],
}

const AXES: [&str; 6] = ["along x", "along y", "along z", "about x", "about y", "about z"];

impl fmt::Display for Described<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let joint = |joint: usize| &self.model.joint_names()[joint];
        let contact = |contact: usize| &self.contacts[contact].name;
        let limit = |side: Side| if side == Side::Lower { "lower" } else { "upper" };
        match self.name {
            ConstraintName::Base { axis } => write!(f, "motion of the base {}", AXES[axis]),
            ConstraintName::Motion { contact: index, axis } => {
                write!(f, "contact `{}` at rest {}", contact(index), AXES[axis])
            }
            ConstraintName::Torque { joint: index, side } => {
                write!(f, "{} torque limit of joint `{}`", limit(side), joint(index))
            }
            ConstraintName::Friction { contact: index, point } => {
                write!(f, "friction of contact `{}` at point {point}", contact(index))
            }
            ConstraintName::Force { contact: index, point, side: Side::Lower } => {
                write!(f, "pull of contact `{}` at point {point}", contact(index))
            }
            ConstraintName::Force { contact: index, point, side: Side::Upper } => {
                write!(f, "largest force of contact `{}` at point {point}", contact(index))
            }
            ConstraintName::Wrench { contact: index } => write!(f, "wrench of contact `{}`", contact(index)),
            ConstraintName::Limit { row, side } => {
                write!(f, "{} side of row {row} of the limits", limit(side))
            }
            ConstraintName::Task { row } => write!(f, "row {row} of the tasks that are constraints"),
            ConstraintName::Acceleration { joint: index, side } => {
                write!(
                    f,
                    "{} position, velocity or acceleration limit of joint `{}`",
                    limit(side),
                    joint(index)
                )
            }
        }
    }
}

/// The constraints that contribute most to a conflict, strongest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conflicting([Option<ConstraintName>; Conflict::CAPACITY]);

impl Conflicting {
    /// The constraints, strongest first.
    pub fn names(&self) -> impl Iterator<Item = ConstraintName> + '_ {
        self.0.iter().flatten().copied()
    }

    /// All of them in words.
    pub fn describe(&self, model: &Model, contacts: &[Contact]) -> String {
        let words: Vec<_> = self.names().map(|name| name.describe(model, contacts).to_string()).collect();
        words.join(", ")
    }
}

/// The order of the constraints in a problem.
#[derive(Clone, Debug)]
pub(super) struct Order {
    /// Equations of motion of the base: 6 or none.
    pub(super) base: usize,
    /// Velocities, base and joints.
    pub(super) velocities: usize,
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

    /// The name of a constraint of the problem.
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
        let mut names = Conflicting::default();
        let found = conflict.constraints().filter_map(|constraint| self.name(constraint));
        for (slot, name) in names.0.iter_mut().zip(found) {
            *slot = Some(name);
        }
        names
    }
}
