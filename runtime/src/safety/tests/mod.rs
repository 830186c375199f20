//! The command gate without processes.

mod arrivals;
mod limiting;
mod safe_states;
mod way_back;
mod within;

use std::cell::RefCell;

use super::*;
use crate::plan::{GateRules, LimitPolicy, ResumeRule, SafeState};
use crate::region::{LimitKind, Refusal};
use crate::state::JointCommand;

const DT: f64 = 1e-3;

/// Statistics that record every call.
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
    let rules = GateRules { safe_state, limits: limit_policy, resume };
    Arm { gate: Gate::new(limits(), rules), book: Book::default(), position: [0.5, -0.5], velocity: [0.0; 2] }
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
        self.offer_as(command, true)
    }

    /// Offers the command of the previous step again, as if the next one were late.
    fn offer_again(&mut self, command: &JointCommand) -> Verdict {
        self.offer_as(command, false)
    }

    fn offer_as(&mut self, command: &JointCommand, is_new: bool) -> Verdict {
        let mut gravity = |effort: &mut [f64]| effort.copy_from_slice(&GRAVITY);
        let measured = Measured { position: &self.position, velocity: &self.velocity, gravity: &mut gravity };
        let offer = Offer { command, is_new, ahead: DT };
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

    /// Moves the drives with a gain to their setpoints immediately.
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
