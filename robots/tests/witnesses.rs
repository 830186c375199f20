//! Witness points, compared with the shapes and with the distances after a rotation.

use crate::solids::{Random, cube, translation, with_shape};
use motorium_robots::{
    CollisionModel, CollisionOptions, Collisions, Geometry, Kinematics, MeshMode, Proximity,
};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

/// Returns the nearest points and the witnesses of a shape at the origin and another one at a pose.
fn between(shape: &str, other: Geometry, placement: Isometry3<f64>) -> (Proximity, Vec<Proximity>) {
    let model = with_shape(shape);
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &[0.0]);
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    solids.add_obstacle("other", placement, other, MeshMode::default()).unwrap();
    witnesses(&solids, &kinematics)
}

fn witnesses(solids: &CollisionModel, kinematics: &Kinematics) -> (Proximity, Vec<Proximity>) {
    let mut collisions = Collisions::new(solids);
    collisions.update(solids, kinematics);
    let nearest = collisions.distance(solids, 0);
    let mut found = Vec::new();
    collisions.witnesses(solids, &nearest, Collisions::MOST_WITNESSES, &mut found);
    (nearest, found)
}

/// Returns `true` if one of the witnesses has this point on the first solid and this gap \[m\] opposite it.
fn has(found: &[Proximity], x: f64, y: f64, z: f64, gap: f64) -> bool {
    found.iter().any(|witness| {
        (witness.points[0] - Point3::new(x, y, z)).norm() < 1e-6 && (witness.distance - gap).abs() < 1e-6
    })
}

#[test]
fn witnesses_between_faces_are_the_corners_of_the_overlap() {
    // a corner of the small cube and a corner of the large one: 0.5 by 0.5
    let (nearest, found) = between("<box size=\"2 2 2\"/>", cube(1.0), translation(1.0, 1.0, 1.6));
    assert!((nearest.distance - 0.1).abs() < 1e-9);
    let corners = [(0.5, 0.5), (1.0, 0.5), (1.0, 1.0), (0.5, 1.0)];
    let is_nearest = |x: f64, y: f64| (nearest.points[0] - Point3::new(x, y, 1.0)).norm() < 1e-5;
    for (x, y) in corners {
        assert!(is_nearest(x, y) || has(&found, x, y, 1.0, 0.1), "({x}, {y}): {found:?}");
    }
    assert!(found.len() <= 4);
    // with half of the face tilted, the far edge is known before it is the nearest
    let tilted = Isometry3::new(Vector3::new(0.0, 0.0, 1.6), Vector3::new(0.02, 0.0, 0.0));
    let (nearest, found) = between("<box size=\"2 2 2\"/>", cube(1.0), tilted);
    let farther = found.iter().filter(|witness| witness.distance > nearest.distance + 0.015).count();
    assert_eq!(farther, 2, "{nearest:?} {found:?}");
}

#[test]
fn edge_above_a_face_has_two_witnesses_and_a_corner_none() {
    let edge = Isometry3::new(Vector3::new(0.1, 0.0, 1.8), Vector3::y() * std::f64::consts::FRAC_PI_4);
    let (nearest, found) = between("<box size=\"2 2 2\"/>", cube(1.0), edge);
    let gap = 1.8 - 1.0 - 0.5_f64.sqrt();
    assert!((nearest.distance - gap).abs() < 1e-9);
    for y in [-0.5, 0.5] {
        assert!((nearest.points[0].y - y).abs() < 1e-6 || has(&found, 0.1, y, 1.0, gap), "{y}: {found:?}");
    }
    let corner = UnitQuaternion::rotation_between(&Vector3::repeat(-1.0), &-Vector3::z()).unwrap();
    let (_, found) = between(
        "<box size=\"2 2 2\"/>",
        cube(1.0),
        Isometry3::from_parts(Vector3::new(0.1, 0.0, 2.0).into(), corner),
    );
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn only_parallel_edges_have_witnesses() {
    let up = UnitQuaternion::from_scaled_axis(Vector3::y() * std::f64::consts::FRAC_PI_4);
    let stands = |turn: f64, y: f64| {
        let turned = UnitQuaternion::from_scaled_axis(Vector3::z() * turn) * up;
        Isometry3::from_parts(Vector3::new(0.0, y, 0.0).into(), turned)
    };
    let model = with_shape("<sphere radius=\"0.001\"/>");
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &[0.0]);
    let beams = |turn: f64, y: f64| {
        let options = CollisionOptions::default();
        let mut solids = CollisionModel::new(&model, &options).unwrap();
        let beam = || Geometry::Box { size: Vector3::new(0.1, 1.0, 0.1) };
        solids.add_obstacle("below", stands(0.0, 0.0), beam(), MeshMode::default()).unwrap();
        let above = Isometry3::translation(0.0, 0.0, 0.3) * stands(turn, y);
        solids.add_free_object("above", above, beam(), MeshMode::default()).unwrap();
        solids.exclude("body", "below");
        solids.exclude("body", "above");
        witnesses(&solids, &kinematics)
    };
    let gap = 0.3 - 2.0 * 0.05 * 2.0_f64.sqrt();
    let (nearest, found) = beams(0.6, 0.0);
    assert!((nearest.distance - gap).abs() < 1e-9 && found.is_empty(), "{nearest:?} {found:?}");
    let (nearest, found) = beams(0.0, 0.4);
    let top = 0.05 * 2.0_f64.sqrt();
    for y in [-0.1, 0.5] {
        let is_nearest = (nearest.points[0].y - y).abs() < 1e-5;
        assert!(is_nearest || has(&found, 0.0, y, top, gap), "{y}: {nearest:?} {found:?}");
    }
}

