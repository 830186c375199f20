//! The command gate without processes.

use std::cell::RefCell;

use proptest::prelude::*;

use super::*;
use crate::plan::{LimitPolicy, ResumeRule, SafeState};
use crate::region::{GateState, LimitKind, Refusal};
use crate::state::JointCommand;

const DT: f64 = 1e-3;

/// An account that keeps what it is told.
#[derive(Default)]
struct Book {
    limited: RefCell<Vec<(usize, LimitKind)>>,
    refused: RefCell<Vec<Refusal>>,
}

impl Account for Book {
    fn limited(&self, joint: usize, kind: LimitKind) {
        self.limited.borrow_mut().push((joint, kind));
    }

    fn refused(&self, reason: Refusal) {
        self.refused.borrow_mut().push(reason);
    }
}

/// Two joints of an arm whose drives follow their setpoints without error.
struct Arm {
    gate: Gate,
    book: Book,
    position: [f64; 2],
    velocity: [f64; 2],
}

const GRAVITY: [f64; 2] = [21.0, -3.0];

fn limits() -> Vec<JointLimits> {
    let joint = |name: &str, acceleration: f64| {
        JointLimits {
            effort_rate: 1e3,
            lower: -2.0,
            upper: 2.0,
            velocity: 2.0,
            acceleration,
            kp: 600.0,
            kd: 40.0,
            ..JointLimits::new(name)
        }
        .with_effort(87.0)
    };
    vec![joint("shoulder", 7.5), joint("elbow", 12.5)]
}

fn arm_with(safe_state: SafeState, limit_policy: LimitPolicy, resume: ResumeRule) -> Arm {
    let settings = GateSettings { safe_state, limits: limit_policy, resume };
    Arm {
        gate: Gate::new(limits(), settings),
        book: Book::default(),
        position: [0.5, -0.5],
        velocity: [0.0; 2],
    }
}

fn arm() -> Arm {
    arm_with(SafeState::Hold, LimitPolicy::Clamp, ResumeRule::Near)
}

fn command(position: [f64; 2], velocity: [f64; 2]) -> JointCommand {
    let mut command = JointCommand::default();
    command.set_count(2);
    command.position_mut().copy_from_slice(&position);
    command.velocity_mut().copy_from_slice(&velocity);
    command.effort_mut().copy_from_slice(&GRAVITY);
    command.kp_mut().fill(600.0);
    command.kd_mut().fill(40.0);
    command
}

impl Arm {
    fn offer(&mut self, command: &JointCommand) -> Verdict {
        let mut gravity = |effort: &mut [f64]| effort.copy_from_slice(&GRAVITY);
        let measured = Measured { position: &self.position, velocity: &self.velocity, gravity: &mut gravity };
        let offer = Offer { command, is_new: true, ahead: DT };
        let verdict = self.gate.offer(offer, measured, DT, &self.book);
        self.move_on();
        verdict
    }

    fn silence(&mut self) -> Verdict {
        let mut gravity = |effort: &mut [f64]| effort.copy_from_slice(&GRAVITY);
        let measured = Measured { position: &self.position, velocity: &self.velocity, gravity: &mut gravity };
        let verdict = self.gate.make_safe(measured, DT);
        self.move_on();
        verdict
    }

    /// The drives follow at once, where they have a gain.
    fn move_on(&mut self) {
        for (i, setpoint) in self.gate.setpoints().iter().enumerate() {
            if setpoint.kp > 0.0 {
                self.position[i] = setpoint.position;
            }
            if setpoint.kd > 0.0 && setpoint.kd < 1e5 {
                self.velocity[i] = setpoint.velocity;
            }
        }
    }

    fn following() -> Self {
        let mut arm = arm();
        arm.silence();
        assert_eq!(arm.offer(&command([0.5, -0.5], [0.0; 2])), Verdict::Applied);
        arm
    }
}

#[test]
fn a_command_within_the_limits_passes_to_the_last_bit() {
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
fn each_field_beyond_its_limit_is_clamped_and_counted_by_joint_and_reason() {
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
        (3, 1e12, LimitKind::Kp, 8.7e5),
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
            "the other joint is innocent"
        );
    }
}

