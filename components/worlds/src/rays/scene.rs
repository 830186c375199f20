//! Scenes of placed shapes, and casting of many rays at once.

use std::sync::Arc;

use motorium_robots::{CollisionModel, ConvexShape, M3, V3};
use nalgebra::{Isometry3, Vector3};

use super::{Ray, RayHit, RayShape};
use crate::{HeightField, World};

/// Number of rays bounded by one cone.
const BUNDLE: usize = 16;

/// A scene of placed shapes for ray casting.
///
/// Shapes are numbered in order of addition. Casting does not allocate.
///
/// ```
/// use motorium_robots::ConvexShape;
/// use motorium_worlds::{Ray, RayScene, RayShape};
/// use nalgebra::{Isometry3, Point3, Vector3};
///
/// let mut scene = RayScene::default();
/// scene.add(RayShape::new(&ConvexShape::HalfSpace), &Isometry3::identity());
/// let cube = ConvexShape::Box { half: Vector3::repeat(0.1) };
/// let cube = scene.add(RayShape::new(&cube), &Isometry3::translation(0.0, 0.0, 0.1));
/// let down = |x| Ray { origin: Point3::new(x, 0.0, 1.0), direction: -Vector3::z_axis() };
///
/// let rays = [down(0.0), down(0.3)];
/// let mut hits = [None; 2];
/// scene.cast_all(&rays, 5.0, &mut hits);
/// assert_eq!(hits.map(|hit| hit.unwrap().distance), [0.8, 1.0]);
///
/// scene.set_pose(cube, &Isometry3::translation(0.3, 0.0, 0.1));
/// assert_eq!(scene.cast(&rays[0], 5.0).unwrap().distance, 1.0);
/// ```
#[derive(Clone, Debug, Default)]
pub struct RayScene {
    targets: Vec<Target>,
    /// Infinite shapes, tested first.
    endless: Vec<usize>,
    /// Finite shapes that a bundle may hit, each with a lower bound of its distance; its capacity is the
    /// length of `targets`.
    near: Vec<(f64, usize)>,
}

#[derive(Clone, Debug)]
struct Target {
    shape: RayShape,
    rotation: M3,
    position: V3,
}

/// A cone of directions around a ball of origins that contains all rays of a bundle.
struct Bundle {
    centre: V3,
    /// Radius of the ball \[m\].
    radius: f64,
    axis: V3,
    /// Cosine of half the opening angle.
    cos: f64,
    sin: f64,
}

impl RayScene {
    /// Adds a shape at a pose in the world and returns its index.
    pub fn add(&mut self, shape: RayShape, pose: &Isometry3<f64>) -> usize {
        let index = self.targets.len();
        if !shape.reach.is_finite() {
            self.endless.push(index);
        }
        self.targets.push(Target { shape, rotation: M3::IDENTITY, position: V3::ZERO });
        self.near = Vec::with_capacity(self.targets.len());
        self.set_pose(index, pose);
        index
    }

    /// Adds all solids of a collision model, in order. Each solid is placed relative to the frame to which it
    /// is [attached](CollisionModel::attachment).
    pub fn add_solids(&mut self, solids: &CollisionModel) {
        for index in 0..solids.solid_count() {
            let shape: ConvexShape = solids.convex_shape(index);
            self.add(RayShape::new(&shape), &solids.placement(index));
        }
    }

    /// Adds the objects of a world in order at their initial poses, then the ground or terrain of the world.
    /// Returns the index of the first added shape. Rays hit the [visual shape](RayShape::of_object) of an
    /// object. An [invalid](World::check) terrain is skipped.
    pub fn add_world(&mut self, world: &World) -> usize {
        let first = self.len();
        for object in &world.objects {
            self.add(RayShape::of_object(&object.shape), &object.pose());
        }
        if let Some(ground) = &world.ground {
            let pose = Isometry3::translation(0.0, 0.0, ground.height);
            self.add(RayShape::new(&ConvexShape::HalfSpace), &pose);
        }
        if let Ok(Some(field)) = world.height_field() {
            self.add(RayShape::of_terrain(Arc::new(field)), &Isometry3::identity());
        }
        first
    }

    /// Replaces the terrain added by [`add_world`](Self::add_world). Returns `false` if the scene has no
    /// terrain.
    pub fn set_terrain(&mut self, field: HeightField) -> bool {
        let terrain = self.targets.iter_mut().find(|target| target.shape.is_terrain());
        let is_there = terrain.is_some();
        if let Some(target) = terrain {
            target.shape = RayShape::of_terrain(Arc::new(field));
        }
        is_there
    }