#[test]
fn capsule_ends_and_cylinder_rims_have_witnesses() {
    let lying = Isometry3::new(Vector3::new(0.0, 0.0, 1.3), Vector3::y() * std::f64::consts::FRAC_PI_2);
    let capsule = Geometry::Capsule { radius: 0.1, length: 0.6 };
    let (nearest, found) = between("<box size=\"2 2 2\"/>", capsule, lying);
    for x in [-0.3, 0.3] {
        assert!((nearest.points[0].x - x).abs() < 1e-5 || has(&found, x, 0.0, 1.0, 0.2), "{x}: {found:?}");
    }
    let cylinder = Geometry::Cylinder { radius: 0.2, length: 0.4 };
    let (_, found) = between("<box size=\"2 2 2\"/>", cylinder, translation(0.0, 0.0, 1.3));
    assert!(found.len() >= 3, "{found:?}");
    for witness in &found {
        let at = &witness.points[1];
        assert!((at.x.hypot(at.y) - 0.2).abs() < 1e-9 && (at.z - 1.1).abs() < 1e-9, "{witness:?}");
    }
    let (_, found) =
        between("<box size=\"2 2 2\"/>", Geometry::Sphere { radius: 0.2 }, translation(0.3, 0.0, 1.5));
    assert!(found.is_empty());
}

#[test]
fn witnesses_above_a_half_space_are_the_lower_corners() {
    let model = with_shape("<box size=\"0.4 0.2 0.1\"/>");
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &[0.5]);
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    solids.add_half_space("ground", translation(0.0, 0.0, 0.0));
    let (nearest, found) = witnesses(&solids, &kinematics);
    assert!((nearest.distance - 0.45).abs() < 1e-12);
    for (x, y) in [(0.2, 0.1), (-0.2, 0.1), (-0.2, -0.1), (0.2, -0.1)] {
        let is_nearest = (nearest.points[0] - Point3::new(x, y, 0.45)).norm() < 1e-6;
        assert!(is_nearest || has(&found, x, y, 0.45, 0.45), "({x}, {y}): {found:?}");
    }
    assert!(found.iter().all(|witness| witness.points[1].z.abs() < 1e-12));
}

#[test]
fn witnesses_predict_the_distance_after_a_small_rotation() {
    // the distance after a rotation, predicted from the previously known points, equals the measured one
    let shapes = [
        "<box size=\"0.4 0.3 0.1\"/>",
        "<cylinder radius=\"0.15\" length=\"0.2\"/>",
        "<capsule radius=\"0.05\" length=\"0.4\"/>",
    ];
    let mut random = Random(3);
    for shape in shapes {
        for case in 0..300 {
            let about = |random: &mut Random, size: f64| {
                Vector3::new(random.next(), random.next(), random.next()) * size
            };
            // nearly parallel to the cube, above its upper face or next to its rim
            let pose = Isometry3::new(
                about(&mut random, 0.3) + Vector3::new(0.0, 0.0, 0.9),
                about(&mut random, 0.02),
            );
            let turn = Isometry3::rotation(about(&mut random, 0.01));
            let model = with_shape(shape);
            let mut kinematics = Kinematics::new(&model);
            kinematics.update(&model, &[0.0]);
            let measure = |pose: Isometry3<f64>| {
                let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
                solids.add_obstacle("cube", pose.inverse(), cube(1.0), MeshMode::default()).unwrap();
                witnesses(&solids, &kinematics)
            };
            let (nearest, found) = measure(pose);
            if nearest.distance < 0.02 {
                continue;
            }
            assert!(
                found.iter().all(|witness| witness.distance >= nearest.distance - 1e-9),
                "{shape} {case}"
            );
            let after = measure(pose * turn).0.distance;
            // points of the shape stay; points of the cube move with the rotation
            let known = std::iter::once(&nearest).chain(&found).map(|witness| {
                let moved = turn.inverse() * witness.points[1];
                (moved - witness.points[0]).dot(&witness.normal)
            });
            let known = known.fold(f64::INFINITY, f64::min);
            // second order in the rotation, plus the part of a rim between two of its witnesses
            let rim = if shape.starts_with("<cyl") { 0.01 * 0.05 } else { 0.0 };
            assert!(known - after < 2e-4 + rim, "{shape} {case}: {known} {after} {nearest:?} {found:?}");
        }
    }
}
