//! Signed distances of shapes compared with geometry.

use crate::solids::{Random, cube, translation, with_shape};
use approx::assert_relative_eq;
use motorium_robots::{
    CollisionModel, CollisionOptions, Collisions, Geometry, Kinematics, MeshMode, Proximity,
};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

fn random_vector(random: &mut Random, scale: f64) -> Vector3<f64> {
    Vector3::new(random.next(), random.next(), random.next()) * scale
}

fn random_pose(random: &mut Random, scale: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(random_vector(random, 3.0));
    Isometry3::from_parts(random_vector(random, scale).into(), turn)
}

/// Distance of `geometry` at the origin from `other` at `placement`.
fn between(geometry: &str, other: Geometry, placement: Isometry3<f64>) -> Proximity {
    let model = with_shape(geometry);
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &[0.0]);
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    solids.add_obstacle("other", placement, other, MeshMode::default()).unwrap();
    let mut collisions = Collisions::new(&solids);
    collisions.update(&solids, &kinematics);
    collisions.distance(&solids, 0)
}

#[test]
fn primitive_distances_match_geometry() {
    let sphere = Geometry::Sphere { radius: 0.2 };
    let found = between("<sphere radius=\"0.1\"/>", sphere.clone(), translation(0.3, 0.4, 0.0));
    assert_relative_eq!(found.distance, 0.2, epsilon = 1e-12);
    assert_relative_eq!(found.points[0], Point3::new(0.06, 0.08, 0.0), epsilon = 1e-12);
    assert_relative_eq!(found.points[1], Point3::new(0.18, 0.24, 0.0), epsilon = 1e-12);
    assert_relative_eq!(found.normal.into_inner(), Vector3::new(0.6, 0.8, 0.0), epsilon = 1e-12);

    // a corner of the cube against the sphere, then an edge, then a face
    let gap = between("<box size=\"2 2 2\"/>", sphere.clone(), translation(2.0, 2.0, 2.0)).distance;
    assert_relative_eq!(gap, 3.0_f64.sqrt() - 0.2, epsilon = 1e-9);
    let gap = between("<box size=\"2 2 2\"/>", sphere.clone(), translation(2.0, 2.0, 0.3)).distance;
    assert_relative_eq!(gap, 2.0_f64.sqrt() - 0.2, epsilon = 1e-9);
    let gap = between("<box size=\"2 2 2\"/>", sphere.clone(), translation(2.0, 0.2, 0.3)).distance;
    assert_relative_eq!(gap, 0.8, epsilon = 1e-9);

    // URDF cylinders and capsules are along z
    let cylinder = "<cylinder radius=\"0.5\" length=\"2\"/>";
    assert_relative_eq!(
        between(cylinder, sphere.clone(), translation(0.0, 1.0, 0.9)).distance,
        0.3,
        epsilon = 1e-7
    );
    assert_relative_eq!(
        between(cylinder, sphere.clone(), translation(0.1, 0.0, 1.5)).distance,
        0.3,
        epsilon = 1e-9
    );
    let capsule = "<capsule radius=\"0.5\" length=\"2\"/>";
    assert_relative_eq!(between(capsule, sphere, translation(0.0, 0.0, 2.0)).distance, 0.3, epsilon = 1e-12);
    let crossing = Isometry3::new(Vector3::new(0.0, 2.0, 0.0), Vector3::y() * std::f64::consts::FRAC_PI_2);
    let other = Geometry::Capsule { radius: 0.25, length: 1.0 };
    assert_relative_eq!(between(capsule, other.clone(), crossing).distance, 1.25, epsilon = 1e-12);
    let parallel = between(capsule, other, translation(3.0, 0.0, 0.2));
    assert_relative_eq!(parallel.distance, 2.25, epsilon = 1e-12);
}

#[test]
fn depths_are_the_shortest_separations() {
    let sphere = Geometry::Sphere { radius: 0.2 };
    let found = between("<sphere radius=\"0.1\"/>", sphere.clone(), translation(0.1, 0.0, 0.0));
    assert_relative_eq!(found.distance, -0.2, epsilon = 1e-12);
    // The centre of the sphere is 0.3 below a face of the cube.
    let found = between("<box size=\"2 2 2\"/>", sphere, translation(0.1, -0.2, 0.7));
    assert_relative_eq!(found.distance, -0.5, epsilon = 1e-9);
    assert_relative_eq!(found.normal.into_inner(), Vector3::z(), epsilon = 1e-9);
    let found = between("<box size=\"2 2 2\"/>", cube(1.0), translation(0.2, 1.3, 0.1));
    assert_relative_eq!(found.distance, -0.2, epsilon = 1e-9);
    assert_relative_eq!(found.normal.into_inner(), Vector3::y(), epsilon = 1e-9);
    // crossed in the middle: separated sideways by both radii
    let crossing = Isometry3::rotation(Vector3::y() * std::f64::consts::FRAC_PI_2);
    let other = Geometry::Capsule { radius: 0.25, length: 1.0 };
    let found = between("<capsule radius=\"0.5\" length=\"2\"/>", other, crossing);
    assert_relative_eq!(found.distance, -0.75, epsilon = 1e-12);
    assert_relative_eq!(found.normal.y.abs(), 1.0, epsilon = 1e-9);
}

