//! Ray casting against the colliders of a simulation.

use motorium_worlds::{Ray, RayShape};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::RayHit;
use crate::contact::{Colliders, Owner};
use crate::robot::Robot;

/// The shapes of all colliders for ray casts, one each.
pub(crate) struct Rays(Vec<RayShape>);

impl Rays {
    pub(crate) fn new(colliders: &Colliders) -> Self {
        let solids = &colliders.colliders[..colliders.model.solid_count()];
        let shapes = solids.iter().map(|collider| match &collider.surface {
            Some(surface) => RayShape::of_triangles(surface.clone()),
            None => RayShape::new(&collider.shape),
        });
        Self(shapes.chain(colliders.terrain.clone().map(RayShape::of_terrain)).collect())
    }

    /// Returns the first surface that a ray hits within `range` \[m\]. The robot is in its current pose, and
    /// `object_pose` returns the pose of each object by its index in the world.
    pub(crate) fn cast<'a>(
        &self,
        colliders: &'a Colliders,
        (robot, object_pose): (&Robot, impl Fn(usize) -> Isometry3<f64>),
        (origin, direction, range): (&Point3<f64>, &Unit<Vector3<f64>>, f64),
    ) -> Option<RayHit<'a>> {
        let ray = Ray { origin: *origin, direction: *direction };
        let mut best: Option<RayHit<'a>> = None;
        for (index, (collider, shape)) in colliders.colliders.iter().zip(&self.0).enumerate() {
            let pose = match (colliders.object_of(index), collider.owner) {
                (Some((object, None)), _) => object_pose(object),
                (Some((object, Some(part))), _) => object_pose(object) * part,
                (None, Owner::Base(of)) => robot.base_pose(of) * collider.placement,
                (None, Owner::Body(of, body)) => {
                    robot.articulations[of].kinematics.body_pose(body) * collider.placement
                }
                (None, Owner::World | Owner::Object(_)) => collider.placement,
            };
            let nearest = best.map_or(range, |hit| hit.distance);
            if let Some((distance, normal)) = shape.cast(&pose, &ray, nearest) {
                best = Some(RayHit { name: &collider.name, distance, point: ray.point(distance), normal });
            }
        }
        best
    }
}
