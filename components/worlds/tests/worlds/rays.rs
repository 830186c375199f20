//! Rays compared with closed forms and with marching along the ray, and bundles compared with single rays.

use motorium_robots::{CollisionModel, CollisionOptions, ConvexShape, load};
use motorium_worlds::{Ground, Object, ObjectShape, Ray, RayScene, RayShape, World};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::random::Random;

fn ray(origin: [f64; 3], direction: [f64; 3]) -> Ray {
    Ray { origin: Point3::from(origin), direction: Unit::new_normalize(Vector3::from(direction)) }
}

fn near(found: Option<(f64, Vector3<f64>)>, distance: f64, normal: [f64; 3]) {
    let (at, out) = found.expect("a hit");
    assert!((at - distance).abs() < 1e-12 * distance.max(1.0), "{at}, expected {distance}");
    assert!((out - Vector3::from(normal)).norm() < 1e-9, "{out}");
}

#[test]
fn distances_to_basic_shapes_match_closed_forms() {
    let slope = UnitQuaternion::from_euler_angles(0.0, 0.3, 0.0);
    let plane = Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.5), slope);
    // a plane through (0, 0, 0.5) that descends by 0.3 rad towards x, from 2 m above it
    let found =
        RayShape::new(&ConvexShape::HalfSpace).cast(&plane, &ray([1.0, 3.0, 2.5], [0.0, 0.0, -1.0]), 9.0);
    near(found, 2.0 + 0.3_f64.tan(), [0.3_f64.sin(), 0.0, 0.3_f64.cos()]);

    let sphere = RayShape::new(&ConvexShape::Sphere { radius: 0.5 });
    let at = Isometry3::translation(3.0, 0.3, 0.0);
    // a chord at 0.3 from the centre is 0.8 long
    near(sphere.cast(&at, &ray([0.0; 3], [1.0, 0.0, 0.0]), 9.0), 2.6, [-0.8, -0.6, 0.0]);

    let block = RayShape::new(&ConvexShape::Box { half: Vector3::new(0.5, 1.0, 2.0) });
    let turned = Isometry3::new(Vector3::new(4.0, 0.0, 0.0), Vector3::z() * std::f64::consts::FRAC_PI_4);
    // the edge at the corner (-0.5, 1) faces the ray: after the rotation it is at -1.5 / sqrt 2 along x, 0.5
    // / sqrt 2 along y
    let y = 0.5 / 2.0_f64.sqrt();
    let found = block.cast(&turned, &ray([0.0, y + 1e-9, 0.0], [1.0, 0.0, 0.0]), 9.0).unwrap();
    assert!((found.0 - (4.0 - 1.5 / 2.0_f64.sqrt())).abs() < 1e-8, "{}", found.0);
    near(
        block.cast(&Isometry3::translation(4.0, 0.2, 0.1), &ray([0.0; 3], [1.0, 0.0, 0.0]), 9.0),
        3.5,
        [-1.0, 0.0, 0.0],
    );

    let upright = RayShape::new(&ConvexShape::Cylinder { radius: 0.5, half_length: 1.0 });
    near(upright.cast(&at, &ray([0.0; 3], [1.0, 0.0, 0.0]), 9.0), 2.6, [-0.8, -0.6, 0.0]);
    // its lid, from above at an angle: 3 m down along a slope of 3:4 in 5 m
    let found = upright.cast(&Isometry3::translation(4.0, 0.0, -4.0), &ray([0.0; 3], [0.8, 0.0, -0.6]), 9.0);
    near(found, 5.0, [0.0, 0.0, 1.0]);

    let capsule = RayShape::new(&ConvexShape::Capsule { radius: 0.5, half_length: 1.0 });
    near(capsule.cast(&at, &ray([0.0, 0.0, 0.9], [1.0, 0.0, 0.0]), 9.0), 2.6, [-0.8, -0.6, 0.0]);
    near(
        capsule.cast(&Isometry3::identity(), &ray([0.3, 0.0, 4.0], [0.0, 0.0, -1.0]), 9.0),
        2.6,
        [0.6, 0.0, 0.8],
    );
}