#[test]
fn under_refuse_a_command_beyond_a_limit_is_not_applied_and_counted_once() {
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
fn a_wrong_count_a_negative_gain_and_a_number_that_is_none_are_refused_before_anything_is_applied() {
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
fn the_first_step_of_a_gate_enters_the_safe_state_and_so_does_every_later_outage() {
    let entered = Verdict::Safe { state: SafeState::Hold, entered: true };
    let mut arm = arm();
    assert_eq!(arm.silence(), entered, "whatever the process before it left behind");
    assert_eq!(arm.silence(), Verdict::Safe { state: SafeState::Hold, entered: false });
    arm.offer(&command([0.5, -0.5], [0.0; 2]));
    assert_eq!(arm.silence(), entered);
    // Of two gates, a fresh one has no say in the other's state.
    let (mut stale, mut fresh) = (Arm::following(), Arm::following());
    assert_eq!(stale.silence(), entered);
    for _ in 0..5 {
        fresh.offer(&command([0.5, -0.5], [0.0; 2]));
        assert_eq!(stale.silence(), Verdict::Safe { state: SafeState::Hold, entered: false });
    }
}

#[test]
fn hold_brings_a_moving_joint_to_rest_within_its_acceleration_and_its_range() {
    let mut arm = Arm::following();
    (arm.position, arm.velocity) = ([0.5, 1.99], [1.0, 2.0]);
    arm.silence();
    let (mut before, mut steps) = (1.0, 0);
    while arm.gate.setpoints()[0].velocity > 0.0 {
        let velocity = arm.gate.setpoints()[0].velocity;
        assert!((before - velocity) / DT <= 7.5 + 1e-9);
        (before, steps) = (velocity, steps + 1);
        arm.silence();
        assert!(steps < 1_000, "it does not come to rest");
    }
    let rest = arm.gate.setpoints()[0].position;
    assert!((0.5..0.62).contains(&rest), "{rest}");
    assert!(arm.gate.setpoints()[1].position <= 2.0, "the other joint would have passed its stop");
    arm.silence();
    assert_eq!(arm.gate.setpoints()[0].position, rest, "it stays there");
}

#[test]
fn hold_begins_with_the_effort_of_the_moment_before_and_goes_over_to_gravity() {
    let mut arm = Arm::following();
    // The joint lags behind its setpoint by 0.01 rad: its drive pulls with 6 N m more than gravity.
    arm.position[0] = 0.49;
    arm.silence();
    let first = arm.gate.setpoints()[0];
    assert_eq!(first.position, 0.49);
    assert!((first.effort_at(0.49, 0.0, 87.0) - 27.0).abs() < 1e-9, "{first:?}");
    for _ in 0..300 {
        arm.silence();
    }
    let last = arm.gate.setpoints()[0];
    assert!((last.effort - 21.0).abs() < 1e-3, "{last:?}");
}

#[test]
fn each_safe_state_is_entered_by_its_law() {
    let joint = Joint { position: 0.3, velocity: 0.0, gravity: 21.0 };
    let limits = &limits()[0];
    let last = JointSetpoint { kp: 100.0, kd: 5.0, ..JointSetpoint::default() };
    let law = |state| {
        let JointSetpoint { position, velocity, effort, kp, kd, .. } = enter(state, &joint, limits, &last);
        (position, velocity, effort, kp, kd)
    };
    assert_eq!(law(SafeState::Hold), (0.3, 0.0, 21.0, 100.0, 5.0));
    assert_eq!(law(SafeState::Damp), (0.3, 0.0, 0.0, 0.0, 40.0));
    assert_eq!(law(SafeState::ZeroTorque), (0.3, 0.0, 0.0, 0.0, 0.0));
    assert_eq!(law(SafeState::Brake), (0.3, 0.0, 21.0, 0.0, 1e6));
    let braked = enter(SafeState::Brake, &Joint { velocity: 1.0, ..joint }, limits, &last);
    assert_eq!(stay(SafeState::Brake, &Joint { velocity: 0.5, ..joint }, limits, &braked, DT), braked);
    let stands = stay(SafeState::Brake, &Joint { position: 0.4, ..joint }, limits, &braked, DT);
    assert_eq!((stands.position, stands.kp, stands.kd, stands.effort), (0.4, 600.0, 40.0, 21.0));
}

#[test]
fn a_reading_that_is_not_a_number_is_never_held() {
    let mut arm = Arm::following();
    (arm.position, arm.velocity) = ([f64::NAN, -0.5], [f64::INFINITY, 0.0]);
    arm.silence();
    assert_eq!(arm.gate.setpoints()[0].position, 0.5, "the last setpoint");
    assert_eq!(arm.gate.setpoints()[0].velocity, 0.0);
}

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

#[test]
fn a_drive_brakes_beyond_its_velocity_limit_whatever_its_command() {
    for (kp, kd, effort) in [(0.0, 0.0, 1e9), (1e300, 0.0, 0.0), (0.0, 1e300, 0.0), (0.0, 0.0, 1e308)] {
        let push = JointSetpoint {
            position: 1e300,
            velocity: 1e6,
            effort,
            kp,
            kd,
            min_velocity: -2.0,
            max_velocity: 2.0,
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
fn towards_the_end_of_its_range_a_joint_may_move_only_as_fast_as_it_can_be_stopped() {
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
    fn whatever_is_commanded_the_setpoints_are_finite_and_keep_limits_and_rates(
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
