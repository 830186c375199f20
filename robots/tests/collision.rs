//! Signed distances between links: pairs, rules, ranges, gradients.

use std::path::Path;

use crate::solids::{Random, cube, translation, with_shape};
use approx::assert_relative_eq;
use motorium_robots::{
    Attachment, BaseMode, CollisionError, CollisionModel, CollisionOptions, Collisions, ConvexShape,
    Geometry, Kinematics, LoadOptions, MeshMode, Model, Proximity, Srdf, load, load_with,
};
use nalgebra::DMatrix;

fn panda(base: BaseMode) -> Model {
    load_with("panda", Path::new("."), &LoadOptions { base, ..LoadOptions::default() }).unwrap().model
}

/// Returns a configuration slightly away from neutral, in the middle of the limits.
fn configuration(model: &Model, random: &mut Random) -> Vec<f64> {
    let v: Vec<f64> = (0..model.nv()).map(|_| random.next()).collect();
    let (start, mut q) = (model.neutral(), model.neutral());
    model.integrate(&start, &v, &mut q);
    q
}

#[test]
fn jacobian_is_the_gradient_of_the_distance() {
    let mut random = Random(5);
    for base in [BaseMode::AsFile, BaseMode::Floating] {
        let model = panda(base);
        let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
        let ball = Geometry::Sphere { radius: 0.1 };
        solids.add_obstacle("ball", translation(0.5, 0.4, 0.6), ball, MeshMode::default()).unwrap();
        let mut collisions = Collisions::new(&solids);
        let mut kinematics = Kinematics::new(&model);
        let (mut checked, mut sharp) = (0, 0);
        for _ in 0..30 {
            let q = configuration(&model, &mut random);
            let mut at = |v: &[f64]| -> Vec<Proximity> {
                let mut moved = q.clone();
                model.integrate(&q, v, &mut moved);
                kinematics.update(&model, &moved);
                collisions.update(&solids, &kinematics);
                (0..solids.pairs().len()).map(|pair| collisions.distance(&solids, pair)).collect()
            };
            let h = 1e-5;
            let mut slopes = DMatrix::zeros(solids.pairs().len(), model.nv());
            let mut kinks = vec![false; solids.pairs().len()];
            for column in 0..model.nv() {
                let mut step = vec![0.0; model.nv()];
                step[column] = h;
                let plus = at(&step);
                step[column] = -h;
                let minus = at(&step);
                for pair in 0..solids.pairs().len() {
                    slopes[(pair, column)] = (plus[pair].distance - minus[pair].distance) / (2.0 * h);
                    kinks[pair] |= plus[pair].normal.dot(&minus[pair].normal) < 0.9999
                        || (plus[pair].points[0] - minus[pair].points[0]).norm() > 1e-3;
                }
            }
            let found = at(&vec![0.0; model.nv()]);
            let mut rows = DMatrix::zeros(found.len(), model.nv());
            solids.distance_jacobians(&model, &kinematics, &found, &mut rows);
            for (pair, proximity) in found.iter().enumerate() {
                let mut row = vec![f64::NAN; model.nv()];
                solids.distance_jacobian(&model, &kinematics, proximity, &mut row);
                assert!(rows.row(pair).iter().eq(row.iter()));
                // where the nearest points jump, the distance has a kink and no gradient
                if kinks[pair] {
                    sharp += 1;
                    continue;
                }
                checked += 1;
                for column in 0..model.nv() {
                    assert_relative_eq!(row[column], slopes[(pair, column)], epsilon = 2e-4);
                }
            }
        }
        assert!(checked > 5 * sharp && checked > 100, "{checked} slopes, {sharp} kinks");
    }
}

#[test]
fn adjacent_links_are_checked_on_request_only() {
    let model = panda(BaseMode::AsFile);
    let solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    let names: Vec<_> = (0..solids.pairs().len()).map(|pair| solids.pair_links(pair)).collect();
    assert!(!names.contains(&["panda_link3", "panda_link4"]));
    assert!(names.contains(&["panda_link3", "panda_link5"]));
    assert!(names.iter().all(|pair| pair[0] != pair[1]));
    let all = CollisionOptions { adjacent: true, ..CollisionOptions::default() };
    let all = CollisionModel::new(&model, &all).unwrap();
    assert!(all.pairs().len() > solids.pairs().len());
    assert!((0..all.pairs().len()).any(|pair| all.pair_links(pair) == ["panda_link3", "panda_link4"]));
}