/// Returns the farthest point of a shape along a direction, from its definition.
fn support(geometry: &Geometry, placement: &Isometry3<f64>, direction: &Vector3<f64>) -> Point3<f64> {
    let d = placement.inverse_transform_vector(direction);
    let local = match *geometry {
        Geometry::Box { size } => size.zip_map(&d, |side, d| 0.5 * side * d.signum()),
        Geometry::Sphere { radius } => d.normalize() * radius,
        Geometry::Capsule { radius, length } => {
            d.normalize() * radius + Vector3::z() * 0.5 * length * d.z.signum()
        }
        Geometry::Cylinder { radius, length } => {
            let across = Vector3::new(d.x, d.y, 0.0);
            across.try_normalize(0.0).unwrap_or_default() * radius
                + Vector3::z() * 0.5 * length * d.z.signum()
        }
        Geometry::Mesh { .. } => unreachable!("no meshes here"),
    };
    placement * Point3::from(local)
}

#[test]
fn separating_planes_prove_every_distance() {
    let urdf = |geometry: &Geometry| match *geometry {
        Geometry::Box { size } => format!("<box size=\"{} {} {}\"/>", size.x, size.y, size.z),
        Geometry::Sphere { radius } => format!("<sphere radius=\"{radius}\"/>"),
        Geometry::Capsule { radius, length } => format!("<capsule radius=\"{radius}\" length=\"{length}\"/>"),
        Geometry::Cylinder { radius, length } => {
            format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>")
        }
        Geometry::Mesh { .. } => unreachable!("no meshes here"),
    };
    let shapes = [
        Geometry::Box { size: Vector3::new(0.3, 0.2, 0.5) },
        Geometry::Sphere { radius: 0.2 },
        Geometry::Capsule { radius: 0.1, length: 0.4 },
        Geometry::Cylinder { radius: 0.15, length: 0.3 },
    ];
    let mut random = Random(3);
    let (mut apart, mut deep) = (0, 0);
    for first in &shapes {
        let model = with_shape(&urdf(first));
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &[0.0]);
        for second in &shapes {
            let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
            let obstacle = solids
                .add_obstacle("other", Isometry3::identity(), second.clone(), MeshMode::default())
                .unwrap();
            let mut collisions = Collisions::new(&solids);
            collisions.update(&solids, &kinematics);
            for _ in 0..60 {
                let placement = random_pose(&mut random, 0.5);
                collisions.move_obstacle(&solids, obstacle, &placement);
                let found = collisions.distance(&solids, 0);
                let normal = found.normal.into_inner();
                let [p, q] = found.points;
                assert_relative_eq!(normal.norm(), 1.0, epsilon = 1e-9);
                assert_relative_eq!((q - p).dot(&normal), found.distance, epsilon = 1e-9);
                // No point of the first solid is beyond p along the normal, and no point of the second is
                // before q. The slab in between is empty (or shared), so no other distance along the normal
                // is possible ...
                let far = support(first, &Isometry3::identity(), &normal);
                let near = support(second, &placement, &-normal);
                assert_relative_eq!((near - far).dot(&normal), found.distance, epsilon = 1e-6);
                if found.distance > 0.0 {
                    // ... and it connects the points, so it is the distance.
                    apart += 1;
                    assert_relative_eq!((q - p).norm(), found.distance, epsilon = 1e-9);
                } else {
                    // ... and no other direction separates them sooner.
                    deep += 1;
                    for _ in 0..50 {
                        let direction = random_vector(&mut random, 1.0).normalize();
                        let far = support(first, &Isometry3::identity(), &direction);
                        let near = support(second, &placement, &-direction);
                        assert!((far - near).dot(&direction) >= -found.distance - 1e-6);
                    }
                }
            }
        }
    }
    assert!(apart > 200 && deep > 200, "{apart} apart, {deep} deep");
}