    /// Returns the number of shapes.
    pub fn len(&self) -> usize {
        self.targets.len()
    }

    /// Returns `true` if there are no shapes.
    pub fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    /// Sets the pose of a shape in the world.
    ///
    /// # Panics
    /// If there is no shape with this index.
    pub fn set_pose(&mut self, index: usize, pose: &Isometry3<f64>) {
        let target = &mut self.targets[index];
        target.rotation = pose.rotation.to_rotation_matrix().into_inner().into();
        target.position = pose.translation.vector.into();
    }

    /// Returns the first surface that a ray hits within `range` \[m\]; `None` without a hit.
    pub fn cast(&self, ray: &Ray, range: f64) -> Option<RayHit> {
        let ray = numbers(ray);
        let mut best = None;
        let mut nearest = range;
        for index in 0..self.targets.len() {
            self.try_one(index, ray, &mut nearest, &mut best);
        }
        best
    }

    /// Finds the first surface that each ray hits within `range` \[m\]; `hits[i]` is the result for
    /// `rays[i]`. Casting is fastest if consecutive rays have similar origins and directions.
    ///
    /// # Panics
    /// If the lengths of `hits` and `rays` differ.
    pub fn cast_all(&mut self, rays: &[Ray], range: f64, hits: &mut [Option<RayHit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        for (rays, hits) in rays.chunks(BUNDLE).zip(hits.chunks_mut(BUNDLE)) {
            self.choose(rays, range);
            for (ray, hit) in rays.iter().zip(hits) {
                let ray = numbers(ray);
                let (mut best, mut nearest) = (None, range);
                for index in &self.endless {
                    self.try_one(*index, ray, &mut nearest, &mut best);
                }
                for (least, index) in &self.near {
                    if *least > nearest {
                        break;
                    }
                    self.try_one(*index, ray, &mut nearest, &mut best);
                }
                *hit = best;
            }
        }
    }

    #[inline(always)]
    fn try_one(&self, index: usize, ray: (V3, V3), nearest: &mut f64, best: &mut Option<RayHit>) {
        let Target { shape, rotation, position } = &self.targets[index];
        if let Some(meeting) = shape.meet(rotation, *position, ray, *nearest) {
            *nearest = meeting.0;
            *best = Some(RayShape::hit(index, meeting));
        }
    }

    /// Collects the shapes that a bundle of rays may hit, nearest first.
    fn choose(&mut self, rays: &[Ray], range: f64) {
        self.near.clear();
        let bundle = Bundle::from_rays(rays);
        for (index, target) in self.targets.iter().enumerate() {
            let reach = target.shape.reach;
            if !reach.is_finite() {
                continue;
            }
            let away = target.position - bundle.centre;
            let reach = reach + bundle.radius;
            let least = away.dot(away).sqrt() - reach;
            if least <= range && bundle.may_meet(away, reach) {
                self.near.push((least, index));
            }
        }
        self.near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    }
}

impl Bundle {
    fn from_rays(rays: &[Ray]) -> Self {
        let count = 1.0 / rays.len() as f64;
        let mut centre = V3::ZERO;
        let mut axis = V3::ZERO;
        for ray in rays {
            let (origin, direction) = numbers(ray);
            centre += origin * count;
            axis += direction;
        }
        let length = axis.dot(axis).sqrt();
        let axis = axis * (1.0 / length.max(f64::MIN_POSITIVE));
        let (mut square, mut cos) = (0.0_f64, 1.0_f64);
        for ray in rays {
            let (origin, direction) = numbers(ray);
            let out = origin - centre;
            square = square.max(out.dot(out));
            cos = cos.min(axis.dot(direction));
        }
        // a little wider, for the rounding of the angles
        let cos = if length > 1e-9 { cos - 1e-9 } else { -1.0 };
        Self { centre, radius: square.sqrt(), axis, cos, sin: (1.0 - cos * cos).max(0.0).sqrt() }
    }

    /// Returns `false` if no ray hits the ball of radius `reach` (including the origins' radius) at `away`
    /// from their centre.
    fn may_meet(&self, away: V3, reach: f64) -> bool {
        if self.cos <= 0.05 {
            return true;
        }
        let along = self.axis.dot(away);
        let across = (away.dot(away) - along * along).max(0.0).sqrt();
        across * self.cos - along * self.sin <= reach
    }
}

#[inline(always)]
fn numbers(ray: &Ray) -> (V3, V3) {
    (ray.origin.coords.into(), Vector3::from(*ray.direction).into())
}
