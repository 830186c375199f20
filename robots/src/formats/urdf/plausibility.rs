//! Plausibility of a whole model. Finds mimic joints (followers) with narrower limits than the joints that
//! they follow, and sizes, inertias and limits that were probably written in the wrong unit.

use core::f64::consts::PI;

use nalgebra::Vector3;

use super::inertia::principal_moments;
use super::warning::ModelWarning;
use crate::model::followers::is_below;
use crate::{Geometry, JointKind, Model, Position, Shape, TriangleMesh, suspected_degrees};

/// Length that no part of a common robot reaches \[m\]. A part of 20 mm in a file in millimetres does.
pub(crate) const LONGEST: f64 = 20.0;
/// Longest shortest side of a fixed object \[m\]: no wall, table or building is thicker.
const THICKEST: f64 = 100.0;
/// Largest radius of gyration \[m\]: a rod of length [`LONGEST`] has it.
const LARGEST_GYRATION: f64 = 0.289 * LONGEST;
/// Density of osmium \[kg/m3\], the largest of a solid.
const OSMIUM: f64 = 22_590.0;
/// Fraction of the moment of a ball of osmium below which an inertia is in another unit. Files of real robots
/// have roughly estimated inertias down to a thousandth of it.
const TINY: f64 = 1e-4;
/// Highest velocity of a prismatic joint \[m/s\].
const FASTEST: f64 = 100.0;
/// Limits from this multiple of a plausible one on mean that there is no limit.
const UNLIMITED: f64 = 250.0;

/// Reports suspicious properties that do not prevent loading.
pub(crate) fn warn_of_model(model: &Model, warnings: &mut Vec<ModelWarning>) {
    warn_of_followers(model, warnings);
    warn_of_sizes(model, warnings);
    warn_of_inertias(model, warnings);
    warn_of_slides(model, warnings);
}

/// Reports inertias that no body of the link's mass has. The links of a fixed base are not checked.
fn warn_of_inertias(model: &Model, warnings: &mut Vec<ModelWarning>) {
    for frame in model.frames() {
        let moves = frame.body.is_some() || model.base().floating && !frame.in_world;
        let mass = frame.inertia.mass;
        if !moves || mass <= 0.0 {
            continue;
        }
        let [low, _, largest] = principal_moments(&frame.inertia.rotational);
        // a ball has the least moment of all bodies of its volume
        let radius = (0.75 * mass / (PI * OSMIUM)).cbrt();
        let least = 0.4 * mass * radius * radius;
        if low > 0.0 && largest < TINY * least {
            let link = frame.name.clone();
            warnings.push(ModelWarning::TinyInertia { link, largest, mass, least });
        }
    }
}

/// Reports prismatic joints with a range or a velocity that no joint of a common robot has.
fn warn_of_slides(model: &Model, warnings: &mut Vec<ModelWarning>) {
    let is_doubtful = |value: f64, most: f64| value > most && value <= UNLIMITED * most;
    for body in model.bodies() {
        let joint = &body.joint;
        if joint.kind != JointKind::Prismatic {
            continue;
        }
        let (name, limits) = (|| joint.name.clone(), &joint.limits);
        // Slides from the world on, of bare links with equal limits both ways, model a base that moves.
        let parents = core::iter::successors(body.parent, |parent| model.bodies()[*parent].parent);
        let of_base = body.shapes.is_empty()
            && limits.lower == -limits.upper
            && parents.into_iter().all(|parent| model.bodies()[parent].joint.kind == JointKind::Prismatic);
        if is_doubtful(limits.upper - limits.lower, LONGEST) && !of_base {
            let (joint, lower, upper) = (name(), limits.lower, limits.upper);
            warnings.push(ModelWarning::LongSlide { joint, lower, upper, most: LONGEST });
        }
        if is_doubtful(limits.velocity, FASTEST) {
            let (joint, velocity) = (name(), limits.velocity);
            warnings.push(ModelWarning::FastSlide { joint, velocity, most: FASTEST });
        }
    }
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
            ("collision shape", length, LONGEST),
            ("radius of gyration", gyration, LARGEST_GYRATION),
            ("distance from its parent", distance, LONGEST),
        ];
        let found = lengths.into_iter().find(|(_, metres, most)| metres > most);
        if let Some((what, metres, _)) = found {
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
        Geometry::Mesh { inline, scale, .. } => extent(inline.as_ref()?).component_mul(scale).amax(),
    })
}

/// Returns the sides of the box around a mesh along the axes of its file \[m\].
pub(crate) fn extent(mesh: &TriangleMesh) -> Vector3<f64> {
    let Some(first) = mesh.points.first() else { return Vector3::zeros() };
    let ends = mesh.points.iter().fold((*first, *first), |(low, high), x| (low.inf(x), high.sup(x)));
    ends.1 - ends.0
}

impl ModelWarning {
    /// Returns a warning if an angle \[rad\] was probably written in degrees. `what` describes the value in
    /// the message, such as `rpy of a camera`. `format` states the unit that the file format requires, such
    /// as `URDF has radians`.
    ///
    /// ```
    /// use motorium_robots::ModelWarning;
    ///
    /// let warn = |rpy: [f64; 3]| ModelWarning::of_angles("rpy of a camera", &rpy, "URDF has radians", None);
    /// assert_eq!(
    ///     warn([0.0, 90.0, 0.0]).unwrap().to_string(),
    ///     "rpy of a camera has an angle of 90 rad; URDF has radians: if these are degrees, write 1.5708"
    /// );
    /// assert_eq!(warn([0.0, 6.28, -4.7]), None);
    /// ```
    pub fn of_angles(what: &str, angles: &[f64], format: &'static str, at: Option<Position>) -> Option<Self> {
        let angle = angles.iter().copied().find(|angle| suspected_degrees(*angle).is_some())?;
        Some(Self::Degrees { what: what.to_owned(), format, angle, at })
    }

    /// Returns a warning if an object of a world has an implausible side length. `sides` are the side lengths
    /// of the object \[m\]. Fixed objects, such as buildings, may be larger than moving objects.
    pub fn of_object(object: &str, sides: [f64; 3], moves: bool) -> Option<Self> {
        let (what, metres, most) = match moves {
            true => ("longest side", sides.into_iter().fold(0.0, f64::max), LONGEST),
            false => ("shortest side", sides.into_iter().fold(f64::INFINITY, f64::min), THICKEST),
        };
        let is_wrong = metres.is_finite() && metres > most;
        is_wrong.then(|| Self::OversizedObject { object: object.to_owned(), what, metres, most })
    }
}
