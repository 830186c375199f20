//! The parties of a contact. Contacts of robots with objects that they may hold use shorter steps than
//! contacts with the ground.

use super::colliders::Owner;
use super::point::ContactPoint;

/// The kinds of parties that a pair brings into contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parties {
    /// Objects, or objects and the world.
    Objects,
    /// A robot with itself or the world.
    Robot,
    /// A robot with a movable object or another robot, which it may hold.
    Grasp,
}

impl Parties {
    pub(super) fn new(a: Owner, b: Owner) -> Self {
        match (a.is_robot(), b.is_robot()) {
            (false, false) => Self::Objects,
            _ if a == Owner::World || b == Owner::World || a.articulation() == b.articulation() => {
                Self::Robot
            }
            _ => Self::Grasp,
        }
    }
}

impl ContactPoint {
    /// Returns `true` for a robot with a movable object or another robot.
    pub(super) fn is_grasp(&self) -> bool {
        Parties::new(self.owners.0, self.owners.1) == Parties::Grasp
    }
}

/// Distances within which contact points are found even if they cannot touch in the step \[m\].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Least {
    /// Distance between robots and themselves or the world.
    pub(crate) robots: f64,
    /// Distance between robots and movable objects or each other.
    pub(crate) grasps: f64,
}

/// Within this distance of something that a robot may hold, contacts determine the length of its integration
/// steps \[m\].
pub(super) const NEAR: f64 = 0.010;

impl Least {
    /// Distances at the start of a step.
    pub(super) const OF_STEP: Self = Self { robots: 0.0, grasps: NEAR };

    pub(super) fn for_parties(self, parties: Parties) -> f64 {
        match parties {
            Parties::Objects => 0.0,
            Parties::Robot => self.robots,
            Parties::Grasp => self.grasps,
        }
    }
}
