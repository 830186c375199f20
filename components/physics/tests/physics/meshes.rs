//! Objects with mesh shapes: compared with boxes and planes of the same shape on every engine, and nonconvex
//! meshes.

use motorium_physics::{Ground, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::{Model, TriangleMesh, load};
use motorium_worlds::{MeshCollision, MeshShape};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use crate::engines::{Engine, engines, has_mujoco};

const DT: f64 = 1e-3;
const G: f64 = 9.81;

/// Faces of a box between two corners, as outward-facing triangles.
pub(crate) fn box_between(low: [f64; 3], high: [f64; 3]) -> TriangleMesh {
    let pick = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
    let points = (0..8).map(|corner| Vector3::from_fn(|axis, _| pick(corner, axis))).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|[a, b, c, d]: &[u32; 4]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    TriangleMesh { points, triangles }
}

/// A prism along z with `sides` sides at distance `radius` from its axis, and with length `length` \[m\].
pub(crate) fn prism(sides: usize, radius: f64, length: f64) -> TriangleMesh {
    let turn = std::f64::consts::TAU / sides as f64;
    let corner = |index: usize, z: f64| {
        let (sin, cos) = ((index as f64 + 0.5) * turn).sin_cos();
        let reach = radius / (0.5 * turn).cos();
        Vector3::new(reach * cos, reach * sin, z)
    };
    let half = 0.5 * length;
    let mut points: Vec<_> = (0..sides).map(|index| corner(index, -half)).collect();
    points.extend((0..sides).map(|index| corner(index, half)));
    let (count, mut triangles) = (sides as u32, Vec::new());
    for index in 0..count {
        let next = (index + 1) % count;
        triangles.push([index, next, count + next]);
        triangles.push([index, count + next, count + index]);
        if index > 0 && next > 0 {
            triangles.push([0, next, index]);
            triangles.push([count, count + index, count + next]);
        }
    }
    TriangleMesh { points, triangles }
}

/// Several meshes merged into one.
pub(crate) fn joined(parts: &[TriangleMesh]) -> TriangleMesh {
    let mut whole = TriangleMesh::default();
    for part in parts {
        let first = whole.points.len() as u32;
        whole.points.extend(&part.points);
        whole.triangles.extend(part.triangles.iter().map(|triangle| triangle.map(|index| index + first)));
    }
    whole
}

/// A floor of squares with irregular sizes, each cut into two triangles; level at a height of 0.
pub(crate) fn floor(height: impl Fn(f64, f64) -> f64) -> TriangleMesh {
    let (count, side) = (41_u32, 0.137);
    let at = |index: u32| (f64::from(index) - 20.3) * side;
    let corners = (0..count).flat_map(|row| (0..count).map(move |column| (column, row)));
    let points = corners.map(|(column, row)| {
        let (x, y) = (at(column), at(row));
        Vector3::new(x, y, height(x, y))
    });
    let squares = (0..count - 1).flat_map(|row| (0..count - 1).map(move |column| row * count + column));
    let triangles = squares.flat_map(|a| {
        let [b, c, d] = [a + 1, a + count, a + count + 1];
        if a % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] }
    });
    TriangleMesh { points: points.collect(), triangles: triangles.collect() }
}

pub(crate) fn mesh(name: &str, mesh: TriangleMesh, collision: MeshCollision) -> Object {
    let shape = ObjectShape::Mesh(MeshShape::of_mesh(name, mesh, collision));
    Object { name: name.to_owned(), shape, friction: 0.6, ..Object::default() }
}

fn block(name: &str, position: [f64; 3]) -> Object {
    let shape = ObjectShape::Box { size: [0.2, 0.16, 0.1] };
    Object { name: name.to_owned(), shape, mass: Some(2.0), position, friction: 0.4, ..Object::default() }
}

/// A robot far above all objects.
pub(crate) fn pendulum() -> Model {
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    pendulum.placed(&Isometry3::translation(0.0, 0.0, 50.0))
}

pub(crate) fn simulate(engine: Engine, world: World) -> Box<dyn Simulator> {
    engine.simulate(pendulum(), world, &[0.0], Options::default())
}

