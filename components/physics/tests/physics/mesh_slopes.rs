//! Cylinders on slopes of triangles and terrains, inside-out meshes, and distant meshes.

use motorium_physics::{Ground, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::TriangleMesh;
use motorium_worlds::{MeshCollision, Terrain};
use nalgebra::Vector3;

use crate::engines::Engine;
use crate::legged::body;
use crate::meshes::{ball, box_between, floor, mesh, pose, run, simulate, trough, with_triangles};

const G: f64 = 9.81;
const RADIUS: f64 = 0.05;
const SLOPE: f64 = 0.2;

/// A cylinder across the slope.
fn roller(x: f64, height: f64) -> Object {
    Object {
        name: "roller".to_owned(),
        shape: ObjectShape::Cylinder { radius: RADIUS, length: 0.1 },
        mass: Some(1.0),
        position: [x, 0.03, height + RADIUS / SLOPE.cos()],
        rpy: [core::f64::consts::FRAC_PI_2, 0.0, 0.0],
        friction: 0.9,
        ..Object::default()
    }
}

/// Distance rolled down a slope in a second from rest, and the largest deviation of its height above the
/// plane from its radius.
fn roll(simulation: &mut dyn Simulator) -> (f64, f64) {
    let start = pose(simulation, "roller").translation.vector;
    let normal = Vector3::new(SLOPE.sin(), 0.0, SLOPE.cos());
    let mut off = 0.0_f64;
    for _ in 0..100 {
        run(simulation, 0.01);
        off = off.max(normal.dot(&(pose(simulation, "roller").translation.vector - start)).abs());
    }
    ((pose(simulation, "roller").translation.vector - start).norm(), off)
}

#[test]
fn a_cylinder_rolls_down_a_slope_of_triangles() {
    // a = 2/3 g sin(slope); the mesh is sloped, its object is not.
    let height = |x: f64| -SLOPE.tan() * x;
    let sloping = mesh("slope", floor(|x, _| height(x)), MeshCollision::Triangles);
    let objects = vec![Object { friction: 0.9, ..sloping }, roller(-1.0, height(-1.0))];
    let mut simulation = simulate(Engine::Articulated, World { objects, ..World::default() });
    let (way, off) = roll(&mut *simulation);
    let expected = 0.5 * 2.0 / 3.0 * G * SLOPE.sin();
    assert!((way - expected).abs() < 0.01 * expected, "{way} m, expected {expected} m");
    assert!(off < 1e-4, "it leaves the slope by {off} m");
}

#[test]
fn a_cylinder_rolls_down_a_sloping_terrain() {
    let text = format!(
        "size = [6.0, 4.0]\nspacing = 0.1\nfriction = 0.9\nlayers = [{{ equation = {{ height = \"-{} * x\" }} }}]",
        SLOPE.tan()
    );
    let terrain: Terrain = toml::from_str(&text).unwrap();
    let objects = vec![roller(-1.0, SLOPE.tan())];
    let world = World { terrain: Some(terrain), objects, ..World::default() };
    let mut simulation = simulate(Engine::Articulated, world);
    let (way, off) = roll(&mut *simulation);
    let expected = 0.5 * 2.0 / 3.0 * G * SLOPE.sin();
    assert!((way - expected).abs() < 0.01 * expected, "{way} m, expected {expected} m");
    assert!(off < 1e-4, "it leaves the slope by {off} m");
}

#[test]
fn an_upright_cylinder_touches_a_wall_with_a_line() {
    for yaw in [0.0, 0.3, core::f64::consts::FRAC_PI_4] {
        let wall = mesh("wall", box_between([0.3, -1.0, -0.1], [0.5, 1.0, 0.4]), MeshCollision::Triangles);
        let flat = mesh("floor", floor(|_, _| 0.0), MeshCollision::Triangles);
        let can = Object {
            position: [0.2, 0.03, 0.06],
            rpy: [0.0, 0.0, yaw],
            friction: 0.0,
            shape: ObjectShape::Cylinder { radius: RADIUS, length: 0.12 },
            ..roller(0.0, 0.0)
        };
        let objects = [wall, flat].map(|object| Object { friction: 0.0, ..object });
        let objects = objects.into_iter().chain([can]).collect();
        let world = World { objects, gravity: [2.0, 0.0, -G], ..World::default() };
        let mut simulation = simulate(Engine::Articulated, world);
        run(&mut *simulation, 1.0);
        let at = pose(&*simulation, "roller").translation.vector;
        assert!((at.x - (0.3 - RADIUS)).abs() < 1e-3, "turned by {yaw}: at {at}");
        assert!((at.z - 0.06).abs() < 1e-3, "turned by {yaw}: at {at}");
    }
}

/// The same mesh with all triangles flipped.
fn inside_out(mesh: TriangleMesh) -> TriangleMesh {
    TriangleMesh { triangles: mesh.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect(), ..mesh }
}

#[test]
fn inside_out_mesh_carries_falling_objects() {
    for engine in with_triangles() {
        let table = || box_between([-0.3, -0.3, 0.0], [0.3, 0.3, 0.05]);
        for mesh_of in [trough(), table()] {
            for turned in [false, true] {
                let solid = if turned { inside_out(mesh_of.clone()) } else { mesh_of.clone() };
                let objects = vec![mesh("solid", solid, MeshCollision::Triangles), ball([0.03, 0.02, 0.25])];
                let mut simulation = simulate(engine, World { objects, ..World::default() });
                run(&mut *simulation, 0.8);
                let height = pose(&*simulation, "ball").translation.z;
                assert!((height - 0.1).abs() < 1e-3, "{engine:?}, turned {turned}: {height} m");
            }
        }
    }
}

#[test]
fn inconsistent_triangles_are_rejected_by_object_name() {
    let mut twisted = box_between([0.0; 3], [1.0; 3]);
    twisted.triangles[4].swap(1, 2);
    let of =
        |collision| World { objects: vec![mesh("crate", twisted.clone(), collision)], ..World::default() };
    let refused = Engine::Articulated.refuse(of(MeshCollision::Triangles));
    assert!(refused.contains("crate") && refused.contains("opposite sides"), "{refused}");
    of(MeshCollision::Hull).check(std::iter::empty()).unwrap();
}

/// A floor whose height along x follows the points (x, z), from y = -1 to 1.
fn profile(points: &[[f64; 2]]) -> TriangleMesh {
    let corner = |[x, z]: &[f64; 2]| [Vector3::new(*x, -1.0, *z), Vector3::new(*x, 1.0, *z)];
    let points: Vec<Vector3<f64>> = points.iter().flat_map(corner).collect();
    let strips = 0..points.len() as u32 / 2 - 1;
    let triangles = strips.flat_map(|strip| {
        let [a, d, b, c] = [0, 1, 2, 3].map(|corner| 2 * strip + corner);
        [[a, b, c], [a, c, d]]
    });
    TriangleMesh { triangles: triangles.collect(), points }
}

#[test]
fn a_box_behind_a_low_curb_stands_on_the_lower_ground_there() {
    let points = [[-1.0, 0.0], [0.0, 0.0], [0.0, 0.005], [0.01, 0.005], [0.01, -0.02], [1.0, -0.02]];
    let street = mesh("street", profile(&points), MeshCollision::Triangles);
    let block = Object {
        name: "block".to_owned(),
        shape: ObjectShape::Box { size: [0.1; 3] },
        mass: Some(1.0),
        position: [0.065, 0.02, 0.0305],
        ..Object::default()
    };
    let mut simulation =
        simulate(Engine::Articulated, World { objects: vec![street, block], ..World::default() });
    run(&mut *simulation, 0.5);
    let at = pose(&*simulation, "block").translation.vector;
    assert!((at - Vector3::new(0.065, 0.02, 0.03)).norm() < 1e-3, "{at}");
}

#[test]
fn a_distant_mesh_changes_no_bit_of_a_falling_hull() {
    let file = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("hull_of_a_link.obj");
    std::fs::write(&file, box_between([-0.05; 3], [0.05, 0.04, 0.06]).to_obj()).unwrap();
    let link = format!("<mesh filename=\"{}\"/>", file.display());
    let fall = |far: bool| {
        let one = mesh("one", box_between([-0.05; 3], [0.05; 3]), MeshCollision::Hull);
        let one = Object { mass: Some(1.0), position: [0.0, 0.0, 0.06], rpy: [0.1, 0.2, 0.3], ..one };
        let two = Object {
            name: "two".to_owned(),
            shape: ObjectShape::Box { size: [0.1; 3] },
            position: [0.01, 0.0, 0.2],
            ..one.clone()
        };
        let far = far.then(|| Object {
            position: [500.0, 0.0, 0.0],
            ..mesh("hall", floor(|_, _| 0.0), MeshCollision::Triangles)
        });
        let objects: Vec<Object> = [one, two].into_iter().chain(far).collect();
        let world = World { ground: Some(Ground::default()), objects, ..World::default() };
        let start = [0.02, 0.0, 0.4, 0.0, 0.0, 0.0, 1.0];
        let mut simulation = Engine::Articulated.simulate(body(&link), world, &start, Options::default());
        let mut touches = 0;
        for _ in 0..800 {
            simulation.step(1e-3).unwrap();
            simulation.visit_contacts(&mut |contact| {
                touches += usize::from([contact.first, contact.second].contains(&"body"));
            });
        }
        let numbers: Vec<u64> = simulation.configuration().iter().map(|x| x.to_bits()).collect();
        (numbers, touches, ["one", "two"].map(|name| pose(&*simulation, name)))
    };
    let alone = fall(false);
    assert!(alone.1 > 100, "the link touches: {}", alone.1);
    assert_eq!(alone, fall(true));
}
