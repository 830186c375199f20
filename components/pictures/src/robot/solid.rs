//! Primitives, and meshes or their hulls, as bodies with flat faces.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use motorium_robots::{Geometry, TriangleMesh};
use nalgebra::{Isometry3, Point3, Vector3};

/// Faces around a cylinder or a sphere.
const ROUND: usize = 20;

/// Faces around it where they are shaded smoothly.
const SMOOTH: usize = 48;

/// Largest number of corners of a mesh's hull: more are not visible.
const CORNERS: usize = 100;

/// Grid cells along the longest side of a mesh drawn unchanged.
const CELLS: f64 = 40.0;

/// Number of triangles below which a mesh is not simplified.
const FEW: usize = 1000;

/// A body in the world, convex except for visual meshes.
#[derive(Debug, Clone)]
pub(super) struct Solid {
    pub(super) pose: Isometry3<f64>,
    pub(super) form: Form,
    /// Red, green, blue from 0 to 1.
    pub(super) colour: [f64; 3],
}

/// Shape and colour of a body.
#[derive(Debug, Clone)]
pub(super) enum Form {
    Primitive(Geometry),
    Hull(TriangleMesh),
    /// A mesh that need not be convex.
    Mesh(Arc<Skin>),
}

/// A mesh and the normals at the corners of its triangles.
#[derive(Debug)]
pub(super) struct Skin {
    pub(super) mesh: TriangleMesh,
    pub(super) normals: Vec<[Vector3<f64>; 3]>,
}

impl Skin {
    pub(super) fn new(mesh: TriangleMesh) -> Self {
        Self { normals: mesh.corner_normals(), mesh }
    }
}

/// Treatment of meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// As hulls.
    Hull,
    /// Without very small triangles, which would not be visible in an SVG picture of thousands of paths.
    Coarse,
    /// Unchanged.
    Full,
}

impl Form {
    /// Creates the form of a shape. Returns `None` for a mesh that cannot be read or has a flat hull.
    pub(super) fn from_geometry(geometry: &Geometry, detail: Detail) -> Option<Self> {
        let Geometry::Mesh { path, inline, scale, .. } = geometry else {
            return Some(Self::Primitive(geometry.clone()));
        };
        let mesh = match inline {
            Some(mesh) => TriangleMesh::clone(mesh),
            None => TriangleMesh::read(path.as_ref()?).ok()?,
        };
        let mesh = mesh.scaled(scale);
        Some(match detail {
            Detail::Hull => Self::Hull(mesh.hull(CORNERS)?),
            Detail::Coarse => Self::Mesh(Arc::new(Skin::new(coarser(&mesh)))),
            Detail::Full => Self::Mesh(Arc::new(Skin::new(mesh))),
        })
    }
}

/// A flat convex polygon, counterclockwise seen from outside.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub(super) points: Vec<Point3<f64>>,
    pub(super) normal: Vector3<f64>,
    pub(super) colour: [f64; 3],
}

impl Solid {
    /// Returns the surface of the body as faces.
    pub(super) fn faces(&self) -> Vec<Face> {
        let outlines = self.outlines(ROUND);
        let face = |points: Vec<Point3<f64>>| {
            let points: Vec<_> = points.iter().map(|point| self.pose * point).collect();
            let normal = normal(&points)?;
            Some(Face { points, normal, colour: self.colour })
        };
        outlines.into_iter().filter_map(face).collect()
    }

    /// Returns the surface of the body in its own frame, as outlines.
    fn outlines(&self, round: usize) -> Vec<Vec<Point3<f64>>> {
        match &self.form {
            Form::Primitive(geometry) => primitive(geometry, round),
            Form::Hull(mesh) => triangles(mesh).map(Vec::from).collect(),
            Form::Mesh(skin) => triangles(&skin.mesh).map(Vec::from).collect(),
        }
    }