pub(crate) fn pose(simulation: &dyn Simulator, name: &str) -> Isometry3<f64> {
    simulation.object_pose(simulation.object(name).unwrap())
}

pub(crate) fn run(simulation: &mut dyn Simulator, seconds: f64) {
    (0..(seconds / DT).round() as usize).for_each(|_| _ = simulation.step(DT).unwrap());
}

/// Distance that a block slides under tilted gravity within a time, and its largest change of height.
fn slide(simulation: &mut dyn Simulator, name: &str, seconds: f64) -> (f64, f64) {
    run(simulation, 0.2);
    let start = pose(simulation, name).translation.vector;
    let mut off = 0.0_f64;
    for _ in 0..(seconds / DT) as usize {
        simulation.step(DT).unwrap();
        off = off.max((pose(simulation, name).translation.z - start.z).abs());
    }
    let way = pose(simulation, name).translation.vector - start;
    (way.xy().norm(), off)
}

/// Engines that support triangle contacts of meshes.
pub(crate) fn with_triangles() -> impl Iterator<Item = Engine> {
    engines().filter(|engine| *engine != Engine::Mujoco)
}

/// Gravity on a slope that is not parallel to any side of a triangle.
fn tilted() -> [f64; 3] {
    let (slope, heading) = (0.75_f64, 0.3_f64);
    let along = G * slope.sin();
    [along * heading.cos(), along * heading.sin(), -G * slope.cos()]
}

#[test]
fn block_slides_over_triangles_like_over_a_plane() {
    for engine in with_triangles() {
        let world =
            |objects: Vec<Object>, ground| World { gravity: tilted(), objects, ground, ..World::default() };
        let plane = Ground { friction: 0.6, ..Ground::default() };
        let mut reference = simulate(engine, world(vec![block("block", [-2.0, -1.0, 0.05])], Some(plane)));
        let flat = mesh("floor", floor(|_, _| 0.0), MeshCollision::Triangles);
        let mut tried = simulate(engine, world(vec![flat, block("block", [-2.0, -1.0, 0.05])], None));
        let (expected, _) = slide(&mut *reference, "block", 1.2);
        let (way, off) = slide(&mut *tried, "block", 1.2);
        assert!(expected > 1.0, "{engine:?}: {expected} m");
        assert!((way - expected).abs() < 0.02 * expected, "{engine:?}: {way} m, {expected} m over a plane");
        let bump = if engine == Engine::Articulated { 1e-6 } else { 1e-3 };
        assert!(off < bump, "{engine:?}: it leaves its height by {off} m");
        let turned = pose(&*tried, "block").rotation.angle();
        assert!(turned < 1e-2, "{engine:?}: it turns by {turned} rad");
    }
}

#[test]
fn mesh_block_slides_and_rests_like_a_box() {
    // The origin of the mesh is at one of its corners, not at its centre.
    let cube = || {
        let cube = mesh("block", box_between([0.0; 3], [0.2, 0.16, 0.1]), MeshCollision::Hull);
        Object { density: Some(625.0), position: [-0.1, -0.08, 0.0], friction: 0.4, ..cube }
    };
    for engine in engines() {
        let ground = Some(Ground { friction: 0.6, ..Ground::default() });
        let on = |object, gravity| {
            simulate(engine, World { gravity, objects: vec![object], ground, ..World::default() })
        };
        let mut reference = on(block("block", [0.0, 0.0, 0.05]), tilted());
        let mut tried = on(cube(), tilted());
        let (expected, _) = slide(&mut *reference, "block", 1.0);
        let (way, _) = slide(&mut *tried, "block", 1.0);
        assert!((way - expected).abs() < 0.02 * expected, "{engine:?}: {way} m, a box {expected} m");
        let down = [0.0, 0.0, -G];
        let (mut reference, mut tried) = (on(block("block", [0.0, 0.0, 0.05]), down), on(cube(), down));
        run(&mut *reference, 0.5);
        run(&mut *tried, 0.5);
        let height = pose(&*tried, "block").translation.z;
        let box_height = pose(&*reference, "block").translation.z - 0.05;
        assert!((height - box_height).abs() < 1e-4, "{engine:?}: {height} m, a box {box_height} m");
        let mut weight = 0.0;
        tried.visit_contacts(&mut |contact| weight += contact.force);
        assert!((weight - 2.0 * G).abs() < 0.02 * G, "{engine:?}: {weight} N of {} N", 2.0 * G);
    }
}