#[test]
fn rays_from_inside_past_or_out_of_range_hit_nothing() {
    let shapes = [
        ConvexShape::Sphere { radius: 0.5 },
        ConvexShape::Box { half: Vector3::repeat(0.5) },
        ConvexShape::Cylinder { radius: 0.5, half_length: 0.5 },
        ConvexShape::Capsule { radius: 0.5, half_length: 0.5 },
        ConvexShape::Hull { points: corners() },
    ];
    for shape in shapes {
        let target = RayShape::new(&shape);
        let here = Isometry3::translation(2.0, 0.0, 0.0);
        let ahead = [1.0, 0.0, 0.0];
        near(target.cast(&here, &ray([0.0; 3], ahead), 1.5 + 1e-12), 1.5, [-1.0, 0.0, 0.0]);
        assert_eq!(target.cast(&here, &ray([0.0; 3], ahead), 1.4999), None, "{shape:?} out of range");
        assert_eq!(target.cast(&here, &ray([1.9, 0.1, 0.2], ahead), 9.0), None, "{shape:?} from inside");
        assert_eq!(target.cast(&here, &ray([2.6, 0.0, 0.0], ahead), 9.0), None, "{shape:?} behind");
        assert_eq!(target.cast(&here, &ray([0.0, 1.1, 0.0], ahead), 9.0), None, "{shape:?} beside");
    }
    let flat = ConvexShape::Hull { points: vec![Vector3::zeros(), Vector3::x(), Vector3::y()] };
    assert_eq!(
        RayShape::new(&flat).cast(&Isometry3::identity(), &ray([0.1, 0.1, 1.0], [0.0, 0.0, -1.0]), 9.0),
        None
    );
}

fn corners() -> Vec<Vector3<f64>> {
    let sign = |bit: usize| if bit == 0 { -0.5 } else { 0.5 };
    (0..8).map(|index| Vector3::new(sign(index & 1), sign(index >> 1 & 1), sign(index >> 2 & 1))).collect()
}

#[test]
fn hull_of_box_corners_is_hit_like_the_box() {
    let (hull, block) = (
        RayShape::new(&ConvexShape::Hull { points: corners() }),
        RayShape::new(&ConvexShape::Box { half: Vector3::repeat(0.5) }),
    );
    let mut random = Random(3);
    let mut met = 0;
    for _ in 0..5000 {
        let pose = pose(&mut random);
        let from = [random.next() * 2.0, random.next() * 2.0, random.next() * 2.0];
        let ray = ray(from, [random.next(), random.next(), random.next()]);
        match (hull.cast(&pose, &ray, 20.0), block.cast(&pose, &ray, 20.0)) {
            (Some(a), Some(b)) => {
                met += 1;
                assert!((a.0 - b.0).abs() < 1e-9, "{} {}", a.0, b.0);
            }
            (None, None) => {}
            // along an edge, rounding decides
            (a, b) => assert!(a.or(b).is_some_and(|hit| {
                let point = pose.inverse_transform_point(&ray.point(hit.0));
                point.coords.abs().iter().filter(|x| **x > 0.4999).count() > 1
            })),
        }
    }
    assert!(met > 200, "{met}");
}

fn pose(random: &mut Random) -> Isometry3<f64> {
    let turn = Vector3::new(random.next(), random.next(), random.next()) * 3.0;
    Isometry3::new(Vector3::new(random.next(), random.next(), random.next()), turn)
}

fn table_top() -> World {
    let object = |index: usize, shape, position| Object {
        name: format!("object {index}"),
        shape,
        mass: None,
        position,
        rpy: [0.1 * index as f64, 0.2, 0.3],
        ..Object::default()
    };
    let mut random = Random(9);
    let objects = (0..12).map(|index| {
        let shape = match index % 4 {
            0 => ObjectShape::Box { size: [0.05, 0.1, 0.15] },
            1 => ObjectShape::Sphere { radius: 0.06 },
            2 => ObjectShape::Capsule { radius: 0.05, length: 0.1 },
            _ => ObjectShape::Cylinder { radius: 0.04, length: 0.12 },
        };
        object(index, shape, [0.5 + 0.3 * random.next(), 0.5 * random.next(), 0.1])
    });
    World { ground: Some(Ground::default()), objects: objects.collect(), ..World::default() }
}

