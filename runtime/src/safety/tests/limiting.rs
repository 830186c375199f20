//! Limits and refusals: commands that are forwarded, clamped or refused.

use proptest::prelude::*;

use super::*;
use crate::region::GateState;

#[test]
fn command_within_the_limits_is_forwarded_bit_for_bit() {
    let mut arm = Arm::following();
    let wanted = command([0.500_1, -0.499_9], [0.005, -0.004]);
    assert_eq!(arm.offer(&wanted), Verdict::Applied);
    for (i, setpoint) in arm.gate.setpoints().iter().enumerate() {
        let passed = [setpoint.position, setpoint.velocity, setpoint.effort, setpoint.kp, setpoint.kd];
        let offered =
            [wanted.position()[i], wanted.velocity()[i], wanted.effort()[i], wanted.kp()[i], wanted.kd()[i]];
        assert_eq!(passed.map(f64::to_bits), offered.map(f64::to_bits));
    }
    assert!(arm.book.limited.borrow().is_empty());
}

#[test]
fn each_field_is_clamped_and_counted_by_reason() {
    let change = |field: usize, value: f64| {
        let mut command = command([0.5, -0.5], [0.0; 2]);
        let fields: [fn(&mut JointCommand) -> &mut [f64]; 5] = [
            JointCommand::position_mut,
            JointCommand::velocity_mut,
            JointCommand::effort_mut,
            JointCommand::kp_mut,
            JointCommand::kd_mut,
        ];
        fields[field](&mut command)[1] = value;
        command
    };
    for (field, value, kind, clamped) in [
        (0, 10.0, LimitKind::Position, -0.5 + 2.0 * DT),
        (0, 0.5, LimitKind::PositionRate, -0.5 + 2.0 * DT),
        (0, 1e300, LimitKind::Position, -0.5 + 2.0 * DT),
        (1, 1e6, LimitKind::Velocity, 12.5 * DT),
        (1, 0.5, LimitKind::Acceleration, 12.5 * DT),
        (2, -1e9, LimitKind::Effort, -3.0 - 1e3 * DT),
        (2, 1e308, LimitKind::Effort, -3.0 + 1e3 * DT),
        (2, 10.0, LimitKind::EffortRate, -3.0 + 1e3 * DT),
        (3, 1e12, LimitKind::Kp, 8.7e3),
        (4, 1e300, LimitKind::Kd, 4.35e4),
    ] {
        let mut arm = Arm::following();
        assert_eq!(arm.offer(&change(field, value)), Verdict::Applied);
        let setpoint = arm.gate.setpoints()[1];
        let found = [setpoint.position, setpoint.velocity, setpoint.effort, setpoint.kp, setpoint.kd][field];
        assert!((found - clamped).abs() < 1e-12, "{kind:?}: {found} instead of {clamped}");
        assert!(arm.book.limited.borrow().contains(&(1, kind)), "{kind:?}: {:?}", arm.book.limited.borrow());
        assert!(
            arm.book.limited.borrow().iter().all(|(joint, _)| *joint == 1),
            "the other joint is not counted"
        );
    }
}

#[test]
fn refused_commands_are_not_applied_and_count_once() {
    let mut arm = arm_with(SafeState::Hold, LimitPolicy::Refuse, ResumeRule::Near);
    arm.silence();
    arm.offer(&command([0.5, -0.5], [0.0; 2]));
    assert_eq!(
        arm.offer(&command([3.0, -0.5], [0.0; 2])),
        Verdict::Safe { state: SafeState::Hold, entered: true }
    );
    assert_eq!(*arm.book.refused.borrow(), [Refusal::Limits]);
    assert_eq!(arm.gate.setpoints()[0].position, 0.5);
}

#[test]
fn malformed_commands_are_refused_before_they_apply() {
    let mut wrong_count = command([0.5, -0.5], [0.0; 2]);
    wrong_count.set_count(3);
    let (mut negative, mut infinite) = (command([0.5, -0.5], [0.0; 2]), command([0.5, -0.5], [0.0; 2]));
    negative.kd_mut()[0] = -1e-300;
    infinite.effort_mut()[1] = f64::INFINITY;
    for (command, reason) in
        [(wrong_count, Refusal::Count), (negative, Refusal::NegativeGain), (infinite, Refusal::Content)]
    {
        let mut arm = Arm::following();
        let verdict = arm.offer(&command);
        assert_eq!(verdict, Verdict::Safe { state: SafeState::Hold, entered: true }, "{reason:?}");
        assert_eq!((&*arm.book.refused.borrow(), arm.gate.state()), (&vec![reason], GateState::Safe));
    }
}

