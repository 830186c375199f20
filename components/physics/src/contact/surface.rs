//! The law of the two surfaces that meet at a contact point.

use nalgebra::{Rotation3, Vector3};

use super::colliders::Collider;

/// The law of two surfaces that meet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceLaw {
    pub(crate) friction: f64,
    /// Largest torque about the normal and about the tangents, per normal force \[m\].
    pub(crate) torsional: f64,
    pub(crate) rolling: f64,
    pub(crate) restitution: f64,
    /// Velocity of the first surface relative to the second that conveyors give, world axes \[m/s\].
    pub(crate) conveyed: Vector3<f64>,
}

impl SurfaceLaw {
    /// The law of two colliders, whose rotations `turned` has by their places.
    pub(crate) fn between([a, b]: [&Collider; 2], turned: impl Fn(usize) -> Rotation3<f64>) -> Self {
        let mut conveyed = Vector3::zeros();
        for (place, collider, sign) in [(0, a, 1.0), (1, b, -1.0)] {
            if let Some(velocity) = collider.conveyor {
                conveyed += turned(place) * velocity * sign;
            }
        }
        Self {
            friction: 0.5 * (a.friction + b.friction),
            torsional: 0.5 * (a.torsional + b.torsional),
            rolling: 0.5 * (a.rolling + b.rolling),
            restitution: 0.5 * (a.restitution + b.restitution),
            conveyed,
        }
    }

    /// The same with the other surface as the first.
    pub(crate) fn swapped(self) -> Self {
        Self { conveyed: -self.conveyed, ..self }
    }

    /// True where the surfaces resist rolling or spinning.
    pub(crate) fn resists_turning(&self) -> bool {
        self.torsional > 0.0 || self.rolling > 0.0
    }
}
