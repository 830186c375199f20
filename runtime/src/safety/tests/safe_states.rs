//! Safe states: entry and control laws.

use super::*;

#[test]
fn startup_and_every_outage_enter_the_safe_state() {
    let entered = Verdict::Safe { state: SafeState::Hold, entered: true };
    let mut arm = arm();
    assert_eq!(arm.silence(), entered, "regardless of the previous process");
    assert_eq!(arm.silence(), Verdict::Safe { state: SafeState::Hold, entered: false });
    arm.offer(&command([0.5, -0.5], [0.0; 2]));
    assert_eq!(arm.silence(), entered);
    // A gate with a fresh command does not affect the state of another gate.
    let (mut stale, mut fresh) = (Arm::following(), Arm::following());
    assert_eq!(stale.silence(), entered);
    for _ in 0..5 {
        fresh.offer(&command([0.5, -0.5], [0.0; 2]));
        assert_eq!(stale.silence(), Verdict::Safe { state: SafeState::Hold, entered: false });
    }
}

#[test]
fn hold_stops_a_joint_within_acceleration_and_range() {
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
    assert!(arm.gate.setpoints()[1].position <= 2.0, "the other joint would have overshot its limit");
    arm.silence();
    assert_eq!(arm.gate.setpoints()[0].position, rest, "it stays there");
}

#[test]
fn hold_begins_with_the_last_effort_and_ends_with_gravity() {
    let mut arm = Arm::following();
    // The joint lags behind its setpoint by 0.01 rad, so its drive applies 6 N m more than gravity.
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
    assert_eq!(law(SafeState::Hold), (0.3, 0.0, 21.0, 600.0, 40.0), "never softer than the profile");
    assert_eq!(law(SafeState::Damp), (0.3, 0.0, 0.0, 0.0, 40.0));
    assert_eq!(law(SafeState::ZeroTorque), (0.3, 0.0, 0.0, 0.0, 0.0));
    assert_eq!(law(SafeState::Brake), (0.3, 0.0, 21.0, 0.0, 1e6));
    let braked = enter(SafeState::Brake, &Joint { velocity: 1.0, ..joint }, limits, &last);
    assert_eq!(stay(SafeState::Brake, &Joint { velocity: 0.5, ..joint }, limits, &braked, DT), braked);
    let stiff = JointSetpoint { kp: 1_000.0, kd: 5.0, ..JointSetpoint::default() };
    let held = enter(SafeState::Hold, &joint, limits, &stiff);
    assert_eq!(
        (held.kp, held.kd),
        (1_000.0, 40.0 * (1_000.0_f64 / 600.0).sqrt()),
        "damped as in the profile"
    );
    let stiffest = JointSetpoint { kp: 20_000.0, kd: 5_000.0, ..JointSetpoint::default() };
    let held = enter(SafeState::Hold, &joint, limits, &stiffest);
    assert_eq!((held.kp, held.kd), (9_600.0, 800.0), "a stiff controller may be unstable");
    let unknown = JointLimits { kp: 0.0, kd: 0.0, ..limits.clone() };
    let held = enter(SafeState::Hold, &joint, &unknown, &stiffest);
    assert_eq!((held.kp, held.kd), (20_000.0, 5_000.0), "without a profile, the last command's");
    let stands = stay(SafeState::Brake, &Joint { position: 0.4, ..joint }, limits, &braked, DT);
    assert_eq!((stands.position, stands.kp, stands.kd, stands.effort), (0.4, 600.0, 40.0, 21.0));
}

#[test]
fn reading_that_is_not_finite_is_never_held() {
    let mut arm = Arm::following();
    (arm.position, arm.velocity) = ([f64::NAN, -0.5], [f64::INFINITY, 0.0]);
    arm.silence();
    assert_eq!(arm.gate.setpoints()[0].position, 0.5, "the last setpoint");
    assert_eq!(arm.gate.setpoints()[0].velocity, 0.0);
}

/// A joint with inertia, driven against gravity.
struct Pendulum {
    q: f64,
    v: f64,
}

impl Pendulum {
    const INERTIA: f64 = 0.6;

    fn gravity(q: f64) -> f64 {
        30.0 * q.cos()
    }

    fn step(&mut self, setpoint: &JointSetpoint) {
        for _ in 0..10 {
            let effort = setpoint.effort_at(self.q, self.v, 87.0);
            self.v += (effort - Self::gravity(self.q)) / Self::INERTIA * DT * 0.1;
            self.q += self.v * DT * 0.1;
        }
    }
}

