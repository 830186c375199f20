//! All robots of the catalogue are plausible, and known robots match their publications.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;
use std::process::Command;

use approx::assert_relative_eq;
use motorium_robots::{
    BaseKind, Dynamics, Kinematics, LoadOptions, Reference, ShapeSource, TriangleMesh, catalogue, load,
    load_with,
};
use nalgebra::{DMatrix, Isometry3, SymmetricEigen, Vector3};

#[test]
fn entries_load_without_warnings_and_match_their_profile() {
    assert!(catalogue().is_sorted_by_key(|entry| entry.name));
    assert!(catalogue().len() >= 19);
    for entry in catalogue() {
        let robot = load(entry.name, Path::new("/nowhere")).unwrap();
        assert_eq!(robot.warnings, [], "{}", entry.name);
        assert_eq!(robot.model.name(), entry.name);
        let profile = robot.profile.unwrap();
        profile.check(&robot.model).unwrap();
        assert!(!profile.sources.is_empty() && !profile.title.is_empty(), "{}", entry.name);
        assert_eq!(profile.base == BaseKind::Floating, robot.model.base().floating, "{}", entry.name);
        for name in profile.poses.keys() {
            let pose = profile.pose(&robot.model, name).unwrap();
            for (index, q) in pose.iter().enumerate() {
                let range = robot.model.lower()[index]..=robot.model.upper()[index];
                assert!(range.contains(q), "{}: {name} leaves the limits of joint {index}", entry.name);
            }
            let placed = profile.base == BaseKind::Fixed || profile.base_poses.contains_key(name);
            assert!(placed, "{}: {name} has no base pose", entry.name);
        }
    }
}

#[test]
fn every_body_of_the_catalogue_is_plausible() {
    for entry in catalogue() {
        let model = load(entry.name, Path::new(".")).unwrap().model;
        let base = model.base().floating.then_some(&model.base().inertia);
        let bodies = model.bodies().iter().map(|body| &body.inertia).filter(|inertia| inertia.mass > 0.0);
        for inertia in bodies.chain(base) {
            let moments = SymmetricEigen::new(inertia.rotational).eigenvalues;
            assert!(moments.min() > 0.0, "{}: {moments}", entry.name);
            let largest = moments.max();
            // Half the trace is at least the largest moment.
            assert!(largest <= 0.5 * moments.sum() * (1.0 + 1e-9), "{}: {moments}", entry.name);
            let gyration = (largest / inertia.mass).sqrt();
            assert!((1e-4..1.0).contains(&gyration), "{}: radius of gyration {gyration} m", entry.name);
        }
        for (index, name) in model.joint_names().iter().enumerate() {
            let profile = &entry.profile;
            let driven = !profile.passive.contains(name);
            assert!(
                !driven || model.effort_limit()[index] < 1e4,
                "{}: {name} has no effort limit",
                entry.name
            );
            assert!(
                !driven || model.velocity_limit()[index] < 1e3,
                "{}: {name} has no speed limit",
                entry.name
            );
        }
    }
}

