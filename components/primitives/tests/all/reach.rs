//! Properties of a reach through poses.

use std::time::Duration;

use motorium_primitives::dmp::{Demonstration, DmpModel, Regression, Settings, Variant};
use motorium_primitives::reach::{PathShape, PoseReach, ReachError, ReachPhase, Repeat, Segment, SteerError};
use motorium_robots::lie::so3;
use nalgebra::{DMatrix, Isometry3, Translation3, Vector3};

const TICK: Duration = Duration::from_millis(1);

fn pose(position: [f64; 3], turn: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(position), so3::exp(&Vector3::from(turn)))
}

fn home() -> Isometry3<f64> {
    pose([0.3, 0.0, 0.5], [3.1, 0.0, 0.2])
}

fn segment(goal: Isometry3<f64>, duration_ms: u64, dwell_ms: u64, shape: PathShape) -> Segment {
    let [duration, dwell] = [duration_ms, dwell_ms].map(Duration::from_millis);
    Segment { goal, duration, dwell, shape }
}

/// Returns three segments: straight, over an arc, and with a demonstrated shape.
fn tour() -> Vec<Segment> {
    let curve = DMatrix::from_fn(200, 3, |k, d| {
        let p = k as f64 / 199.0;
        let rest = (1.0 - p).powi(3) * p.powi(3);
        [0.3 * (1.0 - (1.0 - p).powi(3)), 2.0 * rest, 4.0 * rest * (7.0 * p).sin()][d]
    });
    let demonstration = Demonstration::from_positions(1.0, curve).unwrap();
    let learned = DmpModel::fit(Settings::default(), &[demonstration], Regression::default()).unwrap();
    vec![
        segment(pose([0.5, 0.2, 0.3], [3.0, 0.4, 0.0]), 1500, 200, PathShape::Straight),
        segment(
            pose([0.5, -0.3, 0.3], [2.8, 0.0, 1.0]),
            1200,
            500,
            PathShape::Arc { apex: Vector3::new(0.0, 0.0, 0.15) },
        ),
        segment(pose([0.4, 0.1, 0.6], [3.1, 0.0, -0.2]), 2000, 500, PathShape::Learned(Box::new(learned))),
    ]
}

fn position_error(reach: &PoseReach) -> f64 {
    (reach.pose().translation.vector - reach.goal().translation.vector).norm()
}

fn orientation_error(reach: &PoseReach) -> f64 {
    so3::log(&(reach.pose().rotation * reach.goal().rotation.inverse())).norm()
}

#[test]
fn every_goal_is_reached_on_time_and_held() {
    let mut reach = PoseReach::new(tour(), Repeat::Once).unwrap();
    reach.start(home()).unwrap();
    let mut at = 0;
    for (index, segment) in tour().into_iter().enumerate() {
        let arrival = at + segment.duration.as_millis();
        let departure = arrival + segment.dwell.as_millis();
        while at < departure {
            reach.step(TICK);
            at += 1;
            assert_eq!(reach.segment(), index);
            assert_eq!(reach.phase() == ReachPhase::Moving, at < arrival, "at {at} ms");
            if at >= arrival {
                assert!(position_error(&reach) < 1e-4, "{} m at goal {index}", position_error(&reach));
                assert!(orientation_error(&reach) < 1e-9);
            }
        }
        assert!(position_error(&reach) < 1e-5, "{} m after goal {index} was held", position_error(&reach));
        assert!(reach.twist().linear.norm() < 1e-3);
    }
    assert_eq!(reach.phase(), ReachPhase::Finished);
    (0..5000).for_each(|_| reach.step(TICK));
    assert!(position_error(&reach) < 1e-9 && reach.twist().linear.norm() < 1e-9);
    assert_eq!((reach.goals_set(), reach.phase()), (3, ReachPhase::Finished));
}

