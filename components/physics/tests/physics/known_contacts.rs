//! Contact points of bodies on narrow faces, compared with their geometric positions.

use motorium_physics::{ArticulatedSimulator, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::TriangleMesh;
use motorium_worlds::MeshCollision;
use nalgebra::Vector3;

use crate::meshes::{box_between, mesh, pendulum};

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// Largest distance of a point from its geometric position \[m\].
const TOLERANCE: f64 = 2e-4;

fn object(name: &str, shape: ObjectShape, position: [f64; 3], rpy: [f64; 3]) -> Object {
    Object { name: name.to_owned(), shape, position, rpy, ..Object::default() }
}

/// Contact points of an upper body on a lower one, along x and y \[m\]. All are at `height` \[m\].
fn points(upper: Object, lower: Object, height: f64) -> Vec<[f64; 2]> {
    let upper = Object { mass: Some(0.2), ..upper };
    let world = World { objects: vec![lower, upper], ..World::default() };
    let mut simulation = ArticulatedSimulator::new(pendulum(), world, &[0.0], Options::default()).unwrap();
    simulation.step(1e-3).unwrap();
    let mut points = Vec::new();
    let mut weight = Vector3::zeros();
    simulation.visit_contacts(&mut |contact| {
        assert!((contact.normal.z.abs() - 1.0).abs() < 1e-6, "{contact:?}");
        assert!((contact.point.z - height).abs() < TOLERANCE, "{contact:?}");
        weight += contact.normal * contact.force;
        points.push([contact.point.x, contact.point.y]);
    });
    assert!((weight.z.abs() - 0.2 * 9.81).abs() < 1e-3, "{weight}");
    points
}

/// Every expected position has a point, and every point is within their hull along both axes.
fn check(what: &str, found: &[[f64; 2]], expected: &[[f64; 2]]) {
    let near = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < TOLERANCE;
    let whole = expected.iter().all(|place| found.iter().any(|point| near(place, point)));
    let within = (0..2).all(|axis| {
        let most = expected.iter().map(|place| place[axis].abs()).fold(0.0, f64::max);
        found.iter().all(|point| point[axis].abs() < most + TOLERANCE)
    });
    assert!(whole && within, "{what}: {found:?}, expected {expected:?}");
}

/// Round bars of radius 0.02 m along x, rotated by `yaw` \[rad\], whose lowest line is at z = 0.
fn round_bars(yaw: f64) -> [(&'static str, Object); 2] {
    let (position, rpy) = ([0.0, 0.0, 0.02], [0.0, QUARTER, yaw]);
    [
        ("cylinder", object("bar", ObjectShape::Cylinder { radius: 0.02, length: 0.3 }, position, rpy)),
        ("capsule", object("bar", ObjectShape::Capsule { radius: 0.02, length: 0.26 }, position, rpy)),
    ]
}

/// Rails along y, 0.02 m wide, 0.4 m long and level at z = 0, with every kind of flat face.
fn rails() -> [(&'static str, Object); 3] {
    let (size, below) = ([0.02, 0.4, 0.02], [0.0, 0.0, -0.01]);
    let bar = || box_between([-0.01, -0.2, -0.01], [0.01, 0.2, 0.01]);
    [
        ("box", object("rail", ObjectShape::Box { size }, below, [0.0; 3])),
        ("hull", Object { position: below, ..mesh("rail", bar(), MeshCollision::Hull) }),
        ("triangles", Object { position: below, ..mesh("rail", bar(), MeshCollision::Triangles) }),
    ]
}

#[test]
fn round_bars_touch_narrow_rails_from_side_to_side() {
    for yaw in [0.0, 0.3_f64, -0.6] {
        let across = 0.01 * yaw.tan();
        for (bar, upper) in round_bars(yaw) {
            for (rail, lower) in rails() {
                let found = points(upper.clone(), lower, 0.0);
                check(&format!("{bar} on {rail} at {yaw}"), &found, &[[0.01, across], [-0.01, -across]]);
            }
        }
    }
}

#[test]
fn flat_bars_touch_narrow_rails_at_the_corners_of_the_patch() {
    let (position, yaw) = ([0.0, 0.0, 0.02], 0.3_f64);
    let bar = || box_between([-0.15, -0.02, -0.02], [0.15, 0.02, 0.02]);
    let uppers = [
        ("box", object("bar", ObjectShape::Box { size: [0.3, 0.04, 0.04] }, position, [0.0, 0.0, yaw])),
        ("hull", Object { position, rpy: [0.0, 0.0, yaw], ..mesh("bar", bar(), MeshCollision::Hull) }),
    ];
    // The sides of the bar cross the sides of the rail.
    let side = |x: f64, sign: f64| [x, x * yaw.tan() + sign * 0.02 / yaw.cos()];
    let corners = [side(0.01, 1.0), side(0.01, -1.0), side(-0.01, 1.0), side(-0.01, -1.0)];
    for (bar, upper) in uppers {
        for (rail, lower) in rails() {
            check(&format!("{bar} on {rail}"), &points(upper.clone(), lower, 0.0), &corners);
        }
    }
}

#[test]
fn crossed_bars_touch_at_a_point_and_parallel_bars_in_a_line() {
    let lying =
        |shape: &ObjectShape, yaw| object("rail", shape.clone(), [0.0, 0.0, -0.01], [0.0, QUARTER, yaw]);
    let lowers = [
        ObjectShape::Cylinder { radius: 0.01, length: 0.1 },
        ObjectShape::Capsule { radius: 0.01, length: 0.1 },
    ];
    for lower in &lowers {
        for (bar, upper) in round_bars(0.0) {
            for yaw in [0.2, 1.0, QUARTER] {
                let found = points(upper.clone(), lying(lower, yaw), 0.0);
                check(&format!("{bar} across {lower:?} at {yaw}"), &found, &[[0.0, 0.0]]);
            }
            let found = points(upper.clone(), lying(lower, 0.0), 0.0);
            check(&format!("{bar} along {lower:?}"), &found, &[[0.05, 0.0], [-0.05, 0.0]]);
        }
    }
}

#[test]
fn boxes_on_posts_touch_round_the_rims() {
    let plate = object("plate", ObjectShape::Box { size: [0.3, 0.3, 0.02] }, [0.0, 0.0, 0.01], [0.0; 3]);
    let post = ObjectShape::Cylinder { radius: 0.02, length: 0.1 };
    let found = points(plate, object("post", post, [0.0, 0.0, -0.05], [0.0; 3]), 0.0);
    // Points on the rim around the axis, with no gap as wide as a third of the rim.
    let mut angles: Vec<f64> = found
        .iter()
        .map(|[x, y]| {
            assert!((x.hypot(*y) - 0.02).abs() < TOLERANCE, "{found:?}");
            y.atan2(*x)
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    let gaps = angles.iter().zip(angles.iter().cycle().skip(1));
    let widest = gaps.map(|(a, b)| (b - a).rem_euclid(std::f64::consts::TAU)).fold(0.0, f64::max);
    assert!(angles.len() >= 4 && widest < 2.1, "{angles:?}");
}

#[test]
fn dense_hulls_rest_on_their_outermost_corners() {
    // An ellipsoid with about 1100 corners and half axes of 0.1, 0.07 and 0.05 m.
    let half = Vector3::new(0.1, 0.07, 0.05);
    let ellipsoid = ellipsoid(half, 24);
    for (name, lower) in [
        ("box", object("floor", ObjectShape::Box { size: [1.0, 1.0, 0.1] }, [0.0, 0.0, -0.05], [0.0; 3])),
        (
            "triangles",
            mesh("floor", box_between([-0.5, -0.5, -0.1], [0.5, 0.5, 0.0]), MeshCollision::Triangles),
        ),
    ] {
        let upper = Object {
            position: [0.0, 0.0, half.z],
            mass: Some(0.2),
            ..mesh("body", ellipsoid.clone(), MeshCollision::Hull)
        };
        let world = World { objects: vec![lower, upper], ..World::default() };
        let mut simulation =
            ArticulatedSimulator::new(pendulum(), world, &[0.0], Options::default()).unwrap();
        (0..1000).for_each(|_| _ = simulation.step(1e-3).unwrap());
        let height = simulation.object_pose(simulation.object("body").unwrap()).translation.z;
        assert!((height - half.z).abs() < 1e-4, "on {name}: {height} m");
    }
}

/// An ellipsoid made of rings of corners, with one corner at each end of z.
fn ellipsoid(half: Vector3<f64>, rings: usize) -> TriangleMesh {
    let around = 2 * rings;
    let mut points = vec![-Vector3::z().component_mul(&half)];
    for ring in 1..rings {
        let polar = std::f64::consts::PI * ring as f64 / rings as f64;
        for place in 0..around {
            let turn = std::f64::consts::TAU * place as f64 / around as f64;
            let unit = Vector3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), -polar.cos());
            points.push(unit.component_mul(&half));
        }
    }
    points.push(Vector3::z().component_mul(&half));
    let (count, last) = (around as u32, points.len() as u32 - 1);
    let mut triangles = Vec::new();
    for place in 0..count {
        let next = (place + 1) % count;
        triangles.push([0, 1 + next, 1 + place]);
        triangles.push([last, last - count + place, last - count + next]);
        for ring in 0..rings as u32 - 2 {
            let (low, high) = (1 + ring * count, 1 + (ring + 1) * count);
            triangles.push([low + place, low + next, high + next]);
            triangles.push([low + place, high + next, high + place]);
        }
    }
    TriangleMesh { points, triangles }
}