#[test]
fn a_mesh_turns_about_its_centre_of_mass_in_flight() {
    for engine in engines() {
        let rod = mesh("beam", box_between([0.0, -0.02, -0.02], [0.6, 0.02, 0.02]), MeshCollision::Hull);
        let rod = Object { mass: Some(1.0), position: [0.0, 0.0, 5.0], ..rod };
        let mut simulation = simulate(engine, World { objects: vec![rod], ..World::default() });
        run(&mut *simulation, 0.5);
        let centre = pose(&*simulation, "beam") * Point3::new(0.3, 0.0, 0.0);
        assert!((centre.x - 0.3).abs() < 1e-9, "{engine:?}: {centre}");
        let fallen = 0.5 * G * 0.25;
        assert!((5.0 - centre.z - fallen).abs() < 0.01 * fallen, "{engine:?}: {centre}");
        // A wall under its far end rotates it about the edge.
        let wall = Object {
            name: "wall".to_owned(),
            shape: ObjectShape::Box { size: [0.1; 3] },
            position: [0.55, 0.0, 4.93],
            ..Object::default()
        };
        let rod = mesh("beam", box_between([0.0, -0.02, -0.02], [0.6, 0.02, 0.02]), MeshCollision::Hull);
        let rod = Object { mass: Some(1.0), position: [0.0, 0.0, 5.0], ..rod };
        let mut simulation = simulate(engine, World { objects: vec![wall, rod], ..World::default() });
        run(&mut *simulation, 0.1);
        // The lever about the edge of the wall: (g / 2) c / (c^2 + l^2/12) t^2 with the centre c = 0.2 m from
        // the edge.
        let (lever, squared) = (0.2_f64, (0.6_f64.powi(2) + 0.04_f64.powi(2)) / 12.0);
        let expected = 0.5 * G * lever / (lever * lever + squared) * 0.01;
        let angle = pose(&*simulation, "beam").rotation.angle();
        assert!(
            (angle - expected).abs() < 0.15 * expected,
            "{engine:?}: {angle} rad, expected {expected} rad"
        );
    }
}

/// A trough with two walls, open along y.
pub(crate) fn trough() -> TriangleMesh {
    joined(&[
        box_between([-0.3, -0.3, 0.0], [0.3, 0.3, 0.05]),
        box_between([-0.3, -0.3, 0.05], [-0.2, 0.3, 0.3]),
        box_between([0.2, -0.3, 0.05], [0.3, 0.3, 0.3]),
    ])
}

pub(crate) fn ball(position: [f64; 3]) -> Object {
    let shape = ObjectShape::Sphere { radius: 0.05 };
    Object {
        name: "ball".to_owned(),
        shape,
        mass: Some(0.2),
        position,
        rolling_friction: 0.0,
        ..Object::default()
    }
}

#[test]
fn a_ball_falls_into_a_trough_of_convex_parts() {
    for engine in engines() {
        for (collision, expected) in [(MeshCollision::Parts(8), 0.1), (MeshCollision::Hull, 0.35)] {
            let trough = Object { mass: Some(5.0), ..mesh("trough", trough(), collision) };
            let objects = vec![trough, ball([0.03, 0.02, 0.45])];
            let ground = Some(Ground::default());
            let mut simulation = simulate(engine, World { objects, ground, ..World::default() });
            run(&mut *simulation, 1.0);
            let height = pose(&*simulation, "ball").translation.z;
            // Parts are up to one voxel larger than the mesh: 0.6 m / 64.
            assert!((height - expected).abs() < 0.015, "{engine:?}, {collision:?}: {height} m");
        }
    }
}

#[test]
fn a_ball_falls_into_a_fixed_trough_of_triangles() {
    for engine in with_triangles() {
        let objects = vec![mesh("trough", trough(), MeshCollision::Triangles), ball([0.03, 0.02, 0.45])];
        let mut simulation = simulate(engine, World { objects, ..World::default() });
        run(&mut *simulation, 1.0);
        let height = pose(&*simulation, "ball").translation.z;
        assert!((height - 0.1).abs() < 1e-3, "{engine:?}: {height} m");
    }
}