#[test]
fn motion_is_smooth_with_consistent_derivatives() {
    let mut reach = PoseReach::new(tour(), Repeat::Forever).unwrap();
    reach.start(home()).unwrap();
    let mut states = vec![(reach.pose(), reach.twist(), reach.acceleration())];
    assert!(states[0].1.linear.norm() == 0.0 && states[0].2.angular.norm() == 0.0);
    for k in 0..14_000 {
        match k {
            3000 => reach.set_speed(0.4).unwrap(),
            6000 => reach.set_speed(1.5).unwrap(),
            _ => {}
        }
        reach.step(TICK);
        states.push((reach.pose(), reach.twist(), reach.acceleration()));
    }
    let h = 2e-3;
    for (k, three) in states.windows(3).enumerate() {
        let [before, here, after] = three else { unreachable!("windows of three") };
        let velocity = (after.0.translation.vector - before.0.translation.vector) / h;
        assert!((velocity - here.1.linear).norm() < 2e-3, "at {k} ms: {velocity} {}", here.1.linear);
        let angular = so3::log(&(after.0.rotation * before.0.rotation.inverse())) / h;
        assert!((angular - here.1.angular).norm() < 2e-3, "at {k} ms");
        // where the speed starts or ends to change, its slope is discontinuous
        if (2999..3200).contains(&k) || (5999..6300).contains(&k) {
            continue;
        }
        let acceleration = (after.1.linear - before.1.linear) / h;
        assert!((acceleration - here.2.linear).norm() < 0.1, "at {k} ms: {acceleration} {}", here.2.linear);
        let angular = (after.1.angular - before.1.angular) / h;
        assert!((angular - here.2.angular).norm() < 0.1, "at {k} ms");
    }
}

#[test]
fn straight_reach_has_minimum_jerk_peak_speed() {
    let goal = pose([0.3, 0.4, 0.5], [3.1, 0.0, 0.2]);
    let mut reach = PoseReach::new(vec![segment(goal, 2000, 0, PathShape::Straight)], Repeat::Once).unwrap();
    reach.start(home()).unwrap();
    let mut peak = 0.0_f64;
    for _ in 0..2000 {
        reach.step(TICK);
        peak = peak.max(reach.twist().linear.norm());
    }
    assert!((peak - 1.875 * 0.4 / 2.0).abs() < 1e-6, "{peak} m/s");
}

#[test]
fn step_width_does_not_change_the_schedule() {
    let ends = [1, 3, 7, 40, 1000].map(|milliseconds| {
        let mut reach = PoseReach::new(tour(), Repeat::Forever).unwrap();
        reach.start(home()).unwrap();
        let steps = 21_000 / milliseconds;
        (0..steps).for_each(|_| reach.step(Duration::from_millis(milliseconds)));
        (0..21_000 - steps * milliseconds).for_each(|_| reach.step(TICK));
        reach
    });
    for end in &ends {
        assert_eq!(
            (end.segment(), end.phase(), end.goals_set()),
            (ends[0].segment(), ends[0].phase(), ends[0].goals_set())
        );
        // only the error of the wide steps in the forcing terms remains
        let distance = (end.pose().translation.vector - ends[0].pose().translation.vector).norm();
        assert!(distance < 5e-3, "{distance} m");
    }
}

#[test]
fn speed_factor_stretches_time_and_zero_stops() {
    let mut reach = PoseReach::new(tour(), Repeat::Once).unwrap();
    reach.set_speed(0.5).unwrap();
    reach.start(home()).unwrap();
    (0..2999).for_each(|_| reach.step(TICK));
    assert_eq!(reach.phase(), ReachPhase::Moving);
    reach.step(TICK);
    assert_eq!(reach.phase(), ReachPhase::Dwelling);
    assert!(position_error(&reach) < 1e-9);

    (0..1000).for_each(|_| reach.step(TICK));
    assert!(reach.twist().linear.norm() > 0.05);
    reach.set_speed(0.0).unwrap();
    (0..200).for_each(|_| reach.step(TICK));
    let stopped = reach.pose();
    assert_eq!(reach.twist().linear.norm(), 0.0);
    (0..1000).for_each(|_| reach.step(TICK));
    assert_eq!(reach.pose(), stopped);
    assert_eq!(reach.set_speed(-1.0).unwrap_err(), SteerError::Speed { found: -1.0 });
}

