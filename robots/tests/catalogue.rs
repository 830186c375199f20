//! Every robot of the catalogue is sound, and the known ones move as the books say.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{Dynamics, Kinematics, Profile, ProfileError, Reference, catalogue, load};
use nalgebra::{DMatrix, Isometry3, Vector3};

#[test]
fn every_entry_loads_without_a_warning_and_its_profile_fits() {
    assert!(catalogue().is_sorted_by_key(|entry| entry.name));
    for entry in catalogue() {
        let robot = load(entry.name, Path::new("/nowhere")).unwrap();
        assert_eq!(robot.warnings, [], "{}", entry.name);
        assert_eq!(robot.model.name(), entry.name);
        let profile = robot.profile.unwrap();
        profile.check(&robot.model).unwrap();
        assert!(!profile.sources.is_empty() && !profile.title.is_empty(), "{}", entry.name);
        for name in profile.poses.keys() {
            let pose = profile.pose(&robot.model, name).unwrap();
            for (index, q) in pose.iter().enumerate() {
                let range = robot.model.lower()[index]..=robot.model.upper()[index];
                assert!(range.contains(q), "{}: {name} leaves the limits of joint {index}", entry.name);
            }
        }
    }
}

#[test]
fn default_gains_damp_every_joint_near_critically_at_home() {
    for entry in catalogue() {
        let model = load(entry.name, Path::new(".")).unwrap().model;
        let home = entry.profile.home(&model).unwrap();
        let gains = entry.profile.gains(&model).unwrap();
        let mut mass = DMatrix::zeros(model.nv(), model.nv());
        Dynamics::new(&model).crba(&model, home.as_slice(), &mut mass);
        for (index, joint) in model.joint_names().iter().enumerate() {
            let ratio = gains.kd[index] / (2.0 * (gains.kp[index] * mass[(index, index)]).sqrt());
            assert!((0.6..2.5).contains(&ratio), "{} {joint}: damping ratio {ratio:.2}", entry.name);
        }
    }
}

#[test]
fn the_pandas_hand_is_where_its_dh_parameters_put_it() {
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
    // The fingers open both ways by the one coordinate they share.
    let left = (hand.inverse() * pose("panda_leftfinger")).translation.vector;
    let right = (hand.inverse() * pose("panda_rightfinger")).translation.vector;
    assert_relative_eq!(left, Vector3::new(0.0, 0.02, 0.0584), epsilon = 1e-12);
    assert_relative_eq!(right, Vector3::new(0.0, -0.02, 0.0584), epsilon = 1e-12);
}

#[test]
fn at_home_the_pandas_hand_points_down_in_front_of_it() {
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
fn the_pendulum_weighs_and_resists_as_a_uniform_rod() {
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
fn the_planar_arm_has_the_textbook_jacobian() {
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

#[test]
fn a_profile_with_a_fault_is_refused() {
    let good = catalogue().iter().find(|entry| entry.name == "pendulum").unwrap();
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let text = "title = \"t\"\nsources = []\njoints = [\"hinge\"]\nhome = \"a\"\n[poses]\na = [0.0]\n";
    let profile = Profile::parse(text).unwrap();
    assert!(matches!(profile.gains(&model), Err(ProfileError::NoGains)));
    assert!(matches!(Profile::parse(&text.replace("[0.0]", "[0.0, 1.0]")), Err(ProfileError::Length { .. })));
    assert!(matches!(Profile::parse(&text.replace("home", "hom")), Err(ProfileError::Toml(_))));
    assert!(matches!(Profile::parse(&text.replace("\"a\"", "\"b\"")), Err(ProfileError::UnknownPose { .. })));
    assert_eq!(
        good.profile.pose(&model, "hangin").unwrap_err().to_string(),
        "no pose is named \"hangin\" (did you mean \"hanging\"?)"
    );
    let panda = load("panda", Path::new(".")).unwrap().model;
    assert!(matches!(good.profile.check(&panda), Err(ProfileError::UnknownJoint { .. })));
    assert!(matches!(good.profile.home(&panda), Err(ProfileError::MissingJoint { .. })));
}