#[test]
fn ray_bundles_match_single_rays() {
    let panda = load("panda", std::path::Path::new(".")).unwrap();
    let mut scene = RayScene::default();
    scene.add_solids(&CollisionModel::new(&panda.model, &CollisionOptions::default()).unwrap());
    scene.add_world(&table_top());
    let mut random = Random(17);
    let mut fans: Vec<Vec<Ray>> = Vec::new();
    // in all directions from one point, down from a grid, and in random order
    let from = [0.2, 0.1, 0.6];
    fans.push(
        (0..360).map(|k| (k as f64).to_radians()).map(|a| ray(from, [a.cos(), a.sin(), -0.3])).collect(),
    );
    let grid = (0..187).map(|k| [(k / 11) as f64 * 0.1 - 0.3, (k % 11) as f64 * 0.1 - 0.5, 1.0]);
    fans.push(grid.map(|from| ray(from, [0.0, 0.0, -1.0])).collect());
    fans.push(
        (0..2000)
            .map(|_| {
                let from = [random.next() * 2.0, random.next() * 2.0, random.next() + 1.0];
                ray(from, [random.next(), random.next(), random.next()])
            })
            .collect(),
    );
    for rays in fans {
        let mut hits = vec![None; rays.len()];
        for range in [0.7, 30.0] {
            scene.cast_all(&rays, range, &mut hits);
            let mut met = 0;
            for (ray, hit) in rays.iter().zip(&hits) {
                assert_eq!(*hit, scene.cast(ray, range));
                met += usize::from(hit.is_some());
            }
            assert!(met > rays.len() / 20 || range < 1.0, "{met} of {}", rays.len());
        }
    }
}

#[test]
fn hits_are_on_the_first_surface() {
    let world = table_top();
    let mut scene = RayScene::default();
    scene.add_world(&world);
    // Signed distances of a point, from textbooks.
    let distance = |point: &Point3<f64>| -> f64 {
        let of_objects = world.objects.iter().map(|object| {
            let p = object.pose().inverse_transform_point(point).coords;
            match object.shape {
                ObjectShape::Sphere { radius } => p.norm() - radius,
                ObjectShape::Box { size } => {
                    let out = p.abs() - Vector3::from(size) * 0.5;
                    out.sup(&Vector3::zeros()).norm() + out.max().min(0.0)
                }
                ObjectShape::Cylinder { radius, length } => {
                    let (across, along) = (p.x.hypot(p.y) - radius, p.z.abs() - 0.5 * length);
                    across.max(0.0).hypot(along.max(0.0)) + across.max(along).min(0.0)
                }
                ObjectShape::Capsule { radius, length } => {
                    let beyond = p.z - p.z.clamp(-0.5 * length, 0.5 * length);
                    p.x.hypot(p.y).hypot(beyond) - radius
                }
                ObjectShape::Mesh(_) | ObjectShape::Compound(_) => {
                    unreachable!("nothing on this table is a mesh or a compound")
                }
            }
        });
        of_objects.fold(point.z, f64::min)
    };
    let mut random = Random(23);
    let mut met = 0;
    for _ in 0..3000 {
        let ray = ray(
            [random.next() * 2.0, random.next() * 2.0, random.next() + 1.2],
            [random.next(), random.next(), random.next()],
        );
        if distance(&ray.origin) < 1e-3 {
            continue;
        }
        let hit = scene.cast(&ray, 4.0);
        // March: no step is longer than the distance to the nearest surface.
        let mut at = 0.0;
        let end = hit.map_or(4.0, |hit| hit.distance);
        while at < end - 1e-9 {
            let step = distance(&ray.point(at));
            assert!(step > -1e-9, "something lies at {at}, before {end}");
            at += step.max(1e-5);
        }
        if let Some(hit) = hit {
            met += 1;
            assert!(distance(&ray.point(hit.distance)).abs() < 1e-9);
            assert!(hit.normal.dot(&ray.direction) < 0.0 && (hit.normal.norm() - 1.0).abs() < 1e-9);
        }
    }
    assert!(met > 1000, "{met}");
}
