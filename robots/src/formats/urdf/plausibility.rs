//! Plausibility of a whole model: followers with narrower limits than their leaders, sizes in another unit.

use nalgebra::Vector3;

use super::inertia::principal_moments;
use super::warning::ModelWarning;
use crate::model::followers::is_below;
use crate::{Geometry, Model, Shape, TriangleMesh};

/// Length that no part of a common robot reaches \[m\]. A part of 20 mm in a file in millimetres does.
const LONGEST: f64 = 20.0;

/// Reports suspicious properties that do not prevent loading.
pub(crate) fn warn_of_model(model: &Model, warnings: &mut Vec<ModelWarning>) {
    warn_of_followers(model, warnings);
    warn_of_sizes(model, warnings);
}

fn warn_of_followers(model: &Model, warnings: &mut Vec<ModelWarning>) {
    for follower in model.bodies().iter().map(|body| &body.joint) {
        let index = follower.coordinate.index();
        let leader = model.joint(index);
        let names = || (leader.name.clone(), follower.name.clone());
        let file = leader.limits;
        if let Some([low, high]) = follower.range_of_leader() {
            if low.max(file.lower) > high.min(file.upper) {
                let (leader, joint) = names();
                let (lower, upper) = (follower.limits.lower, follower.limits.upper);
                warnings.push(ModelWarning::FollowerOutside { joint, leader, lower, upper });
            } else if is_below(file.lower, low) || is_below(high, file.upper) {
                let (joint, follower) = names();
                let (lower, upper) = (low.max(file.lower), high.min(file.upper));
                let file = [file.lower, file.upper];
                warnings.push(ModelWarning::FollowerRange { joint, follower, lower, upper, file });
            }
        }
        if let Some(velocity) = follower.velocity_of_leader().filter(|own| is_below(*own, file.velocity)) {
            let (joint, follower) = names();
            let file = file.velocity;
            warnings.push(ModelWarning::FollowerVelocity { joint, follower, velocity, file });
        }
    }
}

/// Reports links with a part longer than [`LONGEST`]: the inertia, a collision shape of a moving link, or the
/// distance from the carrying body. The base and the world may be larger.
fn warn_of_sizes(model: &Model, warnings: &mut Vec<ModelWarning>) {
    for frame in model.frames() {
        let Some(body) = frame.body.map(|body| &model.bodies()[body]) else { continue };
        let gyration = match frame.inertia.mass {
            mass if mass > 0.0 => (principal_moments(&frame.inertia.rotational)[2].max(0.0) / mass).sqrt(),
            _ => 0.0,
        };
        let shapes = body.shapes.iter().filter(|shape| shape.link == frame.name);
        let length = shapes.filter_map(length).fold(0.0, f64::max);
        let carried = body.parent.is_some() && body.name == frame.name;
        let distance = match carried {
            true => body.joint.placement.translation.vector.norm(),
            false => frame.placement.translation.vector.norm(),
        };
        let lengths = [
            ("collision shape", length),
            ("radius of gyration", gyration),
            ("distance from its parent", distance),
        ];
        let found = lengths.into_iter().find(|(_, metres)| *metres > LONGEST);
        if let Some((what, metres)) = found {
            warnings.push(ModelWarning::Oversized { link: frame.name.clone(), what, metres });
        }
    }
}

/// Returns the longest side of a shape \[m\]; `None` for a mesh in a separate file, which the URDF reader
/// does not open.
fn length(shape: &Shape) -> Option<f64> {
    Some(match &shape.geometry {
        Geometry::Box { size } => size.max(),
        &Geometry::Cylinder { radius, length } => length.max(2.0 * radius),
        &Geometry::Capsule { radius, length } => length + 2.0 * radius,
        &Geometry::Sphere { radius } => 2.0 * radius,
        Geometry::Mesh { inline, scale, .. } => longest_side(inline.as_ref()?, scale),
    })
}

/// Returns the longest side of a mesh along the axes of its file \[m\].
fn longest_side(mesh: &TriangleMesh, scale: &Vector3<f64>) -> f64 {
    let Some(first) = mesh.points.first() else { return 0.0 };
    let ends = mesh.points.iter().fold((*first, *first), |(low, high), x| (low.inf(x), high.sup(x)));
    (ends.1 - ends.0).component_mul(scale).amax()
}

impl ModelWarning {
    /// Returns warnings about implausible mesh sizes of moving links, read from their files. Unreadable
    /// meshes are skipped; distances and contacts reject them.
    pub fn of_meshes(model: &Model) -> Vec<Self> {
        let mut warnings = Vec::new();
        for shape in model.bodies().iter().flat_map(|body| &body.shapes) {
            let Geometry::Mesh { path: Some(path), inline: None, scale, .. } = &shape.geometry else {
                continue;
            };
            let Ok(mesh) = TriangleMesh::read(path) else { continue };
            let metres = longest_side(&mesh, scale);
            if metres > LONGEST {
                warnings.push(Self::Oversized { link: shape.link.clone(), what: "mesh", metres });
            }
        }
        warnings
    }
}
