//! Values of objects that are probably in another unit: degrees or millimetres.

use motorium_robots::{ModelWarning, TriangleMesh};
use nalgebra::Vector3;

use super::{Object, ObjectShape, World};

/// The unit of angles in worlds.
const RADIANS: &str = "angles are in radians";

impl World {
    /// Returns warnings of orientations that were probably written in degrees. Copies of an object count
    /// once.
    pub(super) fn warn_of_angles(&self, warnings: &mut Vec<ModelWarning>) {
        let mut seen: Vec<[f64; 3]> = Vec::new();
        for object in &self.objects {
            let name = &object.name;
            let mut check = |what: &str, rpy: [f64; 3]| {
                if !seen.contains(&rpy) {
                    seen.push(rpy);
                    warnings.extend(ModelWarning::of_angles(what, &rpy, RADIANS, None));
                }
            };
            check(&format!("`rpy` of object `{name}`"), object.rpy);
            if let ObjectShape::Compound(parts) = &object.shape {
                for (index, part) in parts.iter().enumerate() {
                    check(&format!("`rpy` of part {index} of object `{name}`"), part.rpy);
                }
            }
        }
    }

    /// Returns warnings of objects with sizes that were probably written in millimetres. Copies of an object
    /// count once.
    pub(super) fn warn_of_sizes(&self, warnings: &mut Vec<ModelWarning>) {
        let mut seen: Vec<&ObjectShape> = Vec::new();
        for object in &self.objects {
            if !seen.contains(&&object.shape) {
                seen.push(&object.shape);
                warnings.extend(doubtful_size(object));
            }
        }
    }
}

fn doubtful_size(object: &Object) -> Option<ModelWarning> {
    let [low, high] = ends(&object.shape)?;
    ModelWarning::of_object(&object.name, (high - low).into(), object.is_dynamic())
}

/// Returns the lowest and the highest coordinates of a shape in its own axes \[m\]; `None` for a mesh that
/// cannot be read. The orientations of parts are neglected.
fn ends(shape: &ObjectShape) -> Option<[Vector3<f64>; 2]> {
    let about = |sides: Vector3<f64>| [-0.5 * sides, 0.5 * sides];
    Some(match shape {
        ObjectShape::Box { size } => about(Vector3::from(*size)),
        ObjectShape::Sphere { radius } => about(Vector3::repeat(2.0 * radius)),
        ObjectShape::Cylinder { radius, length } => about(Vector3::new(2.0 * radius, 2.0 * radius, *length)),
        ObjectShape::Capsule { radius, length } => {
            about(Vector3::new(2.0 * radius, 2.0 * radius, length + 2.0 * radius))
        }
        ObjectShape::Mesh(mesh) => match mesh.read.get() {
            Some(body) => around(&body.as_ref().ok()?.mesh)?,
            None => {
                let [a, b] = around(&TriangleMesh::read(&mesh.file).ok()?)?
                    .map(|end| end.component_mul(&Vector3::from(mesh.scale)));
                [a.inf(&b), a.sup(&b)]
            }
        },
        ObjectShape::Compound(parts) => {
            let of_parts = parts.iter().filter_map(|part| {
                let place = Vector3::from(part.position);
                Some(ends(&part.shape)?.map(|end| end + place))
            });
            of_parts.reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])])?
        }
    })
}

/// Returns the lowest and the highest coordinates of the corners of a mesh; `None` without any.
fn around(mesh: &TriangleMesh) -> Option<[Vector3<f64>; 2]> {
    let corners = mesh.points.iter().map(|point| [*point; 2]);
    corners.reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])])
}
