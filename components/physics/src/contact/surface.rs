//! The law of the two surfaces that meet at a contact point.

use motorium_robots::{FrictionCombine, Softness};
use nalgebra::{Rotation3, Vector3};

use super::axes::axes;
use super::colliders::{Collider, ColliderGrain};

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
    /// Compliance of the point, instead of restitution.
    pub(crate) soft: Option<Softness>,
    /// Direction along which friction differs, world axes, and the friction along and across it relative to
    /// `friction`.
    pub(crate) grain: Option<(Vector3<f64>, [f64; 2])>,
}

impl SurfaceLaw {
    /// The law of a part without a surface.
    pub(super) const NONE: Self = Self {
        friction: 0.0,
        torsional: 0.0,
        rolling: 0.0,
        restitution: 0.0,
        conveyed: Vector3::new(0.0, 0.0, 0.0),
        soft: None,
        grain: None,
    };

    /// The law of two colliders, whose rotations `turned` has by their places.
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
        let mut friction = combined(a.friction, b.friction);
        let mut grain = None;
        // If both have a grain the first counts.
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
            torsional: 0.5 * (a.torsional + b.torsional),
            rolling: 0.5 * (a.rolling + b.rolling),
            restitution: 0.5 * (a.restitution + b.restitution),
            conveyed,
            soft,
            grain,
        }
    }

    /// The same with the other surface as the first.
    pub(crate) fn swapped(self) -> Self {
        Self { conveyed: -self.conveyed, ..self }
    }

    /// The axes of a contact point: its normal, and two tangents. Along a grain and across it these are
    /// shortened so that the bound of friction is a circle: impulses along them are then as much smaller, and
    /// so are the velocities that these oppose.
    pub(super) fn axes(&self, normal: &Vector3<f64>) -> [Vector3<f64>; 3] {
        let Some((direction, [along, across])) = self.grain else { return axes(normal) };
        let tangent = direction - normal * normal.dot(&direction);
        // A surface perpendicular to its grain has none.
        let Some(one) = tangent.try_normalize(1e-6) else { return axes(normal) };
        [*normal, one * along, normal.cross(&one) * across]
    }

    /// True where the surfaces resist rolling or spinning.
    pub(crate) fn resists_turning(&self) -> bool {
        self.torsional > 0.0 || self.rolling > 0.0
    }
}
