//! The way back from a safe state to the commands, and latches.

use super::*;
use crate::region::GateState;

/// Largest velocity and acceleration of each setpoint while the arm goes from its safe state to a command far away, and
/// the number of steps that took.
fn return_to(arm: &mut Arm, goal: &JointCommand) -> ([f64; 2], [f64; 2], usize) {
    let (mut fastest, mut hardest) = ([0.0_f64; 2], [0.0_f64; 2]);
    let mut before: Vec<JointSetpoint> = arm.gate.setpoints().to_vec();
    for step in 0..10_000 {
        let verdict = arm.offer(goal);
        for (i, setpoint) in arm.gate.setpoints().iter().enumerate() {
            fastest[i] = fastest[i].max((setpoint.position - before[i].position).abs() / DT);
            hardest[i] = hardest[i].max((setpoint.velocity - before[i].velocity).abs() / DT);
        }
        before = arm.gate.setpoints().to_vec();
        if verdict == Verdict::Applied {
            return (fastest, hardest, step);
        }
    }
    panic!("the setpoint is never met");
}

#[test]
fn after_an_outage_a_far_setpoint_is_approached_at_half_the_limits_and_then_followed() {
    let mut arm = Arm::following();
    arm.silence();
    let goal = command([-1.5, 1.0], [0.0; 2]);
    let (fastest, hardest, steps) = return_to(&mut arm, &goal);
    assert!(fastest[0] <= 1.0 + 1e-9 && fastest[1] <= 1.0 + 1e-9, "{fastest:?}");
    assert!(hardest[0] <= 3.75 + 1e-9 && hardest[1] <= 6.25 + 1e-9, "{hardest:?}");
    assert!((2_000..4_000).contains(&steps), "2 rad at 1 rad/s took {steps} ms");
    assert_eq!(arm.gate.state(), GateState::Following);
    let there = arm.gate.setpoints()[0].position;
    assert!((there + 1.5).abs() < 3e-3, "{there}");
    assert!(arm.book.limited.borrow().is_empty(), "an approach is no fault of the command");
}

#[test]
fn a_setpoint_within_reach_of_the_held_pose_is_followed_at_once() {
    let mut arm = Arm::following();
    arm.silence();
    assert_eq!(arm.offer(&command([0.500_05, -0.5], [0.001, 0.0])), Verdict::Applied);
}

#[test]
fn a_setpoint_that_moves_on_is_met_while_it_moves() {
    let mut arm = Arm::following();
    arm.silence();
    let mut steps = 0;
    while arm.offer(&command([0.6 + 0.2e-3 * f64::from(steps), -0.5], [0.2, 0.0])) != Verdict::Applied {
        steps += 1;
        assert!(steps < 3_000, "the moving setpoint is never met");
    }
    let velocity = arm.gate.setpoints()[0].velocity;
    assert!((velocity - 0.2).abs() < 0.05, "{velocity}");
}

#[test]
fn at_once_follows_the_first_fresh_command_however_far_it_is() {
    let mut arm = arm_with(SafeState::Hold, LimitPolicy::Clamp, ResumeRule::AtOnce);
    arm.silence();
    assert_eq!(arm.offer(&command([-1.5, 1.0], [0.0; 2])), Verdict::Applied);
    assert_eq!(arm.gate.setpoints()[0].position, -1.5);
}

#[test]
fn a_latch_holds_until_it_is_released_and_the_start_of_a_run_is_no_latch() {
    let mut arm = arm_with(SafeState::Hold, LimitPolicy::Clamp, ResumeRule::Latch);
    arm.silence();
    let fresh = command([0.5, -0.5], [0.0; 2]);
    assert_eq!(arm.offer(&fresh), Verdict::Applied, "before the first command nothing failed");
    arm.silence();
    for _ in 0..10 {
        assert_eq!(arm.offer(&fresh), Verdict::Safe { state: SafeState::Hold, entered: false });
    }
    assert!(arm.gate.is_latched());
    arm.gate.release();
    assert_eq!(arm.offer(&fresh), Verdict::Applied);
}