#[test]
fn every_shape_rests_on_triangles_like_on_a_plane() {
    let shapes = [
        (ObjectShape::Box { size: [0.1, 0.12, 0.08] }, 0.04),
        (ObjectShape::Sphere { radius: 0.05 }, 0.05),
        (ObjectShape::Cylinder { radius: 0.05, length: 0.1 }, 0.05),
        (ObjectShape::Capsule { radius: 0.03, length: 0.1 }, 0.08),
        (
            ObjectShape::Mesh(MeshShape::of_mesh(
                "cube",
                box_between([-0.05; 3], [0.05; 3]),
                MeshCollision::Hull,
            )),
            0.05,
        ),
    ];
    for engine in with_triangles() {
        for (shape, height) in &shapes {
            let object = Object {
                name: "it".to_owned(),
                shape: shape.clone(),
                mass: Some(1.0),
                position: [0.21, -0.33, height + 0.01],
                ..Object::default()
            };
            let flat = mesh("floor", floor(|_, _| 0.0), MeshCollision::Triangles);
            let mut simulation = simulate(engine, World { objects: vec![flat, object], ..World::default() });
            run(&mut *simulation, if matches!(shape, ObjectShape::Capsule { .. }) { 0.1 } else { 0.8 });
            let at = pose(&*simulation, "it").translation.z;
            assert!((at - height).abs() < 1e-3, "{engine:?}, {shape:?}: {at} m of {height} m");
        }
    }
}

#[test]
fn a_box_lies_on_a_ridge_and_a_capsule_across_an_edge() {
    let engine = Engine::Articulated;
    let roof = mesh("roof", floor(|x, _| -0.5 * x.abs()), MeshCollision::Triangles);
    // The ridge of the triangles is at the corners nearest to x = 0.
    let ridge = -0.5 * (0.3 * 0.137_f64).min(0.7 * 0.137);
    let bar = Object {
        name: "bar".to_owned(),
        shape: ObjectShape::Box { size: [0.4, 0.1, 0.1] },
        mass: Some(1.0),
        position: [-0.3 * 0.137, 0.03, 0.07],
        ..Object::default()
    };
    let mut simulation = simulate(engine, World { objects: vec![roof, bar], ..World::default() });
    run(&mut *simulation, 0.3);
    let height = pose(&*simulation, "bar").translation.z;
    assert!((height - (ridge + 0.05)).abs() < 2e-3, "{height} m, the ridge at {ridge} m");

    let table = mesh("table", box_between([-1.0, -1.0, -0.1], [0.0, 1.0, 0.0]), MeshCollision::Triangles);
    let capsule = Object {
        name: "capsule".to_owned(),
        shape: ObjectShape::Capsule { radius: 0.03, length: 0.4 },
        mass: Some(1.0),
        // Along x, with its centre slightly over the table.
        position: [-0.05, 0.1, 0.031],
        rpy: [0.0, core::f64::consts::FRAC_PI_2, 0.0],
        ..Object::default()
    };
    let mut simulation = simulate(engine, World { objects: vec![table, capsule], ..World::default() });
    run(&mut *simulation, 1.0);
    let at = pose(&*simulation, "capsule").translation.vector;
    assert!((at.z - 0.03).abs() < 1e-3 && at.x.abs() < 0.06, "{at}");
}

#[test]
fn ball_rolls_on_sloped_triangles_like_on_a_plane() {
    // a = 5/7 g sin(slope), on a floor without edges.
    let slope = 0.2_f64;
    let tilted = |object: Object| Object { rpy: [0.0, slope, 0.0], ..object };
    let start = UnitQuaternion::from_euler_angles(0.0, slope, 0.0) * Vector3::new(-1.0, 0.1, 0.05);
    let ball = Object { friction: 0.9, ..ball(start.into()) };
    let flat = tilted(mesh("floor", floor(|_, _| 0.0), MeshCollision::Triangles));
    let mut simulation =
        simulate(Engine::Articulated, World { objects: vec![flat, ball], ..World::default() });
    run(&mut *simulation, 1.0);
    let way = (pose(&*simulation, "ball").translation.vector - start).norm();
    let expected = 0.5 * 5.0 / 7.0 * G * slope.sin();
    assert!((way - expected).abs() < 0.01 * expected, "{way} m, expected {expected} m");
}

