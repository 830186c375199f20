//! Rays against the colliders of a simulation.

use motorium_robots::ConvexShape;
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rapier3d_f64::geometry::{Ray, SharedShape};

use crate::RayHit;
use crate::contact::{Colliders, Owner};
use crate::rapier::{convert, rapier_shape};
use crate::robot::Robot;

/// The shapes of all colliders as rays meet them, one each; `None` for a hull without volume.
pub(crate) struct Rays(Vec<Option<Target>>);

struct Target {
    shape: SharedShape,
    /// Frame of the shape in that of the collider.
    frame: Isometry3<f64>,
    /// Farthest distance of a point from the origin of the collider \[m\].
    reach: f64,
}

impl Rays {
    pub(crate) fn new(colliders: &Colliders) -> Self {
        let target = |shape: &ConvexShape| {
            let reach = shape.bounding_radius();
            rapier_shape(shape).map(|(shape, frame)| Target { shape, frame, reach })
        };
        Self(colliders.colliders.iter().map(|collider| target(&collider.shape)).collect())
    }

    /// The first surface that a ray meets within `range` \[m\], as the robot stands and objects are at `object_pose`, by
    /// their index in the world.
    pub(crate) fn cast<'a>(
        &self,
        colliders: &'a Colliders,
        (robot, object_pose): (&Robot, impl Fn(usize) -> Isometry3<f64>),
        (origin, direction, range): (&Point3<f64>, &Unit<Vector3<f64>>, f64),
        objects: usize,
    ) -> Option<RayHit<'a>> {
        let ray = Ray::new(convert::vector(&origin.coords), convert::vector(direction));
        let mut best: Option<RayHit<'a>> = None;
        for (index, (collider, target)) in colliders.colliders.iter().zip(&self.0).enumerate() {
            let Some(target) = target else { continue };
            let object = index.checked_sub(colliders.first_object).filter(|object| *object < objects);
            let pose = match (object, collider.owner) {
                (Some(object), _) => object_pose(object),
                (None, Owner::Base) => robot.base_pose() * collider.placement,
                (None, Owner::Body(body)) => robot.kinematics.body_pose(body) * collider.placement,
                (None, Owner::World | Owner::Object(_)) => collider.placement,
            };
            let nearest = best.map_or(range, |hit| hit.distance);
            let way = pose.translation.vector - origin.coords;
            let along = way.dot(direction).clamp(0.0, nearest);
            if (way - direction.scale(along)).norm_squared() > target.reach * target.reach {
                continue;
            }
            let placed = convert::pose(&(pose * target.frame));
            let hit = target.shape.cast_ray_and_get_normal(&placed, &ray, nearest, true);
            // At no distance it starts inside.
            if let Some(hit) = hit.filter(|hit| hit.time_of_impact > 0.0) {
                let distance = hit.time_of_impact;
                best = Some(RayHit {
                    name: &collider.name,
                    distance,
                    point: origin + direction.scale(distance),
                    normal: convert::vector_back(hit.normal),
                });
            }
        }
        best
    }
}
