//! Ray casting: the first surface hit by a ray.
//!
//! A [`RayShape`] is one shape with closed-form intersections. A [`RayScene`] is a set of placed shapes for
//! many rays: neighbouring rays are bounded by one cone, and only shapes that intersect this cone are tested.
//!
//! A ray does not hit shapes that contain the ray's origin, so a sensor inside a housing sees through the
//! housing.

mod scene;
mod shape;
mod surfaces;

use nalgebra::{Point3, Unit, Vector3};

pub use scene::RayScene;
pub use shape::RayShape;

/// A ray: all points from an origin along a direction.
///
/// ```
/// use motorium_worlds::Ray;
/// use nalgebra::{Point3, Vector3};
///
/// let down = Ray { origin: Point3::new(0.0, 0.0, 2.0), direction: -Vector3::z_axis() };
/// assert_eq!(down.point(0.5).z, 1.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin in the world \[m\].
    pub origin: Point3<f64>,
    /// Direction, world axes.
    pub direction: Unit<Vector3<f64>>,
}

impl Ray {
    /// Returns the point at a distance \[m\] from the origin.
    pub fn point(&self, distance: f64) -> Point3<f64> {
        self.origin + self.direction.scale(distance)
    }
}

/// First surface hit by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Index of the hit shape in the scene.
    pub target: usize,
    /// Distance from the origin of the ray \[m\].
    pub distance: f64,
    /// Outward unit normal of the surface, world axes.
    pub normal: Vector3<f64>,
}
