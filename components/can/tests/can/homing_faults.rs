//! Homing that fails, is interrupted, or has to be repeated.

use motorium_can::Mark;
use motorium_can::adapter::{HomingFault, HomingState, OnTrip};

use super::homing::{AT_STOPS, BY_DRIVE, CYCLE_NS, Rig, STEP_NS, all};

#[test]
fn a_missing_mark_trips_and_homing_restarts_on_resume() {
    for case in &BY_DRIVE {
        let homing = case.homing.replace("by =", "timeout = \"3 s\", by =");
        let mut rig = Rig::new(case, &[&homing], OnTrip::Damp);
        rig.joints[0].stops = [-100.0, 100.0];
        rig.drives[0].set_mark(Mark::Missing);
        rig.run(2.5);
        assert_eq!(rig.state(0), HomingState::Running, "{}", case.name);
        rig.run(1.0);
        assert_eq!(rig.state(0), HomingState::Failed(HomingFault::TimedOut), "{}", case.name);
        assert!(rig.adapter.has_tripped(), "{}", case.name);
        assert!(!rig.drives[0].has_torque(), "{}: it is disabled", case.name);
        let given_up = rig.joints[0].position;
        rig.run(1.0);
        assert!(
            (rig.joints[0].position - given_up).abs() < 0.2,
            "{}: nothing starts automatically",
            case.name
        );
        rig.drives[0].set_mark(Mark::Works);
        rig.joints[0].position = 0.3;
        rig.joints[0].velocity = 0.0;
        rig.adapter.resume();
        assert_eq!(rig.run_until_over(0, 3.0), HomingState::Homed, "{}", case.name);
        rig.run(0.3);
        assert!(rig.is_right(), "{}", case.name);
    }
}

#[test]
fn a_stuck_switch_fails_the_homing() {
    for case in [&BY_DRIVE[0], &BY_DRIVE[2]] {
        let mut rig = Rig::one(case);
        rig.drives[0].set_mark(Mark::Stuck);
        assert_eq!(rig.run_until_over(0, 5.0), HomingState::Failed(HomingFault::Drive), "{}", case.name);
        rig.run(0.2);
        assert!(rig.adapter.has_tripped() && !rig.drives[0].has_torque(), "{}", case.name);
        assert!((rig.joints[0].position - 0.4).abs() < 0.05, "{}: {}", case.name, rig.joints[0].position);
    }
}

#[test]
fn a_drive_not_configured_for_homing_is_detected() {
    // the switch of this drive is pressed from the start, so its homing ends immediately, without being
    // observed running
    let mut rig = Rig::one(&BY_DRIVE[0]);
    let mut heartbeats = 0;
    for _ in 0..2000 {
        rig.run_cycle();
        // a power cut discards the request
        if rig.state(0) == HomingState::Running {
            heartbeats += 1;
            rig.drives[0].cut_power();
        }
        if rig.adapter.has_tripped() {
            break;
        }
    }
    assert!(heartbeats > 0);
    assert_eq!(rig.state(0), HomingState::Failed(HomingFault::NotBegun));
}

#[test]
fn false_stops_are_distinguished_from_real_ones() {
    let case = &AT_STOPS[0];
    let homing = case.homing.replace("by =", "timeout = \"3 s\", by =");
    // jammed in the middle of its range: at rest, and unable to back off
    let mut rig = Rig::new(case, &[&homing], OnTrip::Damp);
    rig.joints[0].is_jammed = true;
    assert_eq!(rig.run_until_over(0, 5.0), HomingState::Failed(HomingFault::Jammed));
    rig.run(0.1);
    assert!(!rig.drives[0].has_torque());
    // no obstacle
    let mut rig = Rig::new(case, &[&homing], OnTrip::Damp);
    rig.joints[0].stops = [-100.0, 100.0];
    assert_eq!(rig.run_until_over(0, 5.0), HomingState::Failed(HomingFault::TimedOut));
    // a temporary obstacle, such as a hand
    let mut rig = Rig::new(case, &[&homing], OnTrip::Damp);
    rig.joints[0].stops = [0.1, 1.5];
    for _ in 0..5000 {
        rig.run_cycle();
        if rig.joints[0].position > 0.12 && rig.joints[0].velocity > 0.1 {
            rig.joints[0].stops = [0.06, 1.5];
        }
    }
    let HomingState::Failed(HomingFault::Ambiguous(apart)) = rig.state(0) else {
        panic!("{:?}", rig.state(0))
    };
    assert!((apart - 0.04).abs() < 0.005, "{apart}");
    // a load that pulls the joint
    let mut rig = Rig::new(case, &[&homing], OnTrip::Damp);
    (rig.joints[0].load, rig.joints[0].stops) = (-10.0, [-100.0, 100.0]);
    assert!(
        matches!(rig.run_until_over(0, 5.0), HomingState::Failed(HomingFault::Runaway(_))),
        "{:?}",
        rig.state(0)
    );
}

