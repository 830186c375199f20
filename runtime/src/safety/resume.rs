//! The way out of a safe state: from the held pose to the commanded setpoint, at limited rates.

use super::limits::{JointLimits, JointSetpoint};
use super::states::Joint;

/// Share of the limits that the way back uses: the drives follow it with some overshoot.
const SHARE: f64 = 0.5;
/// Time constant of the last part of the approach, s.
const APPROACH: f64 = 0.05;
/// Time over which the feed-forward effort goes over to that of the command, s.
const EFFORT_BLEND: f64 = 0.5;
/// Share of the velocity limit, and of the effort limit, by which a setpoint that is met may still differ.
const MET: f64 = 0.02;
/// Time for which the setpoint must stay met, s.
const MET_FOR: f64 = 0.01;

/// The reference of one joint on its way back.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Reference {
    pub(super) position: f64,
    pub(super) velocity: f64,
}

/// The way back of all joints.
#[derive(Debug, Clone)]
pub(super) struct Resume {
    references: Vec<Reference>,
    elapsed: f64,
    met_for: f64,
}

/// Velocity and acceleration of the way back.
fn rates(limits: &JointLimits) -> (f64, f64) {
    (SHARE * limits.velocity, SHARE * limits.usual_acceleration())
}

impl Reference {
    /// The joint's reference in a safe state: where it is held, or where it moves.
    fn of(setpoint: &JointSetpoint, joint: &Joint) -> Self {
        if setpoint.kp > 0.0 {
            Self { position: setpoint.position, velocity: setpoint.velocity }
        } else {
            Self { position: joint.position, velocity: joint.velocity }
        }
    }

    /// Whether the command differs by no more than a step at the limited rates.
    fn meets(&self, command: &JointSetpoint, limits: &JointLimits, dt: f64) -> bool {
        let (_, acceleration) = rates(limits);
        let near = |difference: f64, tolerance: f64| difference.abs() <= tolerance;
        let position = command.kp == 0.0
            || near(command.position - self.position, acceleration * APPROACH * dt.max(1e-3));
        let velocity = command.kd == 0.0
            || near(command.velocity - self.velocity, (MET * limits.velocity).max(acceleration * dt));
        position && velocity
    }

    /// Moves towards the command for `dt` s. A joint without a gain goes where it goes.
    fn advance(&mut self, command: &JointSetpoint, limits: &JointLimits, joint: &Joint, dt: f64) {
        if command.kp == 0.0 {
            self.position = joint.position;
        }
        if command.kp == 0.0 && command.kd == 0.0 {
            self.velocity = joint.velocity;
            return;
        }
        let (fastest, acceleration) = rates(limits);
        let commanded = if command.kd > 0.0 { command.velocity } else { 0.0 };
        let distance = if command.kp > 0.0 { command.position - self.position } else { 0.0 };
        // Half of the deceleration is kept for a setpoint that turns round.
        let approach = (acceleration * distance.abs()).sqrt().min(distance.abs() / APPROACH);
        let wanted = (commanded + approach.copysign(distance)).max(-fastest).min(fastest);
        let change = (wanted - self.velocity).max(-acceleration * dt).min(acceleration * dt);
        self.velocity += change;
        if command.kp > 0.0 {
            self.position += self.velocity * dt;
        }
    }
}

impl Resume {
    pub(super) fn new(joints: usize) -> Self {
        Self { references: vec![Reference::default(); joints], elapsed: 0.0, met_for: 0.0 }
    }

    /// Begins at the setpoints of the safe state.
    pub(super) fn begin<'a>(&mut self, safe: impl Iterator<Item = (&'a JointSetpoint, Joint)>) {
        (self.elapsed, self.met_for) = (0.0, 0.0);
        for (reference, (setpoint, joint)) in self.references.iter_mut().zip(safe) {
            *reference = Reference::of(setpoint, &joint);
        }
    }

    /// Whether a command could be followed from the start without exceeding the rates.
    pub(super) fn is_met(
        &self,
        index: usize,
        command: &JointSetpoint,
        limits: &JointLimits,
        safe: &JointSetpoint,
        dt: f64,
    ) -> bool {
        let effort = (command.effort - safe.effort).abs() <= MET * limits.effort;
        effort && self.references[index].meets(command, limits, dt)
    }

    /// One joint's setpoint on the way to `command`; whether it is met.
    pub(super) fn advance(
        &mut self,
        index: usize,
        command: &JointSetpoint,
        limits: &JointLimits,
        joint: &Joint,
        dt: f64,
    ) -> (JointSetpoint, bool) {
        let reference = &mut self.references[index];
        reference.advance(command, limits, joint, dt);
        let share = (self.elapsed / EFFORT_BLEND).min(1.0);
        let setpoint = JointSetpoint {
            position: reference.position,
            velocity: reference.velocity,
            effort: (1.0 - share) * joint.gravity + share * command.effort,
            ..*command
        };
        let effort = (command.effort - setpoint.effort).abs() <= MET * limits.effort;
        (setpoint, effort && reference.meets(command, limits, dt))
    }

    /// Ends a step of `dt` s in which all joints were met, or not; whether the way back is over.
    pub(super) fn end_step(&mut self, all_met: bool, dt: f64) -> bool {
        self.elapsed += dt;
        self.met_for = if all_met { self.met_for + dt } else { 0.0 };
        self.met_for >= MET_FOR
    }
}
