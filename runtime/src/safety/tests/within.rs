//! The vectorised step compared with the step joint by joint.

use proptest::prelude::*;

use super::*;

/// A command of two joints, relative to their positions, with one arbitrary number.
#[derive(Debug, Clone)]
struct Move {
    position: [f64; 2],
    velocity: [f64; 2],
    effort: [f64; 2],
    other: Option<(usize, usize, f64)>,
}

/// Moves that are usually within the rate limits.
fn moves() -> impl Strategy<Value = Move> {
    let of = |largest: f64| prop::array::uniform2(-largest..largest);
    let anything = [0.0, -0.0, -1.0, 1.999, 2.003, -2.1, 90.0, 1e4, 1e12, f64::NAN, f64::INFINITY];
    let other =
        prop::option::weighted(0.2, (0..5_usize, 0..2_usize, prop::sample::select(anything.to_vec())));
    (of(2.05e-3), of(7.55e-3), of(0.42), other).prop_map(|(position, velocity, effort, other)| Move {
        position,
        velocity,
        effort,
        other,
    })
}

impl Move {
    fn command_of(&self, arm: &Arm) -> JointCommand {
        let mut command = command(arm.position, arm.velocity);
        for i in 0..2 {
            command.position_mut()[i] += self.position[i];
            command.velocity_mut()[i] += self.velocity[i];
            command.effort_mut()[i] += self.effort[i];
        }
        if let Some((field, joint, number)) = self.other {
            let numbers = match field {
                0 => command.position_mut(),
                1 => command.velocity_mut(),
                2 => command.effort_mut(),
                3 => command.kp_mut(),
                _ => command.kd_mut(),
            };
            numbers[joint] = number;
        }
        command
    }
}

/// Returns the bits of a gate's setpoints.
fn bits(gate: &Gate) -> Vec<[u64; 7]> {
    let of = |s: &JointSetpoint| {
        [s.position, s.velocity, s.effort, s.kp, s.kd, s.min_velocity, s.max_velocity].map(f64::to_bits)
    };
    gate.setpoints().iter().map(of).collect()
}

/// Offers a new command to the part of a gate that checks joint by joint.
fn offer_by_joint(arm: &mut Arm, command: &JointCommand) -> Verdict {
    let mut gravity = |effort: &mut [f64]| effort.copy_from_slice(&GRAVITY);
    let measured = Measured { position: &arm.position, velocity: &arm.velocity, gravity: &mut gravity };
    let offer = Offer { command, is_new: true, ahead: DT };
    let verdict = arm.gate.check_command(offer, measured, DT, &arm.book);
    arm.gate.bound_velocities(&arm.position);
    arm.move_on();
    verdict
}

proptest! {
    #[test]
    fn vectorised_limits_equal_single_joints(
        moves in prop::collection::vec(moves(), 1..60),
        refuses in any::<bool>(),
    ) {
        let policy = if refuses { LimitPolicy::Refuse } else { LimitPolicy::Clamp };
        let mut arms = [0, 1].map(|_| arm_with(SafeState::Hold, policy, ResumeRule::AtOnce));
        arms.iter_mut().for_each(|arm| {
            arm.silence();
        });
        for (step, next) in moves.iter().enumerate() {
            let command = next.command_of(&arms[0]);
            let verdicts = [arms[0].offer(&command), offer_by_joint(&mut arms[1], &command)];
            prop_assert_eq!(verdicts[0], verdicts[1], "step {}", step);
            prop_assert_eq!(bits(&arms[0].gate), bits(&arms[1].gate), "step {}", step);
            let [one, other] = [&arms[0].book, &arms[1].book].map(|book| (book.limited.take(), book.refused.take()));
            prop_assert_eq!(one, other, "statistics of step {}", step);
        }
    }
}

#[test]
fn the_fast_path_applies_commands_within_all_limits() {
    let joints = limits();
    let envelope = crate::safety::within::Envelope::from_limits(&joints);
    let (at, before) = ([0.5, -0.5], [JointSetpoint { kp: 600.0, kd: 40.0, ..JointSetpoint::default() }; 2]);
    let from = |position: [f64; 2]| {
        let mut setpoints = before;
        (0..2).for_each(|i| (setpoints[i].position, setpoints[i].effort) = (at[i], GRAVITY[i]));
        let command = command(position, [0.0; 2]);
        (envelope.apply(&command, (&at, &[0.0; 2]), DT, &mut setpoints), setpoints)
    };
    let (applied, setpoints) = from([0.501, -0.501]);
    assert!(applied);
    assert_eq!(setpoints.map(|s| s.position), [0.501, -0.501]);
    assert_eq!(setpoints.map(|s| (s.min_velocity, s.max_velocity)), [(-2.0, 2.0); 2]);
    let (applied, setpoints) = from([0.503, -0.501]);
    assert!(!applied, "3 rad/s of 2");
    assert_eq!(setpoints.map(|s| s.position), at);
}