#[test]
fn srdf_disables_and_enables_pairs() {
    let model = panda(BaseMode::AsFile);
    let srdf = Srdf::parse(
        "<robot name=\"panda\"><group name=\"arm\"/>\
         <disable_default_collisions link=\"panda_link7\"/>\
         <disable_collisions link1=\"panda_link5\" link2=\"panda_link3\" reason=\"Never\"/>\
         <enable_collisions link1=\"panda_link7\" link2=\"panda_link2\"/></robot>",
    )
    .unwrap();
    let options = CollisionOptions { srdf, ..CollisionOptions::default() };
    let solids = CollisionModel::new(&model, &options).unwrap();
    let names: Vec<_> = (0..solids.pairs().len()).map(|pair| solids.pair_links(pair)).collect();
    assert!(!names.contains(&["panda_link3", "panda_link5"]));
    let of_seven: Vec<_> = names.iter().filter(|pair| pair.contains(&"panda_link7")).collect();
    assert!(!of_seven.is_empty() && of_seven.iter().all(|pair| **pair == ["panda_link2", "panda_link7"]));

    let error = Srdf::parse("<robot>\n <disable_collisions link1=\"a\"/></robot>").unwrap_err();
    assert_eq!(error.to_string(), "SRDF:2:2: <disable_collisions> has no attribute \"link2\"");
    let srdf = Srdf::parse("<robot><disable_collisions link1=\"panda_link5\" link2=\"panda_lnk3\"/></robot>")
        .unwrap();
    let error = CollisionModel::new(&model, &CollisionOptions { srdf, ..CollisionOptions::default() });
    assert!(matches!(&error, Err(CollisionError::UnknownLink { nearest: Some(_), .. })), "{error:?}");
}

#[test]
fn nearest_pair_is_the_minimum_and_ranges_skip_far_pairs() {
    let model = panda(BaseMode::AsFile);
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    solids.add_obstacle("table", translation(0.0, 0.0, -0.3), cube(0.4), MeshMode::default()).unwrap();
    let removed = solids.exclude("table", "panda_link0");
    assert!(removed > 0);
    let (mut collisions, mut kinematics) = (Collisions::new(&solids), Kinematics::new(&model));
    let mut random = Random(11);
    for _ in 0..20 {
        let q = configuration(&model, &mut random);
        kinematics.update(&model, &q);
        collisions.update(&solids, &kinematics);
        let all: Vec<_> = (0..solids.pairs().len()).map(|pair| collisions.distance(&solids, pair)).collect();
        let least = all.iter().map(|proximity| proximity.distance).fold(f64::INFINITY, f64::min);
        let nearest = collisions.nearest(&solids).unwrap();
        assert_relative_eq!(nearest.distance, least, epsilon = 1e-7);
        let near: Vec<_> = collisions.within(&solids, 0.15).to_vec();
        let expected: Vec<_> = all.iter().filter(|proximity| proximity.distance <= 0.15).collect();
        assert_eq!(near.len(), expected.len());
        for (found, expected) in near.iter().zip(expected) {
            assert_eq!(found.pair, expected.pair);
            assert_relative_eq!(found.distance, expected.distance, epsilon = 1e-6);
        }
        assert_eq!(collisions.colliding(&solids, 0.0).is_some(), least < 0.0);
    }
}

#[test]
fn unusable_shape_is_named_or_left_out() {
    let model = with_shape("<mesh filename=\"package://nowhere/a.stl\"/>");
    let error = CollisionModel::new(&model, &CollisionOptions::default()).unwrap_err();
    assert!(
        error.to_string().contains("link \"body\"") && error.to_string().contains("--package-path"),
        "{error}"
    );
    let options = CollisionOptions { leave_out_defects: true, ..CollisionOptions::default() };
    let solids = CollisionModel::new(&model, &options).unwrap();
    assert_eq!((solids.solid_count(), solids.left_out().len()), (0, 1));

    let model = with_shape("<sphere radius=\"0\"/>");
    let error = CollisionModel::new(&model, &CollisionOptions::default()).unwrap_err();
    assert_eq!(error.to_string(), "link \"body\": its radius is 0, expected a number above 0");
}

