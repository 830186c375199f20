//! Inverse kinematics finds reachable poses and reports why others are not found.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{IkOptions, InverseKinematics, Kinematics, Model, load};
use nalgebra::Isometry3;

fn pose(model: &Model, q: &[f64], frame: &str) -> Isometry3<f64> {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q);
    kinematics.pose(model, model.frame(frame).unwrap())
}

#[test]
fn nearly_all_reachable_panda_poses_are_solved_within_limits() {
    let panda = load("panda", Path::new(".")).unwrap();
    let model = &panda.model;
    let frame = model.frame("panda_hand_tcp").unwrap();
    let home = panda.profile.as_ref().unwrap().home(model).unwrap();
    let mut ik = InverseKinematics::new(model);
    let mut found = 0;
    for case in 0..500 {
        // spread over the inner four fifths of every joint's range
        let there: Vec<f64> = (0..model.nq())
            .map(|i| {
                let share = 0.1 + 0.8 * (f64::from(case) * (i as f64 + 1.3).ln()).fract().abs();
                model.lower()[i] + share * (model.upper()[i] - model.lower()[i])
            })
            .collect();
        let target = pose(model, &there, "panda_hand_tcp");
        let mut q = home.clone();
        if ik.solve(model, frame, &target, &IkOptions::default(), q.as_mut_slice()).is_err() {
            continue;
        }
        found += 1;
        assert_relative_eq!(pose(model, q.as_slice(), "panda_hand_tcp"), target, epsilon = 1e-6);
        for (i, q) in q.iter().enumerate() {
            assert!((model.lower()[i]..=model.upper()[i]).contains(q));
        }
    }
    println!("{found} of 500");
    assert!(found >= 490, "{found} of 500");
}

#[test]
fn unreachable_target_fails_with_its_distance() {
    let model = load("planar-3r", Path::new(".")).unwrap().model;
    let frame = model.frame("tip").unwrap();
    let options = IkOptions { rotation_tolerance: f64::INFINITY, ..IkOptions::default() };
    let mut q = [0.3, 0.4, -0.2];
    // The arm is 1.2 m long.
    let failure = InverseKinematics::new(&model)
        .solve(&model, frame, &Isometry3::translation(1.5, 0.0, 0.0), &options, &mut q)
        .unwrap_err();
    assert_relative_eq!(failure.position_error, 0.3, epsilon = 1e-3);
    assert!(failure.singular, "{failure}");
    assert!(failure.to_string().contains("out of reach"), "{failure}");
    assert_relative_eq!(pose(&model, &q, "tip").translation.x, 1.2, epsilon = 1e-3);
}

#[test]
fn remaining_freedom_approaches_the_posture() {
    let panda = load("panda", Path::new(".")).unwrap();
    let model = &panda.model;
    let home = panda.profile.as_ref().unwrap().home(model).unwrap();
    let target = Isometry3::translation(0.05, 0.0, 0.0) * pose(model, home.as_slice(), "panda_hand_tcp");
    let frame = model.frame("panda_hand_tcp").unwrap();
    let mut q = home.clone();
    InverseKinematics::new(model)
        .solve(model, frame, &target, &IkOptions::default(), q.as_mut_slice())
        .unwrap();
    // fingers do not move the hand, so they stay in place
    assert_relative_eq!(q[7], home[7], epsilon = 1e-12);
    assert!((&q - &home).amax() < 0.3, "{q}");
}
