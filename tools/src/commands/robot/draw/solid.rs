//! Primitives as convex bodies with flat faces.

use std::f64::consts::{PI, TAU};

use motorium_robots::Geometry;
use nalgebra::{Isometry3, Point3, Vector3};

/// Faces around a cylinder or a sphere.
const ROUND: usize = 20;

/// A primitive in the world.
#[derive(Debug, Clone)]
pub(super) struct Solid {
    pub(super) pose: Isometry3<f64>,
    pub(super) geometry: Geometry,
    /// Red, green, blue from 0 to 1.
    pub(super) colour: [f64; 3],
}

/// A flat convex polygon, counterclockwise seen from outside.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub(super) points: Vec<Point3<f64>>,
    pub(super) normal: Vector3<f64>,
    pub(super) colour: [f64; 3],
}

impl Solid {
    /// Its surface; nothing for a mesh.
    pub(super) fn faces(&self) -> Vec<Face> {
        let outlines = match &self.geometry {
            Geometry::Box { size } => block(size / 2.0),
            &Geometry::Cylinder { radius, length } => {
                tower(&[(radius, -length / 2.0), (radius, length / 2.0)])
            }
            &Geometry::Sphere { radius } => tower(&rings(radius, 0.0)),
            &Geometry::Capsule { radius, length } => tower(&rings(radius, length)),
            Geometry::Mesh { .. } => Vec::new(),
        };
        let face = |points: Vec<Point3<f64>>| {
            let points: Vec<_> = points.iter().map(|point| self.pose * point).collect();
            let normal = normal(&points)?;
            Some(Face { points, normal, colour: self.colour })
        };
        outlines.into_iter().filter_map(face).collect()
    }

    /// Whether a point of the world lies inside, by a margin.
    pub(super) fn contains(&self, point: &Point3<f64>) -> bool {
        let p = self.pose.inverse_transform_point(point);
        let margin = 1e-6;
        match &self.geometry {
            Geometry::Box { size } => (0..3).all(|i| p[i].abs() < size[i] / 2.0 - margin),
            &Geometry::Cylinder { radius, length } => {
                // The flat faces lie inside the round body.
                let radius = radius * (PI / ROUND as f64).cos();
                p.x.hypot(p.y) < radius - margin && p.z.abs() < length / 2.0 - margin
            }
            &Geometry::Sphere { radius } => p.coords.norm() < 0.95 * radius - margin,
            &Geometry::Capsule { radius, length } => {
                let along = p.z.clamp(-length / 2.0, length / 2.0);
                (p - Point3::new(0.0, 0.0, along)).norm() < 0.95 * radius - margin
            }
            Geometry::Mesh { .. } => false,
        }
    }
}

/// Newell's normal; `None` where there is no area.
fn normal(points: &[Point3<f64>]) -> Option<Vector3<f64>> {
    let mut sum = Vector3::zeros();
    for (here, next) in points.iter().zip(points.iter().cycle().skip(1)) {
        sum += here.coords.cross(&next.coords);
    }
    sum.try_normalize(1e-12)
}

fn block(h: Vector3<f64>) -> Vec<Vec<Point3<f64>>> {
    let corner = |x: f64, y: f64, z: f64| Point3::new(x * h.x, y * h.y, z * h.z);
    let mut faces = Vec::new();
    for side in [-1.0, 1.0] {
        let quads = [
            [
                corner(side, -1.0, -1.0),
                corner(side, 1.0, -1.0),
                corner(side, 1.0, 1.0),
                corner(side, -1.0, 1.0),
            ],
            [
                corner(-1.0, side, -1.0),
                corner(-1.0, side, 1.0),
                corner(1.0, side, 1.0),
                corner(1.0, side, -1.0),
            ],
            [
                corner(-1.0, -1.0, side),
                corner(1.0, -1.0, side),
                corner(1.0, 1.0, side),
                corner(-1.0, 1.0, side),
            ],
        ];
        for mut quad in quads.map(Vec::from) {
            if side < 0.0 {
                quad.reverse();
            }
            faces.push(quad);
        }
    }
    faces
}

/// Radius and height of the rings of a sphere, or of a capsule this long without its caps.
fn rings(radius: f64, length: f64) -> Vec<(f64, f64)> {
    let half = ROUND / 4;
    let ring = |step: usize| {
        let angle = PI * step as f64 / (2 * half) as f64;
        let lift = if step < half { -length / 2.0 } else { length / 2.0 };
        (radius * angle.sin(), -radius * angle.cos() + lift)
    };
    let mut rings: Vec<_> = (0..=2 * half).map(ring).collect();
    if length > 0.0 {
        rings.insert(half, (radius, -length / 2.0));
    }
    rings
}

/// A body of rings (radius, height) from bottom to top, closed at both ends.
fn tower(rings: &[(f64, f64)]) -> Vec<Vec<Point3<f64>>> {
    let point = |(radius, height): (f64, f64), step: usize| {
        let angle = TAU * step as f64 / ROUND as f64;
        Point3::new(radius * angle.cos(), radius * angle.sin(), height)
    };
    let mut faces = Vec::new();
    for pair in rings.windows(2) {
        let (low, high) = (pair[0], pair[1]);
        for step in 0..ROUND {
            let mut outline =
                vec![point(low, step), point(low, step + 1), point(high, step + 1), point(high, step)];
            outline.dedup_by(|a, b| (*a - *b).norm() < 1e-9);
            faces.push(outline);
        }
    }
    if let (Some(&bottom), Some(&top)) = (rings.first(), rings.last()) {
        faces.push((0..ROUND).rev().map(|step| point(bottom, step)).collect());
        faces.push((0..ROUND).map(|step| point(top, step)).collect());
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(geometry: Geometry) -> Solid {
        let pose = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.7, -1.1));
        Solid { pose, geometry, colour: [1.0; 3] }
    }

    #[test]
    fn every_face_looks_outward_and_together_they_enclose_the_volume() {
        let cases = [
            (Geometry::Box { size: Vector3::new(0.2, 0.3, 0.4) }, 0.024),
            (Geometry::Cylinder { radius: 0.1, length: 0.5 }, PI * 0.005),
            (Geometry::Sphere { radius: 0.2 }, 4.0 / 3.0 * PI * 0.008),
            (Geometry::Capsule { radius: 0.1, length: 0.3 }, PI * 0.003 + 4.0 / 3.0 * PI * 0.001),
        ];
        for (geometry, volume) in cases {
            let solid = solid(geometry);
            let centre = Point3::from(solid.pose.translation.vector);
            let mut enclosed = 0.0;
            for face in solid.faces() {
                let outward = face.normal.dot(&(face.points[0] - centre));
                assert!(outward > 0.0, "{:?} {outward}", solid.geometry);
                let area: f64 = face
                    .points
                    .windows(2)
                    .map(|pair| (pair[0] - face.points[0]).cross(&(pair[1] - face.points[0])).norm() / 2.0)
                    .sum();
                enclosed += area * outward / 3.0;
            }
            assert!((0.93..=1.0 + 1e-9).contains(&(enclosed / volume)), "{:?}: {enclosed}", solid.geometry);
        }
    }

    #[test]
    fn the_middle_is_inside_and_the_outside_is_not() {
        for geometry in [Geometry::Sphere { radius: 0.2 }, Geometry::Cylinder { radius: 0.2, length: 0.4 }] {
            let solid = solid(geometry);
            assert!(solid.contains(&Point3::new(1.0, -2.0, 0.5)));
            assert!(!solid.contains(&Point3::new(1.0, -2.0, 0.9)));
        }
    }
}
