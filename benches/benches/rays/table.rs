//! A Panda over a table with objects, observed by three sensors.

use std::fmt::Write;
use std::path::Path;

use motorium_robots::{Attachment, CollisionModel, CollisionOptions, ConvexShape, Kinematics, load};
use motorium_worlds::{Ground, Object, ObjectShape, Ray, RayScene, World};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

/// The rays of a scan.
pub(crate) struct Scan {
    pub(crate) name: &'static str,
    /// Name of the scan in the peer's driver.
    pub(crate) word: &'static str,
    pub(crate) rays: Vec<Ray>,
    /// Scans that are timed together.
    pub(crate) repeats: usize,
}

/// The scene and its scans.
pub(crate) struct TableTop {
    pub(crate) scene: RayScene,
    pub(crate) scans: [Scan; 3],
    /// The same shapes in MJCF, each as a separate body.
    pub(crate) mjcf: String,
}

/// Objects on the table.
const OBJECTS: usize = 20;

impl TableTop {
    pub(crate) fn new() -> Self {
        let panda = load("panda", Path::new(".")).expect("the catalogue's robots load");
        let profile = panda.profile.as_ref().expect("the catalogue's robots have profiles");
        let home = profile.home(&panda.model).expect("home is a pose");
        let mut kinematics = Kinematics::new(&panda.model);
        kinematics.update(&panda.model, home.as_slice());
        let solids =
            CollisionModel::new(&panda.model, &CollisionOptions::default()).expect("its shapes can be used");
        let (mut scene, world) = (RayScene::default(), world());
        scene.add_solids(&solids);
        let mut mjcf = String::from("<mujoco><worldbody><geom type=\"plane\" size=\"0 0 1\"/>");
        for index in 0..solids.solid_count() {
            let placement = solids.placement(index);
            let pose = match solids.attachment(index) {
                Attachment::Body(body) => kinematics.body_pose(body) * placement,
                Attachment::Base | Attachment::World => placement,
            };
            scene.set_pose(index, &pose);
            describe(&mut mjcf, &solids.convex_shape(index), &pose);
        }
        scene.add_world(&world);
        for object in &world.objects {
            let shape = object.shape.convex_shape().expect("its objects are simple");
            describe(&mut mjcf, &shape, &object.pose());
        }
        let scans = scans();
        for ray in &scans[1].rays {
            let [x, y, z] = [ray.origin.x, ray.origin.y, ray.origin.z];
            // a site looks along its z
            write!(mjcf, "<site pos=\"{x:.17} {y:.17} {z:.17}\" xyaxes=\"1 0 0 0 -1 0\" name=\"s{x}_{y}\"/>")
                .expect("a text grows");
        }
        mjcf.push_str("</worldbody><sensor>");
        for ray in &scans[1].rays {
            write!(mjcf, "<rangefinder site=\"s{}_{}\"/>", ray.origin.x, ray.origin.y).expect("a text grows");
        }
        mjcf.push_str("</sensor></mujoco>");
        Self { scene, scans, mjcf }
    }
}

/// A table of 1.2 x 1.6 m in front of the arm, with objects on a spiral.
fn world() -> World {
    let object = |name: String, shape, position, turn| Object {
        name,
        shape,
        mass: None,
        position,
        rpy: [0.0, 0.0, turn],
        ..Object::default()
    };
    let table =
        object("table".to_owned(), ObjectShape::Box { size: [1.2, 1.6, 0.04] }, [0.8, 0.0, 0.18], 0.0);
    let things = (0..OBJECTS).map(|index| {
        let (radius, angle) = (0.08 + 0.022 * index as f64, 2.4 * index as f64);
        let (x, y) = (0.75 + radius * angle.cos(), radius * angle.sin());
        let (shape, half) = match index % 3 {
            0 => (ObjectShape::Box { size: [0.06, 0.08, 0.1] }, 0.05),
            1 => (ObjectShape::Sphere { radius: 0.04 }, 0.04),
            _ => (ObjectShape::Cylinder { radius: 0.035, length: 0.12 }, 0.06),
        };
        object(format!("object {index}"), shape, [x, y, 0.2 + half], angle)
    });
    let objects = std::iter::once(table).chain(things).collect();
    World { ground: Some(Ground::default()), objects, ..World::default() }
}

/// A lidar on the edge of the table, a height scan over it, and a camera looking down from the far side.
fn scans() -> [Scan; 3] {
    let lidar = Point3::new(0.35, 0.05, 0.26);
    let turn = (0..360_u32).map(|index| f64::from(index).to_radians());
    let around = |angle: f64| Unit::new_normalize(Vector3::new(angle.cos(), angle.sin(), 0.0));
    let grid = (0..187_u32).map(|index| {
        let (x, y) = (f64::from(index / 11) * 0.07 + 0.23, f64::from(index % 11) * 0.12 - 0.6);
        Ray { origin: Point3::new(x, y, 1.5), direction: -Vector3::z_axis() }
    });
    let eye = Point3::new(1.9, 0.3, 1.1);
    let towards = Vector3::new(0.7, 0.0, 0.25) - eye.coords;
    let pose = Isometry3::face_towards(&eye, &(eye + towards), &Vector3::z());
    let focal = 80.0 / (30.0_f64).to_radians().tan();
    let pixels = (0..160 * 120_u32).map(|index| {
        let (right, down) = (f64::from(index % 160) - 79.5, f64::from(index / 160) - 59.5);
        let direction = pose.rotation * Vector3::new(-right, -down, focal);
        Ray { origin: eye, direction: Unit::new_normalize(direction) }
    });
    [
        Scan {
            name: "lidar, 360 rays",
            word: "lidar",
            rays: turn.map(|angle| Ray { origin: lidar, direction: around(angle) }).collect(),
            repeats: 50,
        },
        Scan { name: "height scan, 187 points", word: "heights", rays: grid.collect(), repeats: 50 },
        Scan { name: "depth picture, 160 x 120", word: "camera", rays: pixels.collect(), repeats: 2 },
    ]
}

/// A body with one geom.
fn describe(mjcf: &mut String, shape: &ConvexShape, pose: &Isometry3<f64>) {
    let (kind, size) = match shape {
        ConvexShape::Sphere { radius } => ("sphere", format!("{radius}")),
        ConvexShape::Box { half } => ("box", format!("{} {} {}", half.x, half.y, half.z)),
        ConvexShape::Cylinder { radius, half_length } => ("cylinder", format!("{radius} {half_length}")),
        ConvexShape::Capsule { radius, half_length } => ("capsule", format!("{radius} {half_length}")),
        ConvexShape::Hull { .. } | ConvexShape::HalfSpace => panic!("no shape of this scene"),
    };
    let (p, q) = (pose.translation.vector, pose.rotation.coords);
    write!(
        mjcf,
        "<body pos=\"{:.17} {:.17} {:.17}\" quat=\"{:.17} {:.17} {:.17} {:.17}\"><freejoint/>\
         <geom type=\"{kind}\" size=\"{size}\" mass=\"1\"/></body>",
        p.x, p.y, p.z, q.w, q.x, q.y, q.z
    )
    .expect("a text grows");
}