#[test]
fn hold_stops_a_moving_joint_whatever_its_last_gains() {
    let mut random = 7_u64;
    let mut uniform = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 11) as f64 / (1_u64 << 53) as f64
    };
    for case in 0..200 {
        let (kp, kd) = (10_f64.powf(-6.0 + 9.0 * uniform()), 100.0 * uniform());
        let mut joint = Pendulum { q: -1.0 + 2.0 * uniform(), v: -2.0 + 4.0 * uniform() };
        let rules =
            GateRules { safe_state: SafeState::Hold, limits: LimitPolicy::Clamp, resume: ResumeRule::AtOnce };
        let mut gate = Gate::new(vec![limits()[0].clone()], rules);
        let mut command = JointCommand::default();
        command.set_count(1);
        (command.kp_mut()[0], command.kd_mut()[0]) = (kp, kd);
        for step in 0..1_010 {
            let (position, velocity) = ([joint.q], [joint.v]);
            let mut gravity = |effort: &mut [f64]| effort[0] = Pendulum::gravity(position[0]);
            let measured = Measured { position: &position, velocity: &velocity, gravity: &mut gravity };
            if step < 10 {
                command.position_mut()[0] = joint.q + 0.1;
                command.velocity_mut()[0] = joint.v;
                command.effort_mut()[0] = Pendulum::gravity(joint.q);
                let offer = Offer { command: &command, is_new: true, ahead: DT };
                gate.offer(offer, measured, DT, &Book::default());
            } else {
                gate.make_safe(measured, DT);
            }
            joint.step(&gate.setpoints()[0]);
        }
        assert!(joint.v.abs() < REST_SPEED, "case {case}: kp {kp}, kd {kd}: {} rad/s", joint.v);
        assert!(gate.is_safe_state_reached());
    }
}

#[test]
fn hold_that_does_not_hold_is_never_reached() {
    let mut arm = Arm::following();
    for step in 0..1_500 {
        // An external force keeps moving the joint.
        (arm.position[0], arm.velocity[0]) = (0.5 + 0.3 * f64::from(step) * DT, 0.3);
        arm.silence();
        arm.velocity[0] = 0.3;
    }
    assert!(!arm.gate.is_safe_state_reached());
    arm.offer(&command([0.95, -0.5], [0.0; 2]));
    arm.silence();
    assert!(arm.gate.is_safe_state_reached(), "just entered again");
}

/// A light joint whose drive computes its effort once per step. It is stable up to `kd = 2 inertia / dt`,
/// which is 0.8 N m s/rad.
#[test]
fn hold_stops_a_joint_that_its_last_gains_shake() {
    const INERTIA: f64 = 4e-4;
    let limits =
        JointLimits { kp: 6.0, kd: 0.5, velocity: 30.0, ..JointLimits::new("knee") }.with_effort(2.7);
    let rules =
        GateRules { safe_state: SafeState::Hold, limits: LimitPolicy::Clamp, resume: ResumeRule::AtOnce };
    for (kp, kd) in [(1e-6, 100.0), (1e3, 100.0), (20.0, 2.0), (20.0, 0.9), (1e3, 0.0)] {
        let mut gate = Gate::new(vec![limits.clone()], rules);
        let (mut q, mut v) = (0.3, 1.0);
        let mut command = JointCommand::default();
        command.set_count(1);
        (command.kp_mut()[0], command.kd_mut()[0]) = (kp, kd);
        let mut shaken = 0.0_f64;
        for step in 0..1_020 {
            let (position, velocity) = ([q], [v]);
            let mut gravity = |effort: &mut [f64]| effort.fill(0.0);
            let measured = Measured { position: &position, velocity: &velocity, gravity: &mut gravity };
            if step < 20 {
                command.position_mut()[0] = 0.3;
                let offer = Offer { command: &command, is_new: true, ahead: DT };
                gate.offer(offer, measured, DT, &Book::default());
                shaken = shaken.max(v.abs());
            } else {
                gate.make_safe(measured, DT);
                assert!(!is_fast(v) || gate.is_moving_in_safe_state(), "gains {kp}, {kd}: {v} rad/s");
            }
            v += gate.setpoints()[0].effort_at(q, v, limits.effort) / INERTIA * DT;
            q += v * DT;
        }
        assert!(shaken > REST_SPEED && !is_fast(v), "gains {kp}, {kd}: {shaken}, then {v} rad/s");
        assert!(gate.is_safe_state_reached() && !gate.is_moving_in_safe_state());
        let setpoint = gate.setpoints()[0];
        assert!(setpoint.kp >= 6.0 && setpoint.kd >= 0.5, "{setpoint:?}");
    }
}

fn is_fast(velocity: f64) -> bool {
    velocity.abs() >= REST_SPEED
}
