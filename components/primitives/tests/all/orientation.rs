//! Properties of orientation primitives.

use motorium_primitives::dmp::{
    DmpModel, OrientationDmp, Regression, Settings, Variant, orientation_demonstration,
};
use motorium_robots::lie::so3;
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};

const VARIANTS: [Variant; 3] = [Variant::Classic, Variant::GoalSafe, Variant::QuinticGoal];

fn settings(variant: Variant) -> Settings {
    Settings { variant, ..Settings::default() }
}

fn bent(variant: Variant) -> DmpModel {
    let size = if variant == Variant::GoalSafe { 0.6 } else { 90.0 };
    let weights = DMatrix::from_fn(30, 3, |i, d| size * (1.3 * i as f64 + 2.0 * d as f64).sin());
    DmpModel::with_weights(settings(variant), weights, DVector::from_element(3, 1.0)).unwrap()
}

fn turn(x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
    so3::exp(&Vector3::new(x, y, z))
}

/// Angle between two orientations, accurate for small ones, rad.
fn angle(a: UnitQuaternion<f64>, b: UnitQuaternion<f64>) -> f64 {
    so3::log(&(a * b.inverse())).norm()
}

#[test]
fn unforced_rotation_follows_the_great_arc() {
    let mut dmp = OrientationDmp::new(DmpModel::new(3, Settings::default()).unwrap()).unwrap();
    let (start, goal) = (turn(0.3, 0.1, -0.4), turn(1.2, -1.0, 0.8));
    dmp.start(start, goal, 2.0).unwrap();
    for k in 1..=2000 {
        dmp.step(1e-3);
        let t = f64::from(k) / 2000.0;
        let share = t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t);
        assert!(angle(dmp.orientation(), start.slerp(&goal, share)) < 1e-12);
    }
    assert!(angle(dmp.orientation(), goal) < 1e-14);
    assert!(dmp.angular_velocity().norm() < 1e-10);
}

#[test]
fn angular_rates_match_orientation_differences() {
    for variant in VARIANTS {
        let mut dmp = OrientationDmp::new(bent(variant)).unwrap();
        let motion = [Vector3::new(0.5, -0.2, 0.8), Vector3::zeros()];
        dmp.start_moving(turn(0.3, 0.1, -0.4), motion, turn(1.2, -1.0, 1.5), 1.1).unwrap();
        assert!((dmp.angular_velocity() - motion[0]).norm() < 1e-12);
        let h = 1e-4;
        let mut states = Vec::new();
        for k in 0..14_000 {
            if k == 7000 {
                dmp.set_goal(turn(-0.8, 0.2, 0.3)).unwrap();
            }
            dmp.step(h);
            states.push((dmp.orientation(), dmp.angular_velocity(), dmp.angular_acceleration()));
        }
        for (k, three) in states.windows(3).enumerate() {
            let velocity = so3::log(&(three[2].0 * three[0].0.inverse())) / (2.0 * h);
            let jump = (6997..7003).contains(&k) && variant != Variant::QuinticGoal;
            assert!((velocity - three[1].1).norm() < if jump { 0.1 } else { 2e-4 }, "{variant:?} at {k}");
            let acceleration = (three[2].1 - three[0].1) / (2.0 * h);
            assert!(jump || (acceleration - three[1].2).norm() < 5e-2, "{variant:?} at {k}");
        }
    }
}

#[test]
fn quaternion_keeps_unit_length_and_sign() {
    for variant in VARIANTS {
        let mut dmp = OrientationDmp::new(bent(variant)).unwrap();
        let goals = [turn(2.5, 0.0, 0.0), turn(0.0, -2.8, 0.5), turn(0.0, 0.0, 3.1), turn(-1.0, -2.0, -1.0)];
        dmp.start(turn(-0.5, 0.4, 0.0), goals[3], 0.7).unwrap();
        let mut previous = dmp.orientation();
        for k in 0..20_000 {
            if k % 500 == 499 {
                dmp.set_goal(goals[k / 500 % 4]).unwrap();
                assert!((dmp.orientation().coords - previous.coords).norm() < 1e-12, "{variant:?}: a jump");
            }
            dmp.step(1e-3);
            let q = dmp.orientation();
            assert!((q.coords.norm() - 1.0).abs() < 1e-15);
            assert!((q.coords - previous.coords).norm() < 0.1, "{variant:?} at {k}");
            previous = q;
        }
    }
}

