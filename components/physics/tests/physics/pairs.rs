//! Every pair of shapes comes to rest: on faces wider than the body, and on narrower rails and rows.

use motorium_physics::{Object, ObjectShape, Terrain, World};
use motorium_robots::TriangleMesh;
use motorium_worlds::MeshCollision;
use nalgebra::{Isometry3, Vector3};

use crate::meshes::{box_between, floor, joined, mesh, pendulum, prism};
use motorium_physics::{ArticulatedSimulator, Options, Simulator};

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// Largest drift of a body at rest \[m\]; the bound of its rotation is 0.1 degrees \[rad\].
pub(crate) const DRIFT: f64 = 1e-4;
pub(crate) const ROTATION: f64 = 1.745e-3;

/// Settling time of a body after it has been placed, and the time for which it then rests \[s\].
const SETTLING: f64 = 1.0;
const RESTING: f64 = 10.0;

fn object(name: &str, shape: ObjectShape) -> Object {
    Object { name: name.to_owned(), shape, friction: 0.8, ..Object::default() }
}

/// A body of 0.2 kg, and the height of its centre above a level face \[m\].
pub(crate) struct Body {
    pub(crate) object: Object,
    pub(crate) height: f64,
}

/// Bodies of every movable shape, some of them in two orientations. Long bodies are aligned with x.
pub(crate) fn bodies() -> Vec<Body> {
    let lying = [0.0, QUARTER, 0.0];
    let body = |name: &str, shape, height: f64, rpy: [f64; 3]| Body {
        object: Object { mass: Some(0.2), rpy, ..object(name, shape) },
        height,
    };
    let of_mesh = |name: &str, shape, collision, height: f64| {
        let Object { shape, .. } = mesh(name, shape, collision);
        body(name, shape, height, [0.0; 3])
    };
    let along_x = |prism: TriangleMesh| TriangleMesh {
        points: prism.points.iter().map(|point| Vector3::new(point.z, point.y, -point.x)).collect(),
        triangles: prism.triangles,
    };
    // A table of two parts: a plate on a foot.
    let plate = box_between([-0.1, -0.06, 0.02], [0.1, 0.06, 0.04]);
    let foot = box_between([-0.08, -0.05, -0.02], [0.08, 0.05, 0.02]);
    vec![
        body("sphere", ObjectShape::Sphere { radius: 0.04 }, 0.04, [0.0; 3]),
        body("box", ObjectShape::Box { size: [0.12, 0.1, 0.05] }, 0.025, [0.0; 3]),
        body("long box", ObjectShape::Box { size: [0.3, 0.04, 0.04] }, 0.02, [0.0; 3]),
        body("standing cylinder", ObjectShape::Cylinder { radius: 0.06, length: 0.08 }, 0.04, [0.0; 3]),
        body("lying cylinder", ObjectShape::Cylinder { radius: 0.02, length: 0.3 }, 0.02, lying),
        body("capsule", ObjectShape::Capsule { radius: 0.02, length: 0.26 }, 0.02, lying),
        of_mesh("hull", along_x(prism(6, 0.02, 0.3)), MeshCollision::Hull, 0.02),
        of_mesh("short hull", prism(12, 0.06, 0.08), MeshCollision::Hull, 0.04),
        of_mesh("mesh", joined(&[plate, foot]), MeshCollision::Parts(2), 0.02),
    ]
}

/// A support for a body, with its highest faces or lines level at z = 0.
struct Support {
    name: String,
    objects: Vec<Object>,
    terrain: Option<Terrain>,
    /// Long bodies are placed in its groove, not across it.
    groove: bool,
}

/// Two rails along x of a shape that extends `depth` below its top \[m\], `apart` from each other.
fn rails(name: &str, shape: &ObjectShape, [depth, apart]: [f64; 2], rpy: [f64; 3]) -> Vec<Object> {
    let rail = |side: f64| Object {
        position: [0.0, 0.5 * side * apart, -depth],
        rpy,
        ..object(&format!("{name}{side}"), shape.clone())
    };
    vec![rail(-1.0), rail(1.0)]
}

