//! Parties of a contact: anything a robot may hold is integrated in shorter steps than the ground it stands
//! on.

use super::colliders::Owner;
use super::detect::ContactPoint;

/// The kind of contact that a pair makes, or may make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parties {
    /// Objects, or objects and the world.
    Objects,
    /// A robot with itself or with the world.
    Robot,
    /// A robot with an object that moves, or with another robot: it may hold it.
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
    /// True where a robot meets an object that moves, or another robot.
    pub(super) fn is_grasp(&self) -> bool {
        Parties::new(self.owners.0, self.owners.1) == Parties::Grasp
    }
}

/// Distances within which contact points are found regardless of the motion \[m\].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Least {
    /// For robots, with themselves and the world.
    pub(crate) robots: f64,
    /// For robots with moving objects and with one another.
    pub(crate) grasps: f64,
}

/// Distance from a holdable object below which contacts decide the length of a robot's integration steps
/// \[m\].
pub(super) const NEAR: f64 = 0.010;

impl Least {
    /// Those at the begin of a step.
    pub(super) const OF_STEP: Self = Self { robots: 0.0, grasps: NEAR };

    pub(super) fn for_parties(self, parties: Parties) -> f64 {
        match parties {
            Parties::Objects => 0.0,
            Parties::Robot => self.robots,
            Parties::Grasp => self.grasps,
        }
    }
}