#[test]
fn drive_brakes_beyond_its_velocity_limit() {
    for (kp, kd, effort) in [(0.0, 0.0, 1e9), (1e300, 0.0, 0.0), (0.0, 1e300, 0.0), (0.0, 0.0, 1e308)] {
        let push = JointSetpoint {
            position: 1e300,
            velocity: 1e6,
            effort,
            kp,
            kd,
            min_velocity: -2.0,
            max_velocity: 2.0,
            ..JointSetpoint::default()
        };
        assert_eq!(push.effort_at(0.0, 1.999, 87.0), 87.0);
        assert!(push.effort_at(0.0, 2.05, 87.0).abs() < 1e-9, "no effort in the middle of the band");
        assert_eq!(push.effort_at(0.0, 2.2, 87.0), -87.0);
    }
    let still =
        JointSetpoint { effort: 5.0, min_velocity: -2.0, max_velocity: 2.0, ..JointSetpoint::default() };
    assert_eq!(still.effort_at(0.0, -1.0, 87.0), 5.0, "the other direction is free");
}

#[test]
fn joint_slows_to_stop_before_the_end_of_its_range() {
    let mut arm = Arm::following();
    for (q, low, high) in [(0.0, -2.0, 2.0), (1.9, -2.0, 1.5_f64.sqrt()), (2.0, -2.0, 0.1), (-2.1, -0.1, 2.0)]
    {
        arm.position[0] = q;
        arm.gate.bound_velocities(&arm.position);
        let setpoint = arm.gate.setpoints()[0];
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(
            near(setpoint.min_velocity, low) && near(setpoint.max_velocity, high),
            "at {q}: {setpoint:?}"
        );
    }
    let mut limp = arm_with(SafeState::ZeroTorque, LimitPolicy::Clamp, ResumeRule::Near);
    limp.silence();
    assert!(limp.gate.setpoints().iter().all(|setpoint| setpoint.max_velocity.is_infinite()));
}

proptest! {
    #[test]
    fn setpoints_are_always_finite_and_within_limits(
        numbers in prop::collection::vec((any::<[f64; 5]>(), any::<[f64; 5]>(), any::<bool>()), 1..200),
        state in prop::sample::select(vec![SafeState::Hold, SafeState::Damp, SafeState::ZeroTorque, SafeState::Brake]),
    ) {
        let mut arm = arm_with(state, LimitPolicy::Clamp, ResumeRule::Near);
        arm.silence();
        for (first, second, silent) in numbers {
            let before = arm.gate.setpoints().to_vec();
            let measured = (arm.position, arm.velocity);
            let mut command = JointCommand::default();
            command.set_count(2);
            for (i, [position, velocity, effort, kp, kd]) in [first, second].into_iter().enumerate() {
                command.position_mut()[i] = position;
                command.velocity_mut()[i] = velocity;
                command.effort_mut()[i] = effort;
                command.kp_mut()[i] = kp.abs();
                command.kd_mut()[i] = kd.abs();
            }
            let verdict = if silent { arm.silence() } else { arm.offer(&command) };
            for (i, (setpoint, limits)) in arm.gate.setpoints().iter().zip(limits()).enumerate() {
                let JointSetpoint { position, velocity, effort, kp, kd, .. } = *setpoint;
                prop_assert!([position, velocity, effort, kp, kd].iter().all(|x| x.is_finite()));
                prop_assert!(effort.abs() <= limits.effort && kp <= limits.max_kp);
                if matches!(verdict, Verdict::Safe { .. }) {
                    continue;
                }
                prop_assert!(kd <= limits.max_kd);
                if kp > 0.0 {
                    prop_assert!((-2.004..=2.004).contains(&position), "{position}");
                    let from = if before[i].kp > 0.0 { before[i].position } else { measured.0[i] };
                    prop_assert!((position - from).abs() <= 2.0 * DT * 1.001, "{from} to {position}");
                }
                if kd > 0.0 {
                    prop_assert!(velocity.abs() <= 2.0, "{velocity}");
                }
            }
        }
    }
}

#[test]
fn positions_extrapolate_briefly_while_a_command_is_late() {
    let mut arm = Arm::following();
    let first = command([0.5, -0.5], [7.5 * DT, -12.5 * DT]);
    assert_eq!(arm.offer(&first), Verdict::Applied);
    let at = |arm: &Arm| arm.gate.setpoints().iter().map(|setpoint| setpoint.position).collect::<Vec<_>>();
    for late in 1..=40 {
        assert_eq!(arm.offer_again(&first), Verdict::Applied);
        let time = f64::from(late.min(20)) * DT;
        for (found, (from, velocity)) in at(&arm).iter().zip([(0.5, 7.5 * DT), (-0.5, -12.5 * DT)]) {
            assert!((found - (from + velocity * time)).abs() < 1e-12, "{late} ms late: {found}");
        }
    }
    assert!(arm.book.limited.borrow().is_empty(), "{:?}", arm.book.limited.borrow());

    // a joint that moves towards the end of its range stops there
    let mut arm = Arm::following();
    arm.gate.reset();
    (arm.position, arm.velocity) = ([1.999_95, -0.5], [0.0; 2]);
    arm.silence();
    let towards_the_end = command([1.999_95, -0.5], [7.5 * DT, 0.0]);
    assert_eq!(arm.offer(&towards_the_end), Verdict::Applied);
    // the rest of the initial difference fades meanwhile
    (0..150).for_each(|_| {
        arm.offer_again(&towards_the_end);
    });
    assert_eq!(at(&arm), [2.0, -0.5]);
}
