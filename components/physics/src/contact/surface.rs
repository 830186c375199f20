//! The combined law of the two surfaces at a contact point.

use motorium_worlds::{FrictionCombine, Softness};
use nalgebra::{Rotation3, Vector3};

use super::axes::axes;
use super::colliders::{Collider, ColliderGrain};

/// The combined law of two surfaces in contact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceLaw {
    pub(crate) friction: f64,
    /// Largest torque about the normal and about the tangents, per unit of normal force \[m\].
    pub(crate) torsional: f64,
    pub(crate) rolling: f64,
    pub(crate) restitution: f64,
    /// Velocity of the first surface relative to the second due to conveyors, world axes \[m/s\].
    pub(crate) conveyed: Vector3<f64>,
    /// Softness of a compliant point, which replaces restitution.
    pub(crate) soft: Option<Softness>,
    /// Direction of the grain, world axes, and the friction along and across it relative to `friction`.
    pub(crate) grain: Option<(Vector3<f64>, [f64; 2])>,
}

impl SurfaceLaw {
    /// The law of a point without surfaces.
    pub(super) const NONE: Self = Self {
        friction: 0.0,
        torsional: 0.0,
        rolling: 0.0,
        restitution: 0.0,
        conveyed: Vector3::new(0.0, 0.0, 0.0),
        soft: None,
        grain: None,
    };

    /// Combines the laws of two colliders; `turned` returns their rotations by index.
    pub(crate) fn between([a, b]: [&Collider; 2], turned: impl Fn(usize) -> Rotation3<f64>) -> Self {
        let mut conveyed = Vector3::zeros();
        for (place, collider, sign) in [(0, a, 1.0), (1, b, -1.0)] {
            if let Some(velocity) = collider.conveyor {
                conveyed += turned(place) * velocity * sign;
            }
        }
        let soft = match (a.soft, b.soft) {
            (Some(one), Some(other)) => Some(one.behind(other)),
            (one, other) => one.or(other),
        };
        let combined = |one: f64, other: f64| {
            FrictionCombine::combined((one, a.friction_combine), (other, b.friction_combine))
        };
        let lengths = |one: f64, other: f64| {
            FrictionCombine::combined_lengths((one, a.friction_combine), (other, b.friction_combine))
        };
        let mut friction = combined(a.friction, b.friction);
        let mut grain = None;
        // If both surfaces have a grain, the first one counts.
        for (place, own) in [(1, b), (0, a)] {
            if let Some(ColliderGrain { direction, along, .. }) = own.grain {
                let along =
                    if place == 0 { combined(along, b.friction) } else { combined(a.friction, along) };
                let both = [along, combined(a.friction, b.friction)];
                friction = both[0].max(both[1]);
                let shares = if friction > 0.0 { both.map(|of| of / friction) } else { [1.0; 2] };
                grain = Some((turned(place) * direction, shares));
            }
        }
        Self {
            friction,
            torsional: lengths(a.torsional, b.torsional),
            rolling: lengths(a.rolling, b.rolling),
            restitution: 0.5 * (a.restitution + b.restitution),
            conveyed,
            soft,
            grain,
        }
    }

    /// Returns the law with the surfaces exchanged.
    pub(crate) fn swapped(self) -> Self {
        Self { conveyed: -self.conveyed, ..self }
    }

    /// Returns the axes of a contact point: its normal, and two tangents. The tangents along and across a
    /// grain are shortened so that the friction bound is a circle. Impulses along them are smaller by these
    /// factors, and so are the velocities that they oppose.
    pub(super) fn axes(&self, normal: &Vector3<f64>) -> [Vector3<f64>; 3] {
        let Some((direction, [along, across])) = self.grain else { return axes(normal) };
        let tangent = direction - normal * normal.dot(&direction);
        // A surface perpendicular to its grain has no grain.
        let Some(one) = tangent.try_normalize(1e-6) else { return axes(normal) };
        [*normal, one * along, normal.cross(&one) * across]
    }

    /// Returns `true` if the surfaces resist rolling or spinning.
    pub(crate) fn resists_turning(&self) -> bool {
        self.torsional > 0.0 || self.rolling > 0.0
    }
}