#[test]
fn rays_enter_hollow_meshes_with_triangle_contacts() {
    for engine in with_triangles() {
        let objects = vec![mesh("trough", trough(), MeshCollision::Triangles)];
        let simulation = simulate(engine, World { objects, ..World::default() });
        let hit = simulation.cast_ray(Point3::new(0.1, 0.1, 1.0), -Vector3::z(), 5.0).unwrap();
        assert!(hit.name == "trough" && (hit.distance - 0.95).abs() < 1e-12, "{engine:?}: {hit:?}");
    }
}

#[test]
fn meshes_do_not_allocate_and_restore_exactly() {
    let objects = || {
        let cube = mesh("cube", box_between([0.0; 3], [0.1, 0.12, 0.08]), MeshCollision::Hull);
        let cube = Object { mass: Some(0.5), position: [0.1, 0.1, 0.3], rpy: [0.4, 0.3, 0.2], ..cube };
        let trough_2 = Object {
            mass: Some(2.0),
            position: [1.0, 0.0, 0.05],
            ..mesh("parts", trough(), MeshCollision::Parts(6))
        };
        let bumpy =
            mesh("floor", floor(|x, y| 0.03 * (5.0 * x).sin() * (4.0 * y).cos()), MeshCollision::Triangles);
        vec![bumpy, cube, trough_2, ball([0.0, -0.2, 0.3]), block("block", [-0.5, 0.4, 0.3])]
    };
    let mut simulation = simulate(Engine::Articulated, World { objects: objects(), ..World::default() });
    run(&mut *simulation, 0.4);
    let saved = simulation.save();
    let state = |simulation: &dyn Simulator| {
        let names = ["cube", "parts", "ball", "block"];
        let poses = names.map(|name| pose(simulation, name).to_homogeneous());
        poses.iter().flat_map(|pose| pose.iter().map(|x| x.to_bits()).collect::<Vec<_>>()).collect::<Vec<_>>()
    };
    let before = motorium::telemetry::allocations().own;
    (0..400).for_each(|_| _ = simulation.step(DT).unwrap());
    assert_eq!(motorium::telemetry::allocations().own - before, 0);
    let first = state(&*simulation);
    simulation.restore(&saved).unwrap();
    run(&mut *simulation, 0.4);
    assert_eq!(state(&*simulation), first);
}

#[test]
fn unsupported_mesh_settings_are_rejected_by_name() {
    let flat = || mesh("hall", floor(|_, _| 0.0), MeshCollision::Triangles);
    if has_mujoco() {
        let refused = Engine::Mujoco.refuse(World { objects: vec![flat()], ..World::default() });
        assert!(
            refused.contains("MuJoCo") && refused.contains("triangle collision") && refused.contains("hall"),
            "{refused}"
        );
    }
    let moving = Object { mass: Some(1.0), ..flat() };
    let refused = Engine::Articulated.refuse(World { objects: vec![moving], ..World::default() });
    assert!(refused.contains("hall") && refused.contains("parts = 16"), "{refused}");
    let both = Object { mass: Some(1.0), density: Some(1.0), ..block("both", [0.0; 3]) };
    let refused = Engine::Articulated.refuse(World { objects: vec![both], ..World::default() });
    assert!(refused.contains("`mass` and `density`"), "{refused}");
    let flat_hull = mesh("sheet", floor(|_, _| 0.0), MeshCollision::Hull);
    let refused = Engine::Articulated.refuse(World { objects: vec![flat_hull], ..World::default() });
    assert!(refused.contains("sheet") && refused.contains("flat"), "{refused}");
    let text = "objects = [{ name = \"rock\", position = [0, 0, 0], shape = { mesh = { file = \"nowhere/rock.obj\" } } }]";
    let refused = Engine::Articulated.refuse(toml::from_str(text).unwrap());
    assert!(refused.contains("rock") && refused.contains("nowhere/rock.obj"), "{refused}");
}
