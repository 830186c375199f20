//! Convex shapes for GJK: a core with a radius.
//!
//! A sphere is a point with a radius, a capsule a segment with a radius. While the cores are separate, the
//! signed distance of two shapes is the distance of their cores minus the radii: exact, smooth, and without a
//! depth search.

use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::shape::SupportMap;

use crate::math::{M3, V3, vector};

/// A convex set about the origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Core {
    /// The origin.
    Point,
    /// A segment along z, from minus to plus this value.
    Segment(f64),
    /// A box with these half sides.
    Box(V3),
    /// A cylinder along z: radius and half length.
    Cylinder(f64, f64),
    /// The convex hull of points.
    Hull(Cloud),
    /// All points below z = 0. It has no support points; its distances are computed in closed form.
    HalfSpace,
}

impl Core {
    /// Returns the point of the set farthest along `direction`, which may have any length.
    #[inline(always)]
    pub(super) fn support(&self, direction: V3) -> V3 {
        match self {
            Self::Point => V3::ZERO,
            Self::Segment(half) => V3::new(0.0, 0.0, half.copysign(direction.z)),
            Self::Box(half) => V3::new(
                half.x.copysign(direction.x),
                half.y.copysign(direction.y),
                half.z.copysign(direction.z),
            ),
            Self::Cylinder(radius, half) => {
                let across = (direction.x * direction.x + direction.y * direction.y).sqrt();
                let scale = if across > 0.0 { radius / across } else { 0.0 };
                V3::new(direction.x * scale, direction.y * scale, half.copysign(direction.z))
            }
            Self::Hull(cloud) => cloud.support(direction),
            Self::HalfSpace => V3::ZERO,
        }
    }

    /// Returns the point of the set nearest to `point`; `None` for a hull, which requires a search.
    #[inline(always)]
    pub(super) fn project(&self, point: V3) -> Option<V3> {
        Some(match self {
            Self::Point => V3::ZERO,
            Self::Segment(half) => V3::new(0.0, 0.0, point.z.clamp(-half, *half)),
            Self::Box(half) => V3::new(
                point.x.clamp(-half.x, half.x),
                point.y.clamp(-half.y, half.y),
                point.z.clamp(-half.z, half.z),
            ),
            Self::Cylinder(radius, half) => {
                let across = (point.x * point.x + point.y * point.y).sqrt();
                let scale = if across > *radius { radius / across } else { 1.0 };
                V3::new(point.x * scale, point.y * scale, point.z.clamp(-half, *half))
            }
            Self::HalfSpace => V3::new(point.x, point.y, point.z.min(0.0)),
            Self::Hull(_) => return None,
        })
    }

    /// Returns the largest distance of a point of the set from the origin.
    pub(super) fn reach(&self) -> f64 {
        match self {
            Self::Point => 0.0,
            Self::Segment(half) => *half,
            Self::Box(half) => half.dot(*half).sqrt(),
            Self::Cylinder(radius, half) => radius.hypot(*half),
            Self::Hull(cloud) => cloud.reach(),
            Self::HalfSpace => f64::INFINITY,
        }
    }

    /// Returns the half length along z of a point or segment.
    pub(super) fn line(&self) -> Option<f64> {
        match self {
            Self::Point => Some(0.0),
            Self::Segment(half) => Some(*half),
            _ => None,
        }
    }
}

/// Points by coordinate, for vectorised comparison.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Cloud {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    /// Number of points without the padding of the last block.
    count: usize,
}

/// Number of points compared simultaneously.
const WIDE: usize = 8;

impl Cloud {
    pub(super) fn new(points: &[V3]) -> Self {
        // padded with copies of the last point, which have no effect
        let count = points.len().next_multiple_of(WIDE);
        let at = |index: usize| points[index.min(points.len() - 1)];
        Self {
            x: (0..count).map(|index| at(index).x).collect(),
            y: (0..count).map(|index| at(index).y).collect(),
            z: (0..count).map(|index| at(index).z).collect(),
            count: points.len(),
        }
    }

    pub(super) fn points(&self) -> impl Iterator<Item = V3> {
        self.x.iter().zip(&self.y).zip(&self.z).map(|((&x, &y), &z)| V3::new(x, y, z))
    }

    /// Iterates over the points without padding.
    pub(super) fn corners(&self) -> impl Iterator<Item = V3> {
        self.points().take(self.count)
    }

    fn reach(&self) -> f64 {
        self.points().map(|point| point.dot(point)).fold(0.0, f64::max).sqrt()
    }

    fn support(&self, direction: V3) -> V3 {
        let mut best = [f64::NEG_INFINITY; WIDE];
        let mut block = [0_usize; WIDE];
        let blocks = self
            .x
            .chunks_exact(WIDE)
            .zip(self.y.chunks_exact(WIDE))
            .zip(self.z.chunks_exact(WIDE))
            .enumerate();
        for (index, ((x, y), z)) in blocks {
            for lane in 0..WIDE {
                let along = x[lane] * direction.x + y[lane] * direction.y + z[lane] * direction.z;
                let better = along > best[lane];
                best[lane] = if better { along } else { best[lane] };
                block[lane] = if better { index } else { block[lane] };
            }
        }
        let mut lane = 0;
        for other in 1..WIDE {
            if best[other] > best[lane] {
                lane = other;
            }
        }
        let index = block[lane] * WIDE + lane;
        V3::new(self.x[index], self.y[index], self.z[index])
    }
}

/// A placed core, in world axes relative to a point near both shapes of the pair.
pub(super) struct Placed<'a> {
    pub(super) core: &'a Core,
    pub(super) rotation: &'a M3,
    pub(super) position: V3,
}

impl Placed<'_> {
    #[inline(always)]
    pub(super) fn farthest(&self, direction: V3) -> V3 {
        self.position + *self.rotation * self.core.support(self.rotation.tr_mul(direction))
    }
}

impl Placed<'_> {
    #[inline(always)]
    pub(super) fn project(&self, point: V3) -> Option<V3> {
        let nearest = self.core.project(self.rotation.tr_mul(point - self.position))?;
        Some(self.position + *self.rotation * nearest)
    }
}

impl SupportMap for Placed<'_> {
    #[inline(always)]
    fn local_support_point(&self, direction: Vector) -> Vector {
        vector(self.farthest(V3::new(direction.x, direction.y, direction.z)))
    }

    /// both shapes are already placed, so the relative pose is always the identity
    #[inline(always)]
    fn support_point(&self, _: &Pose, direction: Vector) -> Vector {
        self.local_support_point(direction)
    }
}