    /// Returns the surface of the body in its own frame, as triangles that share corners.
    pub(super) fn skin(&self) -> Arc<Skin> {
        if let Form::Mesh(skin) = &self.form {
            return skin.clone();
        }
        let (mut mesh, mut known) = (TriangleMesh::default(), BTreeMap::new());
        for outline in self.outlines(SMOOTH) {
            let mut corner = |point: &Point3<f64>| {
                let key: [i64; 3] = point.coords.map(|x| (1e7 * x).round() as i64).into();
                *known.entry(key).or_insert_with(|| {
                    mesh.points.push(point.coords);
                    mesh.points.len() as u32 - 1
                })
            };
            let corners: Vec<u32> = outline.iter().map(&mut corner).collect();
            mesh.triangles
                .extend((2..corners.len()).map(|last| [corners[0], corners[last - 1], corners[last]]));
        }
        Arc::new(Skin::new(mesh))
    }

    /// Returns the length of the longest side of the box around the body's corners, in the body's frame
    /// \[m\].
    pub(super) fn extent(&self) -> f64 {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for point in self.outlines(ROUND).iter().flatten() {
            (low, high) = (low.inf(&point.coords), high.sup(&point.coords));
        }
        (high - low).max()
    }

    /// Returns the corners of the body in the world.
    pub(super) fn corners(&self) -> Vec<Point3<f64>> {
        self.outlines(ROUND).iter().flatten().map(|point| self.pose * point).collect()
    }