#[test]
fn catalogue_matches_its_generator() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("generate");
    let run = Command::new("python3").arg("-B").arg(script).arg("--check").output();
    let Ok(output) = run.inspect_err(|error| println!("skipped: python3 does not start: {error}")) else {
        return;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn shells_are_closed_and_small_and_move_nothing() {
    let mut dressed = 0;
    for entry in catalogue() {
        let seen = LoadOptions { shapes: ShapeSource::Visual, ..LoadOptions::default() };
        let seen = load_with(entry.name, Path::new("/nowhere"), &seen).unwrap();
        assert_eq!(seen.warnings, [], "{}", entry.name);
        let digest = load(entry.name, Path::new("/nowhere")).unwrap().dynamics_digest();
        assert_eq!(seen.dynamics_digest(), digest, "{}", entry.name);
        let bytes = entry.urdf.len() + entry.shells.iter().map(|(_, text)| text.len()).sum::<usize>();
        assert!(bytes <= 300_000, "{}: {bytes} bytes", entry.name);
        dressed += usize::from(!entry.shells.is_empty());
        for (name, text) in entry.shells {
            let mesh = TriangleMesh::from_obj(text).unwrap();
            assert!(mesh.volume() > 1e-8 && mesh.is_closed(), "{name}");
            assert!(entry.urdf.contains(name), "{name} is not used");
        }
    }
    assert_eq!(dressed, 4);
}

#[test]
fn cameras_see_collision_shapes_in_their_own_colours() {
    // Red channels of the shapes of a link, in their order.
    const OTHERS: [(&str, &[f64]); 6] = [
        ("panda_leftfinger", &[0.15]),
        ("front_left_thigh", &[0.15, 0.93]),
        ("front_left_shank", &[0.55, 0.15]),
        ("upper_arm_link", &[0.55, 0.93, 0.55]),
        ("forearm_link", &[0.93, 0.55]),
        ("left_forearm", &[0.15, 0.93]),
    ];
    for name in ["panda", "quadruped", "ur5e", "humanoid"] {
        let robot = load(name, Path::new(".")).unwrap();
        let colours = robot.link_colours(ShapeSource::Collision).unwrap();
        for (link, reds) in OTHERS.iter().filter(|(link, _)| robot.model.frame(link).is_ok()) {
            for (place, red) in reds.iter().enumerate() {
                assert_eq!(colours.of_shape(link, place, None)[0], *red, "{name}: {link} {place}");
            }
        }
    }
}

#[test]
fn sizes_and_masses_match_publications() {
    let mass = |name| load(name, Path::new(".")).unwrap().model.mass();
    // Grimminger 2020, Kashiri 2019, Tsagarakis 2013, Chevallereau 2003, O'Kelly 2020, Förster 2015, ROBOTIS
    for (name, kilograms, tolerance) in [
        ("quadruped", 2.5, 0.01),
        ("centaur", 93.0, 1e-9),
        ("humanoid", 31.0, 1e-9),
        ("planar-biped", 32.0, 1e-9),
        ("ackermann", 3.74, 1e-9),
        ("quadrotor", 0.028, 1e-9),
        ("differential-drive", 1.0, 1e-9),
    ] {
        assert_relative_eq!(mass(name), kilograms, max_relative = tolerance);
    }
    for (name, joints) in [
        ("quadruped", 12),
        ("hexapod", 18),
        ("biped", 12),
        ("centaur", 44),
        ("humanoid", 31),
        ("quadrotor", 0),
    ] {
        assert_eq!(load(name, Path::new(".")).unwrap().model.joint_count(), joints, "{name}");
    }
}

/// Standard Denavit-Hartenberg: the pose after a chain of (a, d, alpha) at these angles.
fn chain(rows: &[(f64, f64, f64)], q: &[f64]) -> Isometry3<f64> {
    rows.iter().zip(q).fold(Isometry3::identity(), |pose, (&(a, d, alpha), &theta)| {
        pose * Isometry3::rotation(Vector3::z() * theta)
            * Isometry3::translation(a, 0.0, d)
            * Isometry3::rotation(Vector3::x() * alpha)
    })
}

#[test]
fn ur5e_tool_pose_matches_its_dh_parameters() {
    const DH: [(f64, f64, f64); 6] = [
        (0.0, 0.1625, FRAC_PI_2),
        (-0.425, 0.0, 0.0),
        (-0.3922, 0.0, 0.0),
        (0.0, 0.1333, FRAC_PI_2),
        (0.0, 0.0997, -FRAC_PI_2),
        (0.0, 0.0996, 0.0),
    ];
    let model = load("ur5e", Path::new(".")).unwrap().model;
    let q = [0.4, -1.1, 1.7, -0.8, 0.9, 2.1];
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &q);
    let tool = kinematics.pose(&model, model.frame("tool0").unwrap());
    // the ROS base is rotated by half a turn relative to the controller's
    let expected = Isometry3::rotation(Vector3::z() * std::f64::consts::PI) * chain(&DH, &q);
    assert_relative_eq!(tool, expected, epsilon = 1e-12);
}

#[test]
fn iiwa_flange_pose_matches_its_datasheet() {
    // d and alpha of the specification's drawing: 0.36, 0.42, 0.4, 0.126 m.
    const DH: [(f64, f64, f64); 7] = [
        (0.0, 0.36, -FRAC_PI_2),
        (0.0, 0.0, FRAC_PI_2),
        (0.0, 0.42, FRAC_PI_2),
        (0.0, 0.0, -FRAC_PI_2),
        (0.0, 0.4, -FRAC_PI_2),
        (0.0, 0.0, FRAC_PI_2),
        (0.0, 0.126, 0.0),
    ];
    let model = load("iiwa14", Path::new(".")).unwrap().model;
    let q = [0.4, -1.1, 0.7, -0.8, 0.9, 1.1, -0.3];
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &q);
    let flange = kinematics.pose(&model, model.frame("iiwa_link_ee").unwrap());
    assert_relative_eq!(flange, chain(&DH, &q), epsilon = 1e-12);
}

