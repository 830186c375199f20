//! Values of worlds that are probably in another unit, such as degrees, millimetres or grams.

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

/// Longest plausible distance of an object from the origin \[m\].
const FARTHEST: f64 = 1000.0;
/// Highest plausible velocity of an object \[m/s\].
const FASTEST: f64 = 1000.0;
/// Highest plausible velocity of the air or of a moving surface \[m/s\].
const STRONGEST_WIND: f64 = 100.0;
/// Highest plausible density of the surrounding fluid \[kg/m3\], slightly above salt water.
const DENSEST_FLUID: f64 = 1100.0;
/// Density of osmium \[kg/m3\], the largest of a solid.
const OSMIUM: f64 = 22_590.0;
/// Lowest plausible density of a solid \[kg/m3\]. Every metal in g/cm3 up to 9 is below it.
const LIGHTEST: f64 = 10.0;

const MILLIMETRES: &str = "if it is in millimetres, divide it by 1000";
const MILLIMETRES_PER_SECOND: &str = "if it is in mm/s, divide it by 1000";

/// Returns the largest magnitude of some numbers.
fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |largest: f64, number| largest.max(number.abs()))
}

impl World {
    /// Returns warnings of distances, velocities, masses and densities that were probably written in another
    /// unit, one of each for all objects.
    pub(super) fn warn_of_units(&self, warnings: &mut Vec<ModelWarning>) {
        let mut warn = |what: String, value: f64, (unit, expected): (&'static str, &'static str), advice| {
            warnings.push(ModelWarning::Implausible { what, value, unit, expected, advice });
        };
        let wind = largest(&self.wind);
        if wind > STRONGEST_WIND {
            warn("world: `wind`".to_owned(), wind, ("m/s", "at most 100 m/s"), MILLIMETRES_PER_SECOND);
        }
        if self.air_density > DENSEST_FLUID {
            let advice = "if it is in g/m3, divide it by 1000";
            warn(
                "world: `air_density`".to_owned(),
                self.air_density,
                ("kg/m3", "at most 1100 kg/m3"),
                advice,
            );
        }
        if let Some(ground) = &self.ground {
            if ground.height.abs() > FARTHEST {
                warn("ground: `height`".to_owned(), ground.height, ("m", "-1000 to 1000 m"), MILLIMETRES);
            }
            let speed = ground.conveyor.map_or(0.0, |conveyor| largest(&conveyor.velocity));
            if speed > STRONGEST_WIND {
                let what = "ground: `conveyor.velocity`".to_owned();
                warn(what, speed, ("m/s", "at most 100 m/s"), MILLIMETRES_PER_SECOND);
            }
        }
        let objects = || self.objects.iter();
        let named = |object: &Object, field: &str| format!("object \"{}\": `{field}`", object.name);
        if let Some(object) = objects().find(|object| largest(&object.position) > FARTHEST) {
            let value = largest(&object.position);
            warn(named(object, "position"), value, ("m", "at most 1000 m"), MILLIMETRES);
        }
        if let Some(object) = objects().find(|object| largest(&object.velocity) > FASTEST) {
            let value = largest(&object.velocity);
            warn(named(object, "velocity"), value, ("m/s", "at most 1000 m/s"), MILLIMETRES_PER_SECOND);
        }
        let speed = |object: &Object| object.conveyor.map_or(0.0, |conveyor| largest(&conveyor.velocity));
        if let Some(object) = objects().find(|object| speed(object) > STRONGEST_WIND) {
            let what = named(object, "conveyor.velocity");
            warn(what, speed(object), ("m/s", "at most 100 m/s"), MILLIMETRES_PER_SECOND);
        }
        let light = |object: &Object| object.density.filter(|density| (0.0..LIGHTEST).contains(density));
        if let Some((object, density)) = objects().find_map(|object| Some((object, light(object)?))) {
            let advice = "if it is in g/cm3, multiply it by 1000";
            warn(named(object, "density"), density, ("kg/m3", "at least 10 kg/m3"), advice);
        }
        let heavy = |object: &Object| density(object).filter(|density| *density > OSMIUM);
        if let Some((object, density)) = objects().find_map(|object| Some((object, heavy(object)?))) {
            let what = format!("object \"{}\": the density of its mass", object.name);
            let advice = "if the mass is in grams, divide it by 1000";
            warn(what, density.round(), ("kg/m3", "at most 22590 kg/m3, osmium's"), advice);
        }
    }
}

/// Returns the density of a moving object without meshes \[kg/m3\].
fn density(object: &Object) -> Option<f64> {
    if matches!(object.shape, ObjectShape::Mesh(_)) || !object.is_dynamic() {
        return None;
    }
    let volume = object.shape.volume().filter(|volume| *volume > 0.0)?;
    Some(object.mass_properties()?.mass / volume)
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