    /// Returns `true` if the body contains a point of the world, by a margin.
    pub(super) fn contains(&self, point: &Point3<f64>) -> bool {
        let p = self.pose.inverse_transform_point(point);
        let margin = 1e-6;
        let geometry = match &self.form {
            Form::Primitive(geometry) => geometry,
            Form::Hull(hull) => {
                return triangles(hull).all(|[a, b, c]| {
                    (b - a).cross(&(c - a)).try_normalize(0.0).is_none_or(|out| out.dot(&(p - a)) < -margin)
                });
            }
            Form::Mesh(_) => return false,
        };
        match geometry {
            Geometry::Box { size } => (0..3).all(|i| p[i].abs() < size[i] / 2.0 - margin),
            &Geometry::Cylinder { radius, length } => {
                // The flat faces are inside the round body.
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

fn primitive(geometry: &Geometry, round: usize) -> Vec<Vec<Point3<f64>>> {
    match *geometry {
        Geometry::Box { size } => block(size / 2.0),
        Geometry::Cylinder { radius, length } => {
            tower(&[(radius, -length / 2.0), (radius, length / 2.0)], round)
        }
        Geometry::Sphere { radius } => tower(&rings(radius, 0.0, round), round),
        Geometry::Capsule { radius, length } => tower(&rings(radius, length, round), round),
        Geometry::Mesh { .. } => Vec::new(),
    }
}

/// Returns the triangles of a hull, counterclockwise seen from outside.
fn triangles(hull: &TriangleMesh) -> impl Iterator<Item = [Point3<f64>; 3]> {
    let corner = |index: u32| Point3::from(hull.points[index as usize]);
    hull.triangles.iter().map(move |triangle| triangle.map(corner))
}

/// Merges the corners of a mesh within each grid cell at their mean; triangles smaller than a cell are not
/// visible.
fn coarser(mesh: &TriangleMesh) -> TriangleMesh {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for point in &mesh.points {
        (low, high) = (low.inf(point), high.sup(point));
    }
    let cell = (high - low).max() / CELLS;
    if mesh.triangles.len() < FEW || cell <= 0.0 {
        return mesh.clone();
    }
    let mut cells: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let (mut sums, mut counts): (Vec<Vector3<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut cell_of = |point: &Vector3<f64>| {
        let key = (point - low).map(|x| (x / cell).floor() as i64).into();
        let index = *cells.entry(key).or_insert(counts.len() as u32);
        if index as usize == counts.len() {
            sums.push(Vector3::zeros());
            counts.push(0.0);
        }
        sums[index as usize] += point;
        counts[index as usize] += 1.0;
        index
    };
    let of_points: Vec<u32> = mesh.points.iter().map(&mut cell_of).collect();
    let mut seen = BTreeSet::new();
    let triangles = mesh.triangles.iter().map(|triangle| triangle.map(|corner| of_points[corner as usize]));
    let triangles = triangles.filter(|[a, b, c]| {
        let mut sorted = [*a, *b, *c];
        sorted.sort_unstable();
        a != b && b != c && c != a && seen.insert(sorted)
    });
    let triangles = triangles.collect();
    TriangleMesh { points: sums.iter().zip(&counts).map(|(sum, count)| sum / *count).collect(), triangles }
}

/// Returns the normal of a polygon by Newell's method; `None` for a polygon without area.
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

/// Returns the radius and height of the rings of a capsule. `length` is the length of the capsule without its
/// caps; 0 for a sphere.
fn rings(radius: f64, length: f64, round: usize) -> Vec<(f64, f64)> {
    let half = round / 4;
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

/// Returns a body of rings (radius, height) from bottom to top, closed at both ends.
fn tower(rings: &[(f64, f64)], round: usize) -> Vec<Vec<Point3<f64>>> {
    let point = |(radius, height): (f64, f64), step: usize| {
        let angle = TAU * step as f64 / round as f64;
        Point3::new(radius * angle.cos(), radius * angle.sin(), height)
    };
    let mut faces = Vec::new();
    for pair in rings.windows(2) {
        let (low, high) = (pair[0], pair[1]);
        for step in 0..round {
            let mut outline =
                vec![point(low, step), point(low, step + 1), point(high, step + 1), point(high, step)];
            outline.dedup_by(|a, b| (*a - *b).norm() < 1e-9);
            faces.push(outline);
        }
    }
    if let (Some(&bottom), Some(&top)) = (rings.first(), rings.last()) {
        faces.push((0..round).rev().map(|step| point(bottom, step)).collect());
        faces.push((0..round).map(|step| point(top, step)).collect());
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(geometry: Geometry) -> Solid {
        let pose = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.7, -1.1));
        Solid { pose, form: Form::Primitive(geometry), colour: [1.0; 3] }
    }

    #[test]
    fn faces_look_outward_and_enclose_the_volume() {
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
                assert!(outward > 0.0, "{:?} {outward}", solid.form);
                let area: f64 = face
                    .points
                    .windows(2)
                    .map(|pair| (pair[0] - face.points[0]).cross(&(pair[1] - face.points[0])).norm() / 2.0)
                    .sum();
                enclosed += area * outward / 3.0;
            }
            assert!((0.93..=1.0 + 1e-9).contains(&(enclosed / volume)), "{:?}: {enclosed}", solid.form);
        }
    }

    #[test]
    fn centre_is_inside_and_exterior_is_not() {
        for geometry in [Geometry::Sphere { radius: 0.2 }, Geometry::Cylinder { radius: 0.2, length: 0.4 }] {
            let solid = solid(geometry);
            assert!(solid.contains(&Point3::new(1.0, -2.0, 0.5)));
            assert!(!solid.contains(&Point3::new(1.0, -2.0, 0.9)));
        }
    }
    #[test]
    fn existing_meshes_are_drawn_as_hulls() {
        // A tetrahedron with a corner inside of it, twice as high as in the file.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.obj");
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0.1 0.1 0.1\nf 1 2 3\nf 1 2 4\nf 2 3 5\nf 3 4 5\n";
        std::fs::write(&path, text).unwrap();
        let mesh = |path: Option<std::path::PathBuf>| Geometry::Mesh {
            uri: "part.obj".to_owned(),
            path,
            inline: None,
            scale: Vector3::new(1.0, 1.0, 2.0),
        };
        assert!(Form::from_geometry(&mesh(None), Detail::Hull).is_none());
        let form = Form::from_geometry(&mesh(Some(path)), Detail::Hull).unwrap();
        let solid = Solid { pose: Isometry3::translation(5.0, 0.0, 0.0), form, colour: [1.0; 3] };
        let faces = solid.faces();
        assert_eq!(faces.len(), 4);
        let middle = Point3::new(5.2, 0.2, 0.4);
        assert!(faces.iter().all(|face| face.normal.dot(&(face.points[0] - middle)) > 0.0));
        assert!(solid.contains(&middle) && !solid.contains(&Point3::new(5.0, 0.0, 2.1)));
    }
}