#[test]
fn interrupted_homing_disables_the_drive_and_restarts() {
    for case in all() {
        let mut rig = Rig::one(&case);
        rig.run(0.3);
        assert_eq!(rig.state(0), HomingState::Running, "{}", case.name);
        rig.adapter.allow_homing(false);
        rig.run(0.1);
        assert_eq!(rig.state(0), HomingState::Waiting, "{}", case.name);
        assert!(!rig.drives[0].has_torque() && !rig.adapter.has_tripped(), "{}", case.name);
        rig.adapter.allow_homing(true);
        assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed, "{}", case.name);
        rig.run(0.3);
        assert!(rig.is_right(), "{}", case.name);
    }
}

#[test]
fn a_silent_drive_in_homing_trips_and_releases() {
    for case in all() {
        let mut rig = Rig::one(&case);
        rig.run(0.3);
        rig.silent = Some(0);
        rig.run(0.05);
        assert!(rig.adapter.has_tripped(), "{}", case.name);
        assert_eq!(rig.adapter.links()[0].counts().lost, 1, "{}", case.name);
        rig.silent = None;
        rig.run(0.3);
        assert!(!rig.adapter.links()[0].is_homed(), "{}", case.name);
        rig.adapter.resume();
        assert_eq!(rig.run_until_over(0, 10.0), HomingState::Homed, "{}", case.name);
    }
}

#[test]
fn the_watchdog_acts_when_the_adapter_ends_in_homing() {
    for case in all() {
        let mut rig = Rig::one(&case);
        rig.run(0.3);
        let killed_ns = rig.cycle * CYCLE_NS;
        assert!(rig.drives[0].has_torque(), "{}", case.name);
        for now_ns in (killed_ns..killed_ns + 45_000_000).step_by(STEP_NS as usize) {
            rig.step(now_ns + STEP_NS);
        }
        assert!(!rig.drives[0].has_torque() && rig.drives[0].watchdog_trips() == 1, "{}", case.name);
    }
}

#[test]
fn only_the_drive_that_lost_its_power_is_homed_again() {
    for (case, on_trip) in
        [OnTrip::Damp, OnTrip::Disable].into_iter().flat_map(|on| all().map(move |c| (c, on)))
    {
        let name = format!("{} {on_trip:?}", case.name);
        let mut rig = Rig::new(&case, &[case.homing, case.homing], on_trip);
        rig.run_until_over(0, 10.0);
        rig.run_until_over(1, 10.0);
        rig.run(0.3);
        assert!(rig.is_right(), "{name}");
        rig.drives[0].cut_power();
        rig.silent = Some(0);
        rig.run(0.05);
        rig.silent = None;
        rig.run(0.2);
        assert!(rig.adapter.has_tripped(), "{name}");
        assert_eq!(rig.state(1), HomingState::Homed, "{name}");
        assert_eq!(
            rig.adapter.links()[1].counts().faults,
            0,
            "{name}: it is disabled because of the other one"
        );
        assert_eq!(rig.drives[1].is_enabled(), on_trip == OnTrip::Damp, "{name}");
        let held = rig.joints[1].position;
        rig.adapter.resume();
        // a drive that does not report its state may also have lost power
        let tells = case.name != "mini cheetah";
        assert_eq!(rig.state(1) == HomingState::Homed, tells, "{name}");
        for joint in [0, 1] {
            assert_eq!(rig.run_until_over(joint, 10.0), HomingState::Homed, "{name}");
        }
        rig.run(0.3);
        assert!(rig.is_right(), "{name}");
        assert!(!tells || (rig.joints[1].position - held).abs() < 0.02, "{name}");
    }
}