#[test]
fn redirected_goal_is_reached_without_a_jump() {
    for after in [10, 700, 1499, 1600] {
        let mut reach = PoseReach::new(tour(), Repeat::Once).unwrap();
        reach.start(home()).unwrap();
        (0..after).for_each(|_| reach.step(TICK));
        let before = (reach.pose(), reach.twist(), reach.acceleration());
        let goal = pose([0.2, 0.4, 0.4], [2.0, 1.0, 0.0]);
        reach.redirect(goal).unwrap();
        assert!((reach.pose().translation.vector - before.0.translation.vector).norm() < 1e-12);
        assert!((reach.pose().rotation.coords - before.0.rotation.coords).norm() < 1e-12);
        assert!((reach.twist().linear - before.1.linear).norm() < 1e-10);
        assert!((reach.twist().angular - before.1.angular).norm() < 1e-10);
        assert!((reach.acceleration().angular - before.2.angular).norm() < 1e-7);
        assert_eq!((reach.goals_set(), reach.goal()), (2, goal));
        let steps = (0..10_000).take_while(|_| {
            reach.step(TICK);
            reach.phase() == ReachPhase::Moving
        });
        assert!(steps.count() <= 1500);
        assert!(position_error(&reach) < 1e-9 && orientation_error(&reach) < 1e-9);
        // the sequence continues
        (0..201).for_each(|_| reach.step(TICK));
        assert_eq!((reach.segment(), reach.phase()), (1, ReachPhase::Moving));
    }
}

#[test]
fn replaced_goals_and_later_first_segments_are_followed() {
    let mut reach = PoseReach::new(tour(), Repeat::Once).unwrap();
    let goal = pose([0.1, 0.2, 0.7], [0.3, 0.0, 0.0]);
    reach.set_goal(2, goal).unwrap();
    reach.start_with(2, home()).unwrap();
    assert_eq!((reach.segment(), reach.goal()), (2, goal));
    (0..2500).for_each(|_| reach.step(TICK));
    assert_eq!(reach.phase(), ReachPhase::Finished);
    assert!(position_error(&reach) < 1e-5 && orientation_error(&reach) < 1e-9);
    let error = reach.set_goal(3, goal).unwrap_err();
    assert_eq!(error.to_string(), "there is no segment 3, expected an index below 3");
}

#[test]
fn reach_waits_for_its_start() {
    let mut reach = PoseReach::new(tour(), Repeat::Once).unwrap();
    reach.step(TICK);
    assert_eq!((reach.phase(), reach.goals_set()), (ReachPhase::Waiting, 0));
    assert_eq!(reach.redirect(home()).unwrap_err(), SteerError::NotStarted);
    let error = reach.start(pose([f64::NAN, 0.0, 0.0], [0.0; 3])).unwrap_err().to_string();
    assert_eq!(error, "the pose to start from contains NaN, expected only finite numbers");
    assert_eq!(reach.phase(), ReachPhase::Waiting);
}

#[test]
fn invalid_sequence_is_rejected_with_its_segment() {
    let refuse = |segments| PoseReach::new(segments, Repeat::Once).unwrap_err();
    assert_eq!(refuse(vec![]), ReachError::NoSegments);
    let fine = segment(home(), 1000, 0, PathShape::Straight);
    let hasty = segment(home(), 0, 0, PathShape::Straight);
    let error = refuse(vec![fine.clone(), hasty]).to_string();
    assert_eq!(error, "goal 1 has a duration of 0 s, expected at least 0.001 s");
    let nowhere = segment(pose([0.0, f64::INFINITY, 0.0], [0.0; 3]), 1000, 0, PathShape::Straight);
    assert_eq!(refuse(vec![nowhere]), ReachError::Goal { segment: 0 });
    let classic = DmpModel::new(3, Settings { variant: Variant::Classic, ..Settings::default() }).unwrap();
    let error =
        refuse(vec![fine, segment(home(), 1000, 0, PathShape::Learned(Box::new(classic)))]).to_string();
    assert!(error.starts_with("the path to goal 1: the learned shape is a Classic primitive"), "{error}");
}
