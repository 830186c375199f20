//! Names of a controller's constraints, and the report of constraints that contradict each other.

use std::fmt;

use motorium_qp::{Conflict, Side};
use motorium_robots::Model;

use crate::contact::Contact;

/// One scalar constraint of inverse kinematics or inverse dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ConstraintName {
    /// Equation of motion of a floating base: force along x, y and z, then torque about these axes, in base
    /// axes.
    Base {
        /// Index of the axis, 0 to 5.
        axis: usize,
    },
    /// No-motion constraint of a contact: translation along x, y and z of the world, then rotation about
    /// these axes.
    Motion {
        /// Index of the contact.
        contact: usize,
        /// Index of the axis, 0 to 5.
        axis: usize,
    },
    /// Torque limit of a joint.
    Torque {
        /// Index of the joint among the independent joints.
        joint: usize,
        /// Lower or upper torque limit.
        side: Side,
    },
    /// Friction cone of a contact point, or one face of the friction pyramid.
    Friction {
        /// Index of the contact.
        contact: usize,
        /// Index of the point within the contact.
        point: usize,
    },
    /// Limit of the normal force at a contact point: unilateral, or the maximum.
    Force {
        /// Index of the contact.
        contact: usize,
        /// Index of the point within the contact.
        point: usize,
        /// `Lower` for the unilateral limit, `Upper` for the maximum.
        side: Side,
    },
    /// Limit of the total wrench of a sole.
    Wrench {
        /// Index of the contact.
        contact: usize,
    },
    /// Row of a velocity limit.
    Limit {
        /// Index among the rows of all limits.
        row: usize,
        /// Lower or upper side.
        side: Side,
    },
    /// Row of a constraint task.
    Task {
        /// Index among the rows of all constraint tasks.
        row: usize,
    },
    /// Position or velocity limit of a joint, or a bound on a base velocity.
    Velocity {
        /// Index of the generalised velocity.
        velocity: usize,
        /// Lower or upper limit.
        side: Side,
    },
    /// Position, velocity or acceleration limit of a joint.
    Acceleration {
        /// Index of the joint among the independent joints.
        joint: usize,
        /// Lower or upper limit.
        side: Side,
    },
}

impl ConstraintName {
    /// Returns a description of the constraint for messages.
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
        match self.name {
            ConstraintName::Base { axis } => write!(f, "motion of the base {}", AXES[axis]),
            ConstraintName::Motion { contact: index, axis } => {
                write!(f, "contact `{}` at rest {}", contact(index), AXES[axis])
            }
            ConstraintName::Torque { joint: index, side } => {
                write!(f, "{side} torque limit of joint `{}`", joint(index))
            }
            ConstraintName::Friction { contact: index, point } => {
                write!(f, "friction of contact `{}` at point {point}", contact(index))
            }
            ConstraintName::Force { contact: index, point, side: Side::Lower } => {
                write!(f, "unilateral force of contact `{}` at point {point}", contact(index))
            }
            ConstraintName::Force { contact: index, point, side: Side::Upper } => {
                write!(f, "largest force of contact `{}` at point {point}", contact(index))
            }
            ConstraintName::Wrench { contact: index } => write!(f, "wrench of contact `{}`", contact(index)),
            ConstraintName::Limit { row, side } => {
                write!(f, "{side} side of row {row} of the limits")
            }
            ConstraintName::Task { row } => write!(f, "row {row} of the tasks that are constraints"),
            ConstraintName::Velocity { velocity, side } => {
                match velocity.checked_sub(self.model.nv() - self.model.joint_count()) {
                    Some(index) => write!(f, "{side} position or velocity limit of joint `{}`", joint(index)),
                    None => write!(f, "{side} bound of velocity {velocity} of the base"),
                }
            }
            ConstraintName::Acceleration { joint: index, side } => {
                write!(f, "{side} position, velocity or acceleration limit of joint `{}`", joint(index))
            }
        }
    }
}

/// The constraints that contribute most to a conflict, strongest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conflicting([Option<ConstraintName>; Conflict::CAPACITY]);

impl FromIterator<ConstraintName> for Conflicting {
    fn from_iter<I: IntoIterator<Item = ConstraintName>>(names: I) -> Self {
        let mut found = Self::default();
        for (slot, name) in found.0.iter_mut().zip(names) {
            *slot = Some(name);
        }
        found
    }
}

impl Conflicting {
    /// Returns the constraints, strongest first.
    pub fn names(&self) -> impl Iterator<Item = ConstraintName> + '_ {
        self.0.iter().flatten().copied()
    }

    /// Returns a description of all constraints for messages.
    pub fn describe(&self, model: &Model, contacts: &[Contact]) -> String {
        let descriptions: Vec<_> =
            self.names().map(|name| name.describe(model, contacts).to_string()).collect();
        descriptions.join(", ")
    }
}
