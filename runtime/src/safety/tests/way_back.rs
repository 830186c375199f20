//! Recovery from a safe state to the commands, and latches.

use super::*;
use crate::region::GateState;

/// Returns the largest velocity and acceleration of each setpoint during the recovery to a far command, and
/// the number of steps.
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
fn far_setpoint_is_approached_within_the_limits() {
    let mut arm = Arm::following();
    arm.silence();
    let goal = command([-1.5, 1.0], [0.0; 2]);
    for _ in 0..600 {
        let before = arm.gate.setpoints().to_vec();
        assert_eq!(arm.offer(&goal), Verdict::Resuming);
        for (now, before) in arm.gate.setpoints().iter().zip(before) {
            assert!((now.position - before.position).abs() / DT <= 1.0 + 1e-9, "half of the limit at first");
        }
    }
    let (fastest, hardest, steps) = return_to(&mut arm, &goal);
    assert!(fastest[0] <= 2.0 + 1e-9 && fastest[1] <= 2.0 + 1e-9, "{fastest:?}");
    assert!(hardest[0] <= 7.5 + 1e-9 && hardest[1] <= 12.5 + 1e-9, "{hardest:?}");
    assert!((500..2_500).contains(&steps), "{steps} ms for the rest of 2 rad");
    assert_eq!(arm.gate.state(), GateState::Following);
    let there = arm.gate.setpoints()[0].position;
    assert!((there + 1.5).abs() < 3e-3, "{there}");
    assert!(arm.book.limited.borrow().is_empty(), "the command is not at fault for an approach");
}

#[test]
fn setpoint_near_the_held_pose_is_followed_immediately() {
    let mut arm = Arm::following();
    arm.silence();
    assert_eq!(arm.offer(&command([0.500_05, -0.5], [0.001, 0.0])), Verdict::Applied);
}

