//! Homing with doubtful readings: the adapter does not move the joint, and restarts the homing.

use motorium_can::adapter::{HomingFault, HomingState, OnTrip, Phase};
use motorium_drive::JointSetpoint;

use super::homing::{AT_STOPS, BY_DRIVE, CIA402, CYCLE_NS, Case, Rig};

/// Homing at a stop, with this order.
fn at_stop(order: u8) -> String {
    format!("homing = {{ by = \"stop\", velocity = -0.5, effort = 1.2, position = -0.8, order = {order} }}")
}

#[test]
fn a_joint_balanced_by_its_weight_is_not_at_its_stop() {
    let case = &AT_STOPS[0];
    // the spring balances the whole effort on the way, at the same position each time
    let mut rig = Rig::one(case);
    rig.joints[0].spring = 4.0;
    assert_eq!(rig.run_until_over(0, 15.0), HomingState::Failed(HomingFault::Balanced));
    assert!(rig.joints[0].position > -0.1, "{}", rig.joints[0].position);
    rig.run(0.1);
    assert!(rig.adapter.has_tripped() && !rig.drives[0].has_torque());
    // at the stop itself, with loads below and above half of the effort
    for (load, outcome) in [(0.4, HomingState::Homed), (0.9, HomingState::Failed(HomingFault::Balanced))] {
        let mut rig = Rig::one(case);
        (rig.joints[0].load, rig.joints[0].position) = (load, -0.6);
        assert_eq!(rig.run_until_over(0, 15.0), outcome, "{load}");
    }
}

#[test]
fn the_failure_of_one_joint_does_not_affect_another() {
    let mut rig = Rig::new(&AT_STOPS[0], &[&at_stop(0), &at_stop(0)], OnTrip::Damp);
    rig.joints[0].is_jammed = true;
    assert_eq!(rig.run_until_over(0, 5.0), HomingState::Failed(HomingFault::Jammed));
    rig.run(0.1);
    assert_eq!(rig.state(1), HomingState::Waiting, "it was moving");
    assert_eq!(rig.adapter.links()[1].counts().faults, 0);
    // an external trip is not a homing failure
    for case in &AT_STOPS {
        let mut rig = Rig::one(case);
        rig.run(0.5);
        assert_eq!(rig.state(0), HomingState::Running, "{}", case.name);
        rig.adapter.trip();
        rig.run(0.2);
        assert_eq!(rig.state(0), HomingState::Waiting, "{}", case.name);
        assert_eq!(rig.adapter.links()[0].counts().faults, 0, "{}", case.name);
        assert!(!rig.drives[0].has_torque(), "{}", case.name);
    }
}

#[test]
fn held_joints_follow_setpoints_while_homing_is_paused() {
    let mut rig = Rig::new(&AT_STOPS[0], &[&at_stop(0), &at_stop(1)], OnTrip::Damp);
    assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed);
    rig.run(0.3);
    assert_eq!(rig.state(1), HomingState::Running);
    rig.adapter.allow_homing(false);
    assert_eq!(rig.state(1), HomingState::Waiting, "immediately, before another frame is sent");
    rig.adapter.set(0, JointSetpoint { kd: 0.5, ..JointSetpoint::default() });
    rig.joints[0].load = 0.3;
    rig.run(1.0);
    let sunk = rig.joints[0].position;
    assert!(sunk > -0.7 + 0.2, "it is damped, and not held: {sunk}");
    rig.joints[0].load = 0.0;
    rig.adapter.allow_homing(true);
    rig.run(0.5);
    assert!((rig.joints[0].position - sunk).abs() < 0.03, "{sunk} {}", rig.joints[0].position);
    assert_eq!(rig.run_until_over(1, 10.0), HomingState::Homed);
    rig.run(0.3);
    assert!(rig.is_right());
}

#[test]
fn a_drive_without_power_before_enabling_is_set_up_again() {
    let limited = "protocol = \"damiao\"\ncurrent_limit = 10.0\ntorque_constant = 0.5\nfull_current = 40.0";
    let damiao = Case { name: "damiao", bus: "", drive: limited, homing: "" };
    let cia402 = Case { name: "cia402", bus: "", drive: CIA402, homing: "" };
    // a drive that reports its restart does not have to be silent before
    for (case, homing, silent_s) in [
        (&damiao, at_stop(0), 0.02),
        (&cia402, BY_DRIVE[2].homing.into(), 0.0),
        (&cia402, BY_DRIVE[2].homing.into(), 0.02),
    ] {
        let mut rig = Rig::new(case, &[&homing, ""], OnTrip::Damp);
        rig.run(0.4);
        assert_eq!((rig.state(0), rig.adapter.links()[1].phase()), (HomingState::Running, Phase::Disabled));
        rig.drives[1].cut_power();
        rig.silent = (silent_s > 0.0).then_some(1);
        rig.run(silent_s);
        rig.silent = None;
        let mut was_checked = false;
        for _ in 0..10 {
            rig.run_cycle();
            was_checked |= matches!(rig.adapter.links()[1].phase(), Phase::Checking(_));
        }
        assert!(was_checked, "{}", case.name);
        assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed, "{}", case.name);
        rig.run(0.3);
        let (link, joint) = (&rig.adapter.links()[1], rig.joints[1].position);
        assert!(
            rig.is_right() && !rig.adapter.has_tripped(),
            "{}: {:?} {:?} {joint} {} {}",
            case.name,
            link.phase(),
            link.state(),
            rig.adapter.links()[0].state().0,
            rig.joints[0].position
        );
    }
}

#[test]
fn a_drive_that_restarts_is_checked_from_the_beginning() {
    let case = Case { name: "cia402", bus: "", drive: CIA402, homing: "" };
    let mut rig = Rig::new(&case, &[""], OnTrip::Damp);
    while rig.adapter.links()[0].phase() != Phase::Checking(9) {
        rig.run_cycle();
        assert!(rig.cycle < 50);
    }
    rig.drives[0].cut_power();
    rig.run_cycle();
    assert!(
        matches!(rig.adapter.links()[0].phase(), Phase::Checking(0..=1)),
        "{:?}",
        rig.adapter.links()[0].phase()
    );
    rig.run(0.5);
    assert!(rig.is_right() && rig.drives[0].is_enabled(), "{:?}", rig.adapter.links()[0].phase());
}

#[test]
fn a_drive_that_restarts_while_homing_trips_immediately() {
    let mut rig = Rig::one(&BY_DRIVE[2]);
    rig.run(0.4);
    assert_eq!(rig.state(0), HomingState::Running);
    rig.drives[0].cut_power();
    rig.run(2.0 * CYCLE_NS as f64 * 1e-9);
    assert_eq!(rig.state(0), HomingState::Failed(HomingFault::LetGo));
    assert!(rig.adapter.has_tripped());
    rig.run(0.1);
    rig.adapter.resume();
    assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed);
}

#[test]
fn homing_is_forgotten_after_a_silence_of_late_answers() {
    let mut rig = Rig::one(&AT_STOPS[0]);
    assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed);
    rig.run(0.3);
    rig.late_ns = CYCLE_NS;
    while !rig.adapter.has_tripped() {
        rig.run_cycle();
        assert!(rig.adapter.has_tripped() || rig.adapter.links()[0].silent() < 3, "its answers seem timely");
    }
    rig.drives[0].cut_power();
    rig.silent = Some(0);
    rig.run(0.05);
    assert_eq!(rig.state(0), HomingState::Waiting);
}