#[test]
fn nan_state_has_no_distance_and_no_lasting_effect() {
    let model = with_shape("<box size=\"1 1 1\"/>");
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    solids.add_obstacle("other", translation(0.0, 0.0, 0.0), cube(1.0), MeshMode::default()).unwrap();
    let (mut collisions, mut kinematics) = (Collisions::new(&solids), Kinematics::new(&model));
    kinematics.update(&model, &[f64::NAN]);
    collisions.update(&solids, &kinematics);
    assert!(collisions.distance(&solids, 0).distance.is_nan());
    assert_eq!(collisions.within(&solids, 0.1).len(), 1);
}

#[test]
fn panda_at_home_is_not_in_self_collision() {
    let loaded = load("panda", Path::new(".")).unwrap();
    let model = &loaded.model;
    let home = loaded.profile.as_ref().unwrap().home(model).unwrap();
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, home.as_slice());
    let solids = CollisionModel::new(model, &CollisionOptions::default()).unwrap();
    let mut collisions = Collisions::new(&solids);
    collisions.update(&solids, &kinematics);
    let met = collisions.colliding(&solids, 0.0);
    assert!(met.is_none(), "{:?} {met:?}", met.map(|met| solids.pair_links(met.pair)));
}

/// Uses `MOTORIUM_EXAMPLE_ROBOT_DATA`, the folder of the robots of the PyPI package example-robot-data.
#[test]
fn humanoid_distances_use_its_meshes_and_srdf() {
    let Some(folder) = std::env::var_os("MOTORIUM_EXAMPLE_ROBOT_DATA").map(std::path::PathBuf::from) else {
        println!("skipped: set MOTORIUM_EXAMPLE_ROBOT_DATA to the robots of example-robot-data");
        return;
    };
    let mut options = LoadOptions { base: BaseMode::Floating, ..LoadOptions::default() };
    options.packages.folders = folder.ancestors().map(std::path::Path::to_owned).collect();
    let model = load_with("talos_data/robots/talos_reduced.urdf", &folder, &options).unwrap().model;
    let text = std::fs::read_to_string(folder.join("talos_data/srdf/talos.srdf")).unwrap();
    let srdf = Srdf::parse(&text).unwrap();
    // the posture called half_sitting in the file
    let document = roxmltree::Document::parse(&text).unwrap();
    let posture = document.descendants().find(|node| node.attribute("name") == Some("half_sitting")).unwrap();
    let mut q = model.neutral();
    for joint in posture.children().filter(|child| child.has_tag_name("joint")) {
        if let Some(index) = model.joint_index(joint.attribute("name").unwrap()) {
            q[7 + index] = joint.attribute("value").unwrap().parse().unwrap();
        }
    }
    let options = CollisionOptions { srdf, leave_out_defects: true, ..CollisionOptions::default() };
    let capsules = CollisionOptions { meshes: MeshMode::Capsule, ..options.clone() };
    let mut found = Vec::new();
    for options in [options, capsules] {
        let solids = CollisionModel::new(&model, &options).unwrap();
        println!("{:?}: {} solids, {} pairs", options.meshes, solids.solid_count(), solids.pairs().len());
        assert!(solids.pairs().len() > 100 && solids.left_out().is_empty(), "{:?}", solids.left_out());
        let (mut collisions, mut kinematics) = (Collisions::new(&solids), Kinematics::new(&model));
        kinematics.update(&model, &q);
        collisions.update(&solids, &kinematics);
        let start = std::time::Instant::now();
        let near = collisions.within(&solids, 0.1).len();
        println!("{near} pairs within 0.1 m in {:?}", start.elapsed());
        let nearest = collisions.nearest(&solids).unwrap();
        println!("nearest {:?} {:.4}", solids.pair_links(nearest.pair), nearest.distance);
        let all = (0..solids.pairs().len()).map(|pair| collisions.distance(&solids, pair).distance);
        found.push(all.collect::<Vec<_>>());
    }
    // capsules contain their meshes, so they are never farther apart
    assert!(found[0].iter().zip(&found[1]).all(|(hull, capsule)| *capsule <= hull + 1e-6));
    // hulls fill the concavities of their meshes, so a few nested links overlap
    let overlaps = found[0].iter().filter(|distance| **distance <= 0.0).count();
    assert!(overlaps < found[0].len() / 100, "{overlaps} of {}", found[0].len());
}