#[test]
fn panda_hand_pose_matches_its_dh_parameters() {
    // Craig's convention: a, d, alpha of joints 1 to 7 and the flange, from Franka's documentation.
    const DH: [(f64, f64, f64); 8] = [
        (0.0, 0.333, 0.0),
        (0.0, 0.0, -FRAC_PI_2),
        (0.0, 0.316, FRAC_PI_2),
        (0.0825, 0.0, FRAC_PI_2),
        (-0.0825, 0.384, -FRAC_PI_2),
        (0.0, 0.0, FRAC_PI_2),
        (0.088, 0.0, FRAC_PI_2),
        (0.0, 0.107, 0.0),
    ];
    let panda = load("panda", Path::new(".")).unwrap();
    let q = [0.3, -0.5, 0.7, -1.9, 0.4, 1.8, -0.6, 0.02];
    let mut expected = Isometry3::identity();
    for (index, (a, d, alpha)) in DH.into_iter().enumerate() {
        let theta = if index < 7 { q[index] } else { 0.0 };
        expected *= Isometry3::rotation(Vector3::x() * alpha)
            * Isometry3::translation(a, 0.0, 0.0)
            * Isometry3::rotation(Vector3::z() * theta)
            * Isometry3::translation(0.0, 0.0, d);
    }
    let mut kinematics = Kinematics::new(&panda.model);
    kinematics.update(&panda.model, &q);
    let pose = |name| kinematics.pose(&panda.model, panda.model.frame(name).unwrap());
    assert_relative_eq!(pose("panda_link8"), expected, epsilon = 1e-12);
    let hand = expected * Isometry3::rotation(Vector3::z() * -FRAC_PI_2 / 2.0);
    assert_relative_eq!(
        pose("panda_hand_tcp"),
        hand * Isometry3::translation(0.0, 0.0, 0.1034),
        epsilon = 1e-12
    );
    // the fingers open in opposite directions by the coordinate they share
    let left = (hand.inverse() * pose("panda_leftfinger")).translation.vector;
    let right = (hand.inverse() * pose("panda_rightfinger")).translation.vector;
    assert_relative_eq!(left, Vector3::new(0.0, 0.02, 0.0584), epsilon = 1e-12);
    assert_relative_eq!(right, Vector3::new(0.0, -0.02, 0.0584), epsilon = 1e-12);
}

#[test]
fn panda_hand_points_down_in_front_at_home() {
    let panda = load("panda", Path::new(".")).unwrap();
    let home = panda.profile.as_ref().unwrap().home(&panda.model).unwrap();
    let frame = &panda.profile.as_ref().unwrap().end_effector("hand").unwrap().frame;
    let mut kinematics = Kinematics::new(&panda.model);
    kinematics.update(&panda.model, home.as_slice());
    let pose = kinematics.pose(&panda.model, panda.model.frame(frame).unwrap());
    assert_relative_eq!(pose * Vector3::z(), -Vector3::z(), epsilon = 1e-12);
    assert!(pose.translation.x > 0.3 && pose.translation.z > 0.4, "{pose}");
    assert_relative_eq!(pose.translation.y, 0.0, epsilon = 1e-12);
}

#[test]
fn pendulum_has_weight_and_inertia_of_a_uniform_rod() {
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let mut dynamics = Dynamics::new(&model);
    let mut tau = [0.0];
    let angle: f64 = 0.7;
    dynamics.gravity(&model, &[angle], Vector3::new(0.0, 0.0, -9.81), &mut tau);
    // m g l / 2 sin q
    assert_relative_eq!(tau[0], 9.81 * 0.5 * angle.sin(), epsilon = 1e-12);
    let mut mass = DMatrix::zeros(1, 1);
    dynamics.crba(&model, &[angle], &mut mass);
    // m l^2 / 3, and m r^2 / 4 for its thickness
    assert_relative_eq!(mass[(0, 0)], 1.0 / 3.0 + 0.02 * 0.02 / 4.0, epsilon = 1e-12);
}

#[test]
fn planar_arm_has_the_textbook_jacobian() {
    let model = load("planar-3r", Path::new(".")).unwrap().model;
    let q: [f64; 3] = [0.4, -0.9, 1.3];
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &q);
    let mut jacobian = DMatrix::zeros(6, 3);
    let tip = model.frame("tip").unwrap();
    kinematics.jacobian(&model, tip, Reference::LocalWorldAligned, &mut jacobian);
    let sums = [q[0], q[0] + q[1], q[0] + q[1] + q[2]];
    for column in 0..3 {
        let x: f64 = sums[column..].iter().map(|angle| -0.4 * angle.sin()).sum();
        let y: f64 = sums[column..].iter().map(|angle| 0.4 * angle.cos()).sum();
        let expected = [x, y, 0.0, 0.0, 0.0, 1.0];
        for (row, expected) in expected.into_iter().enumerate() {
            assert_relative_eq!(jacobian[(row, column)], expected, epsilon = 1e-12);
        }
    }
}