/// Supports of every shape, wide and narrow.
fn supports() -> Vec<Support> {
    let lying = [0.0, QUARTER, 0.0];
    let support = |name: &str, objects: Vec<Object>| Support {
        name: name.to_owned(),
        objects,
        terrain: None,
        groove: false,
    };
    let shape_of = |mesh: Object| mesh.shape;
    let rows = |name: &str, radius: f64, apart: f64| {
        let ball = |index: i32, side: f64| Object {
            position: [0.04 * f64::from(index), 0.5 * side * apart, -radius],
            ..object(&format!("{name} {index} {side}"), ObjectShape::Sphere { radius })
        };
        let objects = (-4..=4).flat_map(|index| [ball(index, -1.0), ball(index, 1.0)]).collect();
        Support { groove: true, ..support(name, objects) }
    };
    let terrain = |name: &str, layers: &str| {
        let text = format!("size = [1.0, 0.4]\nspacing = 0.02\nfriction = 0.8\n{layers}");
        Support { terrain: Some(toml::from_str(&text).unwrap()), groove: true, ..support(name, Vec::new()) }
    };
    let hexagon = |radius, length| shape_of(mesh("hexagon", prism(6, radius, length), MeshCollision::Hull));
    let bar = || box_between([-0.2, -0.01, -0.01], [0.2, 0.01, 0.01]);
    let triangles = |shape| shape_of(mesh("triangles", shape, MeshCollision::Triangles));
    let cylinder = |radius, length| ObjectShape::Cylinder { radius, length };
    let capsule = |radius| ObjectShape::Capsule { radius, length: 0.4 };
    let on_top = |name: &str, shape, depth: f64| {
        support(name, vec![Object { position: [0.0, 0.0, -depth], ..object(name, shape) }])
    };
    let level = [0.0; 3];
    vec![
        rows("narrow spheres", 0.01, 0.03),
        rows("wide spheres", 0.1, 0.06),
        support(
            "narrow boxes",
            rails("rail", &ObjectShape::Box { size: [0.4, 0.02, 0.02] }, [0.01, 0.06], level),
        ),
        on_top("wide box", ObjectShape::Box { size: [1.0, 1.0, 0.1] }, 0.05),
        support("narrow cylinders", rails("rail", &cylinder(0.01, 0.4), [0.01, 0.06], lying)),
        on_top("wide cylinder", cylinder(0.5, 0.1), 0.05),
        support("narrow capsules", rails("rail", &capsule(0.01), [0.01, 0.06], lying)),
        support("wide capsules", rails("rail", &capsule(0.1), [0.1, 0.06], lying)),
        // A flat side of the hexagon faces up.
        support("narrow hulls", rails("rail", &hexagon(0.01, 0.4), [0.01, 0.06], lying)),
        on_top("wide hull", hexagon(0.5, 0.1), 0.05),
        support("narrow triangles", rails("rail", &triangles(bar()), [0.01, 0.06], level)),
        on_top("wide triangles", triangles(floor(|_, _| 0.0)), 0.0),
        terrain(
            "narrow terrain",
            "layers = [{ equation = { height = '-0.04 * min(1, max(0, (abs(abs(y) - 0.03) - 0.01) / 0.02))' } }]",
        ),
        terrain("wide terrain", "layers = [{ equation = { height = '0' } }]"),
    ]
}

/// Largest displacement and rotation of an object between `settling` \[s\] and `resting` \[s\] later, and its
/// final speed.
pub(crate) fn drift(
    simulation: &mut dyn Simulator,
    name: &str,
    [settling, resting]: [f64; 2],
) -> (f64, f64, f64) {
    let id = simulation.object(name).unwrap();
    (0..(settling * 1e3) as usize).for_each(|_| _ = simulation.step(1e-3).unwrap());
    let start = simulation.object_pose(id);
    let (mut far, mut turned) = (0.0_f64, 0.0_f64);
    for _ in 0..(resting * 1e3) as usize {
        simulation.step(1e-3).unwrap();
        let pose = simulation.object_pose(id);
        far = far.max((start.translation.vector - pose.translation.vector).norm());
        turned = turned.max(start.rotation.angle_to(&pose.rotation));
    }
    let (linear, angular) = simulation.object_velocity(id);
    (far, turned, linear.norm() + angular.norm())
}

#[test]
fn every_shape_rests_on_every_other() {
    let mut failures = Vec::new();
    for support in supports() {
        for Body { object: body, height } in bodies() {
            let turn = if support.groove { 0.0 } else { 0.4 };
            let rotation = Isometry3::rotation(Vector3::z() * turn)
                * Isometry3::new(Vector3::zeros(), Vector3::y() * body.rpy[1]);
            let body =
                Object { position: [0.0, 0.0, height], rpy: rotation.rotation.euler_angles().into(), ..body };
            let name = body.name.clone();
            let objects = support.objects.iter().cloned().chain([body]).collect();
            let world = World { objects, terrain: support.terrain.clone(), ..World::default() };
            let mut simulation =
                ArticulatedSimulator::new(pendulum(), world, &[0.0], Options::default()).unwrap();
            let (far, turned, speed) = drift(&mut simulation, &name, [SETTLING, RESTING]);
            if far > DRIFT || turned > ROTATION || speed > 0.0 {
                failures.push(format!(
                    "{name} on {}: {:.4} mm, {:.4} degrees, {speed:.1e} m/s",
                    support.name,
                    far * 1e3,
                    turned.to_degrees()
                ));
            }
        }
    }
    assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), 14 * 9, failures.join("\n"));
}
