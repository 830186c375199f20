//! Intersection of a ray with one shape.

use std::sync::Arc;

use motorium_robots::{ConvexShape, M3, TriangleSurface, V3};
use nalgebra::{Isometry3, Vector3};

use super::surfaces::{self, Meeting};
use super::{Ray, RayHit};
use crate::{HeightField, ObjectShape};

/// A shape for ray casting.
///
/// ```
/// use motorium_robots::ConvexShape;
/// use motorium_worlds::{Ray, RayShape};
/// use nalgebra::{Isometry3, Point3, Vector3};
///
/// let ball = RayShape::new(&ConvexShape::Sphere { radius: 0.25 });
/// let ray = Ray { origin: Point3::origin(), direction: Vector3::x_axis() };
/// let (distance, normal) = ball.cast(&Isometry3::translation(2.0, 0.0, 0.0), &ray, 10.0).unwrap();
/// assert_eq!((distance, normal), (1.75, -Vector3::x()));
/// ```
#[derive(Clone, Debug)]
pub struct RayShape {
    pub(super) surface: Surface,
    /// Radius of the bounding sphere about the origin \[m\].
    pub(super) reach: f64,
}

#[derive(Clone, Debug)]
pub(super) enum Surface {
    Sphere(f64),
    Box(V3),
    Cylinder {
        radius: f64,
        half: f64,
    },
    Capsule {
        radius: f64,
        half: f64,
    },
    Polytope(Vec<(V3, f64)>),
    HalfSpace,
    Terrain(Arc<HeightField>),
    Triangles(Arc<TriangleSurface>),
    /// Several shapes with their poses.
    Parts(Arc<[(M3, V3, RayShape)]>),
    /// A convex hull without volume, which no ray hits.
    Nothing,
}

impl RayShape {
    /// Creates a ray-casting shape from a convex shape. No ray hits a hull without volume.
    pub fn new(shape: &ConvexShape) -> Self {
        let surface = match shape {
            ConvexShape::Sphere { radius } => Surface::Sphere(*radius),
            ConvexShape::Box { half } => Surface::Box((*half).into()),
            ConvexShape::Cylinder { radius, half_length } => {
                Surface::Cylinder { radius: *radius, half: *half_length }
            }
            ConvexShape::Capsule { radius, half_length } => {
                Surface::Capsule { radius: *radius, half: *half_length }
            }
            ConvexShape::HalfSpace => Surface::HalfSpace,
            ConvexShape::Hull { .. } => {
                let faces = shape.faces().into_iter();
                let planes: Vec<_> = faces.map(|(normal, height)| (normal.into(), height)).collect();
                if planes.is_empty() { Surface::Nothing } else { Surface::Polytope(planes) }
            }
        };
        Self { surface, reach: shape.bounding_radius() }
    }

    /// Creates the surface of a terrain, which rays hit only from above.
    pub fn of_terrain(field: Arc<HeightField>) -> Self {
        Self { surface: Surface::Terrain(field), reach: f64::INFINITY }
    }

    /// Creates the surface of a triangle mesh, which rays hit from both sides.
    pub fn of_triangles(surface: Arc<TriangleSurface>) -> Self {
        let reach = surface.reach();
        Self { surface: Surface::Triangles(surface), reach }
    }

    /// Creates a ray-casting shape from an object: the [visual](crate::MeshShape::visual) triangles of a
    /// mesh, or all parts of a compound. No ray hits an unreadable mesh.
    pub fn of_object(shape: &ObjectShape) -> Self {
        match shape {
            ObjectShape::Mesh(mesh) => match mesh.body() {
                Ok(body) => Self::of_triangles(body.visual.clone()),
                Err(_) => Self { surface: Surface::Nothing, reach: 0.0 },
            },
            ObjectShape::Compound(_) => {
                let placed = shape.shapes().into_iter().map(|(frame, part)| {
                    let rotation: M3 = frame.rotation.to_rotation_matrix().into_inner().into();
                    (rotation, frame.translation.vector.into(), Self::of_object(part))
                });
                let parts: Arc<[(M3, V3, Self)]> = placed.collect();
                let reach = parts.iter().map(|(_, at, part)| at.dot(*at).sqrt() + part.reach);
                Self { reach: reach.fold(0.0, f64::max), surface: Surface::Parts(parts) }
            }
            simple => simple
                .convex_shape()
                .map_or(Self { surface: Surface::Nothing, reach: 0.0 }, |shape| Self::new(&shape)),
        }
    }

    /// Returns `true` for the surface of a terrain.
    pub(super) fn is_terrain(&self) -> bool {
        matches!(self.surface, Surface::Terrain(_))
    }

    /// Casts a ray at the shape, placed at `pose`. Returns the distance \[m\] to the hit along the ray, and
    /// the outward normal at the hit in world axes. Returns `None` without a hit within `range` \[m\], or if
    /// the ray's origin is inside the shape.
    pub fn cast(&self, pose: &Isometry3<f64>, ray: &Ray, range: f64) -> Option<(f64, Vector3<f64>)> {
        let rotation: M3 = pose.rotation.to_rotation_matrix().into_inner().into();
        let (origin, direction) = (ray.origin.coords.into(), (*ray.direction).into());
        let (distance, normal) =
            self.meet(&rotation, pose.translation.vector.into(), (origin, direction), range)?;
        Some((distance, normal.into()))
    }

    /// Like [`cast`](Self::cast), with the vector types of the inner loops.
    #[inline(always)]
    pub(super) fn meet(
        &self,
        rotation: &M3,
        position: V3,
        (origin, direction): (V3, V3),
        range: f64,
    ) -> Meeting {
        let from = origin - position;
        let along = -from.dot(direction);
        // The ray misses the sphere, or the sphere is behind it or too far away.
        let square = from.dot(from) - along * along;
        if square > self.reach * self.reach || along < -self.reach || along - self.reach > range {
            return None;
        }
        let (from, towards) = (rotation.tr_mul(from), rotation.tr_mul(direction));
        let (distance, normal) = match &self.surface {
            Surface::Sphere(radius) => surfaces::sphere(from, towards, *radius),
            Surface::Box(half) => surfaces::block(from, towards, *half),
            Surface::Cylinder { radius, half } => surfaces::cylinder(from, towards, *radius, *half),
            Surface::Capsule { radius, half } => surfaces::capsule(from, towards, *radius, *half),
            Surface::Polytope(planes) => surfaces::polytope(from, towards, planes),
            Surface::HalfSpace => surfaces::half_space(from, towards),
            Surface::Terrain(field) => field.meet(from, towards, range),
            Surface::Triangles(surface) => surface.meet(from, towards, range),
            Surface::Parts(parts) => first_of(parts, (from, towards), range),
            Surface::Nothing => None,
        }
        .filter(|(distance, _)| *distance <= range)?;
        Some((distance, *rotation * normal))
    }

    /// Converts the hit of one shape to a hit in a scene.
    pub(super) fn hit(target: usize, (distance, normal): (f64, V3)) -> RayHit {
        RayHit { target, distance, normal: normal.into() }
    }
}

/// Returns the first hit with placed shapes.
#[inline(never)]
fn first_of(parts: &[(M3, V3, RayShape)], ray: (V3, V3), range: f64) -> Meeting {
    let mut best: Meeting = None;
    for (rotation, position, shape) in parts {
        let nearest = best.map_or(range, |(distance, _)| distance);
        best = shape.meet(rotation, *position, ray, nearest).or(best);
    }
    best
}