#[test]
fn changed_goal_keeps_angular_velocity_continuous() {
    for variant in VARIANTS {
        let mut dmp = OrientationDmp::new(bent(variant)).unwrap();
        dmp.start(turn(0.2, 0.0, 0.0), turn(0.0, 1.5, 0.0), 1.0).unwrap();
        (0..600).for_each(|_| dmp.step(1e-3));
        let (orientation, velocity, acceleration) =
            (dmp.orientation(), dmp.angular_velocity(), dmp.angular_acceleration());
        let goal = turn(-1.0, -0.4, 1.9);
        dmp.set_goal(goal).unwrap();
        assert!(angle(dmp.orientation(), orientation) < 1e-13);
        assert!((dmp.angular_velocity() - velocity).norm() < 1e-11);
        if variant == Variant::QuinticGoal {
            assert!((dmp.angular_acceleration() - acceleration).norm() < 1e-8);
        }
        (0..3000).for_each(|_| dmp.step(1e-3));
        assert!(angle(dmp.orientation(), goal) < 1e-3, "{variant:?}: {}", angle(dmp.orientation(), goal));
    }
}

#[test]
fn rotates_the_shorter_way_for_either_quaternion_sign() {
    let (start, goal) = (turn(0.0, 0.0, 0.5), turn(0.0, 0.0, 1.5));
    let negated = UnitQuaternion::new_unchecked(-goal.into_inner());
    let mut dmp = OrientationDmp::new(DmpModel::new(3, Settings::default()).unwrap()).unwrap();
    dmp.start(start, negated, 1.0).unwrap();
    (0..500).for_each(|_| dmp.step(1e-3));
    assert!(angle(dmp.orientation(), turn(0.0, 0.0, 1.0)) < 1e-12);
    assert!(dmp.orientation().coords.dot(&start.coords) > 0.0);
}

#[test]
fn half_turn_and_zero_turn_are_valid_movements() {
    let mut dmp = OrientationDmp::new(DmpModel::new(3, Settings::default()).unwrap()).unwrap();
    for goal in [turn(std::f64::consts::PI, 0.0, 0.0), UnitQuaternion::identity()] {
        dmp.start(UnitQuaternion::identity(), goal, 1.0).unwrap();
        (0..1000).for_each(|_| dmp.step(1e-3));
        assert!(angle(dmp.orientation(), goal) < 1e-12);
    }
}

#[test]
fn recorded_rotation_tolerates_sign_flips() {
    let path = |t: f64| {
        let rest = (1.0 - t).powi(3);
        turn(0.8 * t * rest, -0.5, 0.3) * turn(0.0, 0.9 * (1.0 - rest), 0.6 * (5.0 * t).sin() * rest)
    };
    let recorded: Vec<_> = (0..400)
        .map(|k| {
            let q = path(f64::from(k) / 399.0);
            if k % 3 == 0 { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q }
        })
        .collect();
    let demonstration = orientation_demonstration(1.5, &recorded).unwrap();
    for variant in VARIANTS {
        let model =
            DmpModel::fit(settings(variant), std::slice::from_ref(&demonstration), Regression::default())
                .unwrap();
        let mut dmp = OrientationDmp::new(model).unwrap();
        let h = 1e-6;
        let velocity = so3::log(&(path(h) * path(-h).inverse())) / (2.0 * h * 1.5);
        let acceleration = (so3::log(&(path(1e-4) * path(0.0).inverse()))
            + so3::log(&(path(-1e-4) * path(0.0).inverse())))
            / (1.5e-4_f64.powi(2));
        dmp.start_moving(path(0.0), [velocity, acceleration], path(1.0), 1.5).unwrap();
        for k in 1..=1500 {
            dmp.step(1e-3);
            let error = angle(dmp.orientation(), path(f64::from(k) / 1500.0));
            assert!(error < 3e-3, "{variant:?} at {k} ms: {error} rad");
        }
    }
}

#[test]
fn rotations_beyond_half_a_revolution_are_preserved() {
    let recorded: Vec<_> = (0..=200).map(|k| turn(0.0, 0.0, 5.0 * f64::from(k) / 200.0)).collect();
    let demonstration = orientation_demonstration(1.0, &recorded).unwrap();
    assert!((demonstration.start(2) - 5.0).abs() < 1e-12, "{}", demonstration.start(2));
}

#[test]
fn two_dimensional_model_is_rejected() {
    let error = OrientationDmp::new(DmpModel::new(2, Settings::default()).unwrap()).unwrap_err();
    assert_eq!(error.to_string(), "an orientation primitive has 2 entries, expected 3");
}