#[test]
fn moving_setpoint_is_met_while_it_moves() {
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
fn offset_fades_until_commands_are_forwarded_exactly() {
    let mut arm = Arm::following();
    arm.silence();
    let mut before = arm.gate.setpoints()[0];
    let mut goal = command([0.5, -0.5], [0.0; 2]);
    let mut fading = 0;
    for step in 0..3_000 {
        // a controller that reacts to noise: its setpoint steps by 1 mrad and 20 mrad/s each time
        let jump = if step % 2 == 0 { 1.0 } else { -1.0 };
        goal.position_mut()[0] = 0.6 + 0.5e-3 * jump;
        goal.velocity_mut()[0] = 0.01 * jump;
        goal.effort_mut()[0] = 22.0;
        if step > 2_000 {
            goal.position_mut()[0] = 0.6;
            goal.velocity_mut()[0] = 0.0;
        }
        let verdict = arm.offer(&goal);
        let now = arm.gate.setpoints()[0];
        if verdict == Verdict::Applied {
            fading += usize::from(now.position != goal.position()[0]);
        } else {
            assert_eq!(fading, 0);
            assert!((now.velocity - before.velocity).abs() / DT <= 3.75 + 1e-9);
        }
        before = now;
    }
    assert!((50..=100).contains(&fading), "{fading} ms");
    assert_eq!((before.position, before.velocity, before.effort), (0.6, 0.0, 22.0));
    assert!(arm.book.limited.borrow().iter().all(|(_, kind)| *kind == LimitKind::Acceleration));
}

#[test]
fn end_of_recovery_refuses_nothing_with_limits_refuse() {
    let mut arm = arm_with(SafeState::Hold, LimitPolicy::Refuse, ResumeRule::Near);
    arm.silence();
    // feed-forward efforts and a pose that differ from the held ones
    let mut goal = command([0.7, -0.6], [0.0; 2]);
    goal.effort_mut().fill(0.0);
    for _ in 0..3_000 {
        let verdict = arm.offer(&goal);
        assert!(!matches!(verdict, Verdict::Safe { .. }), "{:?}", arm.book.refused.borrow());
    }
    assert_eq!(arm.gate.state(), GateState::Following);
    let setpoint = arm.gate.setpoints()[0];
    assert_eq!((setpoint.position, setpoint.effort), (0.7, 0.0));
    assert!(arm.book.refused.borrow().is_empty() && arm.book.limited.borrow().is_empty());
}

#[test]
fn recovery_does_not_oscillate_at_any_actuator_period() {
    for period_ms in [0.5, 1.0, 4.0, 10.0, 25.0, 50.0] {
        let mut arm = Arm::following();
        arm.silence();
        let (goal, dt) = (command([-0.4, -0.2], [0.0; 2]), period_ms * 1e-3);
        let steps = (8.0 / dt) as usize;
        for _ in 0..steps {
            let mut gravity = |effort: &mut [f64]| effort.copy_from_slice(&GRAVITY);
            let measured =
                Measured { position: &arm.position, velocity: &arm.velocity, gravity: &mut gravity };
            arm.gate.offer(Offer { command: &goal, is_new: true, ahead: dt }, measured, dt, &arm.book);
            arm.move_on();
            let position = arm.gate.setpoints()[0].position;
            assert!(position > -0.42, "{period_ms} ms: it overshoots to {position}");
        }
        assert_eq!(arm.gate.state(), GateState::Following, "{period_ms} ms");
        assert_eq!(arm.gate.setpoints()[0].position, -0.4, "{period_ms} ms");
    }
}

#[test]
fn at_once_follows_the_first_fresh_command_at_any_distance() {
    let mut arm = arm_with(SafeState::Hold, LimitPolicy::Clamp, ResumeRule::AtOnce);
    arm.silence();
    assert_eq!(arm.offer(&command([-1.5, 1.0], [0.0; 2])), Verdict::Applied);
    assert_eq!(arm.gate.setpoints()[0].position, -1.5);
}

#[test]
fn latch_stays_until_it_is_released() {
    let mut arm = arm_with(SafeState::Hold, LimitPolicy::Clamp, ResumeRule::Latch);
    arm.silence();
    let fresh = command([0.5, -0.5], [0.0; 2]);
    assert_eq!(arm.offer(&fresh), Verdict::Applied, "nothing had failed before the first command");
    arm.silence();
    for _ in 0..10 {
        assert_eq!(arm.offer(&fresh), Verdict::Safe { state: SafeState::Hold, entered: false });
    }
    assert!(arm.gate.is_latched());
    arm.gate.release();
    assert_eq!(arm.offer(&fresh), Verdict::Applied);
}

#[test]
fn setpoint_without_its_gain_leaves_no_fading_difference() {
    let mut arm = arm_with(SafeState::Damp, LimitPolicy::Clamp, ResumeRule::Near);
    arm.silence();
    let mut damped = command([-1e21, 1e21], [0.0; 2]);
    damped.kp_mut().fill(0.0);
    damped.effort_mut().fill(0.0);
    for _ in 0..300 {
        arm.offer(&damped);
        assert!(arm.gate.setpoints().iter().all(|setpoint| setpoint.velocity == 0.0));
    }
    assert_eq!(arm.gate.state(), GateState::Following);
}

#[test]
fn resuming_from_a_braking_joint_keeps_its_effort() {
    let mut arm = Arm::following();
    // Its drive applies 6 N m more than gravity, and continues to do so.
    arm.position[0] = 0.49;
    arm.silence();
    (0..5).for_each(|_| {
        arm.silence();
    });
    let last = arm.gate.setpoints()[0].effort;
    assert!(last > 25.0, "{last}");
    let far = command([1.5, -0.5], [0.0; 2]);
    let mut before = last;
    for step in 0..200 {
        assert_eq!(arm.offer(&far), Verdict::Resuming);
        let effort = arm.gate.setpoints()[0].effort;
        // 6 N m in a third of 30 ms, at its fastest
        assert!((effort - before).abs() <= 6.0 * DT / 0.03, "step {step}: from {before} to {effort} N m");
        before = effort;
    }
    assert!((before - 21.0).abs() < 0.01, "{before}");
}

/// Resumes to a sine at `share` of the acceleration limit of the first joint, sampled every `hold` ms and
/// extrapolated in between.
fn resumes_to_a_sine(hertz: f64, share: f64, hold: usize, silent: usize) -> (usize, usize) {
    let omega = core::f64::consts::TAU * hertz;
    let amplitude = (share * 7.5 / (omega * omega)).min(share * 2.0 / omega);
    let goal = |step: usize| {
        let phase = omega * step as f64 * DT;
        command([amplitude * phase.sin(), -0.5], [amplitude * omega * phase.cos(), 0.0])
    };
    let mut arm = arm();
    arm.position = [0.0, -0.5];
    let (mut longest, mut resuming, mut following) = (0, 0, 0);
    let mut newest = goal(0);
    for step in 0..10_000 {
        let is_new = step % hold == 0;
        if is_new {
            newest = goal(step);
        }
        let mut gravity = |effort: &mut [f64]| effort.copy_from_slice(&GRAVITY);
        let measured = Measured { position: &arm.position, velocity: &arm.velocity, gravity: &mut gravity };
        let is_silent = (4_000..4_000 + silent).contains(&step);
        if is_silent {
            arm.gate.make_safe(measured, DT);
        } else {
            let ahead = hold as f64 * DT;
            arm.gate.offer(Offer { command: &newest, is_new, ahead }, measured, DT, &arm.book);
        }
        arm.move_on();
        match arm.gate.state() {
            GateState::Resuming => resuming += 1,
            state => {
                (resuming, following) = (0, if state == GateState::Following { following + 1 } else { 0 })
            }
        }
        longest = longest.max(resuming);
    }
    (longest, following)
}

#[test]
fn resuming_ends_for_fast_motion() {
    for (hertz, share) in [(0.3, 0.6), (0.5, 0.9), (1.0, 0.5), (1.0, 0.8), (2.0, 0.6), (2.0, 0.9), (4.0, 0.9)]
    {
        for (hold, silent) in
            [(1, 1), (1, 12), (2, 60), (5, 15), (10, 300), (20, 20), (20, 1_000), (20, 3_000)]
        {
            let (longest, following) = resumes_to_a_sine(hertz, share, hold, silent);
            let case =
                format!("{hertz} Hz at {share} of the limits, new every {hold} ms, silent for {silent} ms");
            // Recovery to a motion at 0.9 of the velocity limit lasts longer than `RESUME_WITHIN` and is
            // reported.
            let within = if (hertz, share) == (0.5, 0.9) { 4_500 } else { 2_000 };
            assert!(longest <= within, "{case}: resuming for {longest} ms");
            assert!(following > 900 || silent >= 1_000, "{case}: following for the last {following} ms");
        }
    }
}

#[test]
fn joint_that_must_not_move_has_a_braking_band() {
    let mut joints = limits();
    joints[0].velocity = 0.0;
    let rules =
        GateRules { safe_state: SafeState::Hold, limits: LimitPolicy::Clamp, resume: ResumeRule::Near };
    let mut gate = Gate::new(joints, rules);
    let mut gravity = |effort: &mut [f64]| effort.fill(0.0);
    for q in [-2.0, 0.0, 1.9, 2.0] {
        let measured = Measured { position: &[q, 0.0], velocity: &[0.0; 2], gravity: &mut gravity };
        gate.make_safe(measured, DT);
        let setpoint = gate.setpoints()[0];
        assert!(setpoint.min_velocity < 0.0 && setpoint.max_velocity > 0.0, "{setpoint:?}");
        assert!(setpoint.min_velocity >= -1e-3 && setpoint.max_velocity <= 1e-3, "{setpoint:?}");
    }
}

#[test]
fn drive_without_an_effort_limit_keeps_its_velocity_limit() {
    for push in [
        JointSetpoint { effort: 20.0, ..JointSetpoint::default() },
        JointSetpoint { effort: -20.0, ..JointSetpoint::default() },
        JointSetpoint { position: 10.0, kp: 10.0, ..JointSetpoint::default() },
        JointSetpoint { velocity: 50.0, kd: 3.0, ..JointSetpoint::default() },
    ] {
        let push = JointSetpoint { min_velocity: -2.0, max_velocity: 2.0, ..push };
        let (mut q, mut v, mut fastest) = (0.0, 0.0, 0.0_f64);
        for _ in 0..20_000 {
            v += push.effort_at(q, v, f64::INFINITY) / 0.06 * 1e-5;
            q += v * 1e-5;
            fastest = fastest.max(f64::abs(v));
        }
        assert!((1.9..2.1).contains(&fastest), "{push:?}: {fastest} rad/s");
        let free = JointSetpoint { min_velocity: f64::NEG_INFINITY, max_velocity: f64::INFINITY, ..push };
        assert_eq!(push.effort_at(0.0, 1.5, f64::INFINITY), free.effort_at(0.0, 1.5, f64::INFINITY));
    }
}