/// Height above a tilted plane of the lowest point of each shape, from its corners or its definition.
#[test]
fn half_space_distance_is_the_lowest_height() {
    let mut random = Random(11);
    let shapes = [
        (r#"<sphere radius="0.2"/>"#, 0.2, [0.0, 0.0, 0.0]),
        (r#"<box size="0.2 0.4 0.6"/>"#, 0.0, [0.1, 0.2, 0.3]),
        (r#"<capsule radius="0.1" length="0.5"/>"#, 0.1, [0.0, 0.0, 0.25]),
    ];
    for (geometry, radius, half) in shapes {
        let model = with_shape(geometry);
        for _ in 0..50 {
            let turn = nalgebra::Vector3::new(random.next(), random.next(), random.next()) * 3.0;
            let plane =
                nalgebra::Isometry3::new(nalgebra::Vector3::new(0.1, -0.2, 0.3) * random.next(), turn);
            let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
            let ground = solids.add_half_space("ground", plane);
            assert_eq!(
                (solids.pairs(), solids.convex_shape(ground)),
                (&[[0, 1]][..], ConvexShape::HalfSpace)
            );
            let (mut collisions, mut kinematics) = (Collisions::new(&solids), Kinematics::new(&model));
            let q = [random.next()];
            kinematics.update(&model, &q);
            collisions.update(&solids, &kinematics);
            let found = collisions.distance(&solids, 0);
            let up = plane.rotation * nalgebra::Vector3::z();
            let heights = (0..8_u32).map(|corner| {
                let sign = |axis: usize| if corner >> axis & 1 == 0 { -half[axis] } else { half[axis] };
                let point = nalgebra::Vector3::new(sign(0), sign(1), q[0] + sign(2));
                (point - plane.translation.vector).dot(&up) - radius
            });
            let expected = heights.fold(f64::INFINITY, f64::min);
            assert_relative_eq!(found.distance, expected, epsilon = 1e-12);
            assert_relative_eq!(found.normal.into_inner(), -up, epsilon = 1e-12);
            assert_relative_eq!(
                (found.points[1] - found.points[0]).dot(&found.normal),
                expected,
                epsilon = 1e-12
            );
        }
    }
}

#[test]
fn free_objects_are_checked_against_everything() {
    let model = with_shape(r#"<sphere radius="0.1"/>"#);
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    let meshes = MeshMode::default();
    let wall = solids.add_obstacle("wall", translation(1.0, 0.0, 0.0), cube(0.2), meshes).unwrap();
    let ball = solids.add_free_object("ball", translation(0.0, 1.0, 0.0), cube(0.2), meshes).unwrap();
    let can = solids.add_free_object("can", translation(0.0, 2.0, 0.0), cube(0.2), meshes).unwrap();
    let ground = solids.add_half_space("ground", translation(0.0, 0.0, -3.0));
    let expected = [
        [0, wall],
        [0, ball],
        [wall, ball],
        [0, can],
        [wall, can],
        [ball, can],
        [0, ground],
        [ball, ground],
        [can, ground],
    ];
    assert_eq!(solids.pairs(), expected);
    assert_eq!(solids.attachment(0), Attachment::Body(0));
    assert_eq!(solids.attachment(ball), Attachment::World);
    let mut collisions = Collisions::new(&solids);
    let pair = expected.iter().position(|pair| *pair == [ball, can]).unwrap();
    assert_relative_eq!(collisions.distance(&solids, pair).distance, 0.8, epsilon = 1e-12);
    collisions.set_pose(can, &translation(0.0, 1.5, 0.0));
    assert_relative_eq!(collisions.distance(&solids, pair).distance, 0.3, epsilon = 1e-12);
    assert!(collisions.distance_within(&solids, pair, 0.2).is_none_or(|found| found.distance > 0.2));
    solids.retain_pairs(|pair| pair.contains(&ground));
    assert_eq!(solids.pairs(), [[0, ground], [ball, ground], [can, ground]]);
}
