//! Contact points, and the state of the colliders that they belong to.

use nalgebra::{Point3, Vector3};

use super::colliders::Owner;
use super::surface::SurfaceLaw;

/// Fraction of an error that is corrected in a step, and the largest correction speed \[m/s, rad/s\].
const SHARE: f64 = 0.2;
const FASTEST: (f64, f64) = (0.5, 5.0);

/// A point where two surfaces touch, or may soon touch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactPoint {
    /// Key, which is stable for the same features of the same two colliders.
    pub(crate) key: u64,
    /// Indices of the two colliders; the normal points from the second to the first.
    pub(crate) colliders: (usize, usize),
    pub(crate) owners: (Owner, Owner),
    /// Position in the world \[m\], halfway between the surfaces.
    pub(crate) point: Point3<f64>,
    /// Unit vector in the world.
    pub(crate) normal: Vector3<f64>,
    /// Distance between the surfaces \[m\], negative for penetration.
    pub(crate) distance: f64,
    /// Bound of the relative speed of the surfaces \[m/s\].
    pub(crate) speed: f64,
    pub(crate) law: SurfaceLaw,
    /// Set for a connection of two parts, which is bilateral, not a contact.
    pub(crate) held: Option<Held>,
    /// Length of the integration step of its impulse \[s\].
    pub(crate) h: f64,
    /// True if neither side moves: the point and its force come from an earlier integration step.
    pub(crate) kept: bool,
}

/// A bilateral contact point: the constrained directions and their drift.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held {
    /// True if the orientation is constrained, false if the position is.
    pub(super) turning: bool,
    /// Error of the first part relative to the second, world axes \[m or rad\].
    pub(super) error: Vector3<f64>,
}

impl Held {
    /// Returns the velocity of the first part relative to the second that corrects the error in a step of `h`
    /// \[s\].
    pub(super) fn velocity(&self, h: f64) -> Vector3<f64> {
        let velocity = self.error * (-SHARE / h);
        let most = if self.turning { FASTEST.1 } else { FASTEST.0 };
        velocity * (most / velocity.norm().max(most))
    }
}

/// The state of a collider in the next integration step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    Moves,
    /// Part of the world, or asleep.
    Rests,
    /// The step of the collider is complete.
    Done,
}

/// Placeholder for the step length of a contact point that has not been part of a step yet \[s\]. It is not
/// zero, because impulses are divided by it to obtain forces.
pub(super) const UNKNOWN: f64 = 1.0;

/// Error of a measured distance \[m\].
pub(super) const ROUNDING: f64 = 1e-6;
