//! Recovery from a safe state: from the held pose to the commanded setpoint, at limited rates.
//!
//! Recovery has two phases. In the *approach* the reference of each joint moves towards its command, within
//! limits of velocity, acceleration and jerk. When all joints are near their commands, commands are followed,
//! and the remaining difference *fades* without a step in position, velocity or effort.
//!
//! A reference never gets near a command that keeps accelerating. Therefore the limits of the approach rise
//! after [`GENTLE_FOR`], and from then on the approach ends as soon as the difference can fade within
//! [`LONGEST_FADE`]. After [`PATIENT_FOR`], fades may be longer, up to the rest of [`RESUME_WITHIN`], and use
//! a larger share of the limits.

use motorium_drive::JointSetpoint;

use super::limits::JointLimits;
use super::states::{HOLD_EFFORT_BLEND, Joint};

/// Initial fraction of the limits used by the approach, because drives overshoot their reference, and joints
/// that reverse simultaneously disturb one another.
const SHARE: f64 = 0.5;
/// Final fraction of the limits used by the approach.
const LAST_SHARE: f64 = 0.6;
/// Time for which the approach uses [`SHARE`], s.
const GENTLE_FOR: f64 = 0.6;
/// Time in which its share of the limits rises to [`LAST_SHARE`], s.
const RISES_FOR: f64 = 0.4;
/// Longest time in which the remaining difference fades if the setpoint did not reach the command, s.
const LONGEST_FADE: f64 = 0.3;
/// Time after which larger differences may fade, s.
const PATIENT_FOR: f64 = 1.0;
/// Time in which the additional share of a fade rises to its full value, s.
const LOSES_PATIENCE_FOR: f64 = 0.5;
/// Additional fraction of the limits that a fade may then use.
const MORE_FADE: f64 = 0.3;
/// Growth of the longest fade, seconds per second.
const FADE_GROWTH: f64 = 0.7;
/// Time after which the approach to an unreachable command ends, s.
const URGENT_AFTER: f64 = 3.0;
/// Fraction of the limits for an approach that lasts longer than [`URGENT_AFTER`].
const URGENT_SHARE: f64 = 0.9;
/// Longest time in which the difference fades after [`URGENT_AFTER`], s.
const URGENT_FADE: f64 = 0.9;
/// Time after which a recovery counts as late and is reported, s. A recovery is only late if the joints
/// cannot reach the commanded setpoints in this time within their limits.
pub const RESUME_WITHIN: f64 = 2.0;
/// Time constant of the last part of the approach, s.
const APPROACH: f64 = 0.08;
/// Speed at which the reference closes in on a near command, as a time at the acceleration of the approach,
/// s. A controller that computes from the measured pose leads an arm that is slower than expected, and
/// reverses late. An arm that closed in faster would overshoot and oscillate.
const GAIN_FOR: f64 = 0.07;
/// Time constant for closing in on a far command, s: farther than the lead of a controller.
const FAR: f64 = 0.5;
/// Time constant of the velocity of the approach, s.
const VELOCITY_LAG: f64 = 0.02;
/// Time in which the acceleration of the approach rises to its limit, s.
const RAMP: f64 = 0.01;
/// Time over which the feed-forward effort blends to the command's, s.
const EFFORT_BLEND: f64 = 0.5;
/// Difference at which a setpoint counts as met, as a fraction of the velocity limit and of the effort limit.
const MET: f64 = 0.02;
/// Time for which the setpoint must stay met, s.
const MET_FOR: f64 = 0.01;
/// Time in which the remaining difference fades if the command was met, s.
const FADE: f64 = 0.1;
/// Fraction of the acceleration limit that the fading may use.
const FADE_SHARE: f64 = 0.25;

/// The reference of one joint during the approach.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Reference {
    position: f64,
    velocity: f64,
    acceleration: f64,
    /// Feed-forward of the safe state in excess of gravity that has not faded yet, N m or N.
    effort: f64,
}

/// The difference between a setpoint and its command at the end of the approach.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Rest {
    position: f64,
    velocity: f64,
    effort: f64,
}

/// Recovery of all joints.
#[derive(Debug, Clone)]
pub(super) struct Resume {
    references: Vec<Reference>,
    rests: Vec<Rest>,
    elapsed: f64,
    met_for: f64,
    /// Time since the end of the approach, s; infinite if nothing fades.
    faded_for: f64,
    /// Duration of the fading, s.
    fade_time: f64,
}

impl Reference {
    /// Returns the joint's reference in a safe state, whether it is held or moving.
    fn from_setpoint(setpoint: &JointSetpoint, joint: &Joint) -> Self {
        let (position, velocity, effort) = match setpoint.kp > 0.0 {
            true => (setpoint.position, setpoint.velocity, setpoint.effort - joint.gravity),
            false => (joint.position, joint.velocity, 0.0),
        };
        Self { position, velocity, acceleration: 0.0, effort }
    }

    /// Returns `true` if the remaining difference changes the effort only slightly and can fade within the
    /// acceleration limit.
    fn meets(&self, command: &JointSetpoint, limits: &JointLimits) -> bool {
        let fading = FADE_SHARE * limits.usual_acceleration() * FADE;
        // The peak acceleration of a quintic is 5.8 times its height, and about 4 times its slope, in units
        // of its duration.
        let position = (MET * limits.effort / command.kp).min(fading * FADE / 5.8);
        let velocity = (MET * limits.velocity).min(fading / 4.0);
        (command.kp == 0.0 || (command.position - self.position).abs() <= position)
            && (command.kd == 0.0 || (command.velocity - self.velocity).abs() <= velocity)
    }

    /// Moves towards the command for `dt` s. A joint without a gain moves freely.
    fn advance(
        &mut self,
        command: &JointSetpoint,
        (limits, share): (&JointLimits, f64),
        joint: &Joint,
        dt: f64,
    ) {
        if command.kp == 0.0 {
            self.position = joint.position;
        }
        if command.kp == 0.0 && command.kd == 0.0 {
            (self.velocity, self.acceleration) = (joint.velocity, 0.0);
            return;
        }
        let (fastest, largest) = (share * limits.velocity, share * limits.usual_acceleration());
        let commanded = if command.kd > 0.0 { command.velocity } else { 0.0 };
        let distance = if command.kp > 0.0 { command.position - self.position } else { 0.0 };
        // Actuators with long periods need longer time constants, or they would oscillate from step to step.
        let lag = VELOCITY_LAG.max(dt);
        let approach = APPROACH.max(4.0 * lag);
        let fastest_gain = (largest * GAIN_FOR).max(distance.abs() / FAR);
        // Half of the deceleration is reserved for a setpoint that reverses.
        let gain = (largest * distance.abs()).sqrt().min(distance.abs() / approach).min(fastest_gain);
        let velocity = (commanded + gain.copysign(distance)).max(-fastest).min(fastest);
        let acceleration = ((velocity - self.velocity) / lag).max(-largest).min(largest);
        let change = largest * (dt / RAMP).min(1.0);
        self.acceleration += (acceleration - self.acceleration).max(-change).min(change);
        self.velocity += self.acceleration * dt;
        if command.kp > 0.0 {
            self.position += self.velocity * dt;
        }
    }
}

impl Rest {
    /// Returns the difference between a setpoint and its command. Without its gain a setpoint has no effect
    /// and may have any value.
    fn from_difference(position: f64, velocity: f64, effort: f64, command: &JointSetpoint) -> Self {
        Self {
            position: if command.kp > 0.0 { position - command.position } else { 0.0 },
            velocity: if command.kd > 0.0 { velocity - command.velocity } else { 0.0 },
            effort: effort - command.effort,
        }
    }

    /// Returns the shortest fading time in which the difference stays within these shares of the velocity
    /// limit and the acceleration limit, s. A joint that must not move at all is ignored.
    fn shortest_fade(&self, limits: &JointLimits, velocity_share: f64, acceleration_share: f64) -> f64 {
        let (fastest, largest) =
            (velocity_share * limits.velocity, acceleration_share * limits.usual_acceleration());
        if fastest <= 0.0 || largest <= 0.0 {
            return 0.0;
        }
        // The peak acceleration of a quintic is 5.8 times its height, and about 4 times its slope, in units
        // of its duration; its slope is at most 1.875 times its height.
        let (height, slope) = (5.8 * self.position.abs() / largest, 2.0 * self.velocity.abs() / largest);
        (slope + (slope * slope + height).sqrt()).max(1.875 * self.position.abs() / fastest)
    }

    /// Returns the difference at the fraction `s` of a fading of `duration` s: a quintic from this difference
    /// to zero, without acceleration at either end.
    fn faded(&self, s: f64, duration: f64) -> Self {
        let (s2, left) = (s * s, 1.0 - s);
        let height = 1.0 - s2 * s * (10.0 - 15.0 * s + 6.0 * s2);
        let slope = s - s2 * s * (6.0 - 8.0 * s + 3.0 * s2);
        let height_rate = -30.0 * s2 * left * left;
        let slope_rate = 1.0 - s2 * (18.0 - 32.0 * s + 15.0 * s2);
        Self {
            position: self.position * height + self.velocity * duration * slope,
            velocity: self.position * height_rate / duration + self.velocity * slope_rate,
            effort: self.effort * left,
        }
    }
}

impl Resume {
    pub(super) fn new(joints: usize) -> Self {
        Self {
            references: vec![Reference::default(); joints],
            rests: vec![Rest::default(); joints],
            elapsed: 0.0,
            met_for: 0.0,
            faded_for: f64::INFINITY,
            fade_time: FADE,
        }
    }

    /// Begins the approach at the setpoints of the safe state.
    pub(super) fn begin<'a>(&mut self, safe: impl Iterator<Item = (&'a JointSetpoint, Joint)>) {
        (self.elapsed, self.met_for, self.faded_for) = (0.0, 0.0, f64::INFINITY);
        for (reference, (setpoint, joint)) in self.references.iter_mut().zip(safe) {
            *reference = Reference::from_setpoint(setpoint, &joint);
        }
    }

    /// Returns `true` if a command is near enough to its setpoint in the safe state for the difference to
    /// fade.
    pub(super) fn is_near(
        &self,
        index: usize,
        command: &JointSetpoint,
        limits: &JointLimits,
        safe: &JointSetpoint,
    ) -> bool {
        (command.effort - safe.effort).abs() <= MET * limits.effort
            && self.references[index].meets(command, limits)
    }

    /// Begins to fade the difference between these commands and the safe state.
    pub(super) fn begin_fading(&mut self, commands: &[JointSetpoint], safe: &[JointSetpoint]) {
        let pairs = commands.iter().zip(safe).zip(&self.references);
        for (rest, ((command, safe), reference)) in self.rests.iter_mut().zip(pairs) {
            *rest = Rest::from_difference(reference.position, reference.velocity, safe.effort, command);
        }
        (self.faded_for, self.fade_time) = (0.0, FADE);
    }

    fn is_urgent(&self) -> bool {
        self.elapsed > URGENT_AFTER
    }

    /// Returns the fraction of the limits that the approach uses now.
    fn share(&self) -> f64 {
        if self.is_urgent() {
            return URGENT_SHARE;
        }
        SHARE + (LAST_SHARE - SHARE) * ((self.elapsed - GENTLE_FOR) / RISES_FOR).clamp(0.0, 1.0)
    }

    /// Returns the progress of the additional share, from 0 before [`PATIENT_FOR`] to 1.
    fn impatience(&self) -> f64 {
        ((self.elapsed - PATIENT_FOR) / LOSES_PATIENCE_FOR).clamp(0.0, 1.0)
    }

    /// Returns the longest fading time of a difference that starts to fade now, s.
    fn longest_fade(&self) -> f64 {
        if self.is_urgent() {
            return URGENT_FADE;
        }
        let grown = LONGEST_FADE + FADE_GROWTH * (self.elapsed - PATIENT_FOR).max(0.0);
        grown.min(RESUME_WITHIN - self.elapsed).max(LONGEST_FADE)
    }

    /// Computes one joint's setpoint on the approach to `command`. Returns `true` if the command is met.
    pub(super) fn advance(
        &mut self,
        index: usize,
        command: &JointSetpoint,
        limits: &JointLimits,
        joint: &Joint,
        dt: f64,
    ) -> (JointSetpoint, bool) {
        let limit_share = self.share();
        let reference = &mut self.references[index];
        reference.advance(command, (limits, limit_share), joint, dt);
        reference.effort *= (1.0 - dt / HOLD_EFFORT_BLEND).max(0.0);
        let share = (self.elapsed / EFFORT_BLEND).min(1.0);
        let setpoint = JointSetpoint {
            position: reference.position,
            velocity: reference.velocity,
            effort: (1.0 - share) * joint.gravity + share * command.effort + reference.effort,
            ..*command
        };
        self.rests[index] =
            Rest::from_difference(setpoint.position, setpoint.velocity, setpoint.effort, command);
        let effort = self.rests[index].effort.abs() <= MET * limits.effort;
        (setpoint, effort && reference.meets(command, limits))
    }

    /// Ends a step of `dt` s, in which all commands were met if `all_met`. The remaining difference fades
    /// from the end of the approach on. Returns `true` if the commands were met and count as followed during
    /// the fading.
    pub(super) fn end_step(&mut self, all_met: bool, limits: &[JointLimits], dt: f64) -> bool {
        self.elapsed += dt;
        self.met_for = if all_met { self.met_for + dt } else { 0.0 };
        if self.met_for >= MET_FOR {
            (self.faded_for, self.fade_time) = (0.0, FADE);
            return true;
        }
        if self.elapsed >= GENTLE_FOR {
            let shortest = |velocity_share: f64, acceleration_share: f64| {
                let joints = self.rests.iter().zip(limits);
                let times = joints
                    .map(|(rest, limits)| rest.shortest_fade(limits, velocity_share, acceleration_share));
                times.fold(FADE, f64::max)
            };
            let share = (self.share() + MORE_FADE * self.impatience()).min(URGENT_SHARE);
            let hard = shortest(share, share);
            let longest = self.longest_fade();
            if hard <= longest {
                self.fade_time = shortest(SHARE, FADE_SHARE).min(longest).max(hard);
                self.faded_for = 0.0;
            }
        }
        false
    }

    /// Returns `true` if the recovery has lasted longer than [`RESUME_WITHIN`].
    #[inline]
    pub(super) fn is_late(&self) -> bool {
        self.elapsed > RESUME_WITHIN
    }

    /// Returns `true` while a difference is fading.
    #[inline]
    pub(super) fn fades(&self) -> bool {
        self.faded_for.is_finite()
    }

    /// Adds the remaining difference to the commands, `dt` s after the previous step.
    pub(super) fn fade(&mut self, commands: &mut [JointSetpoint], dt: f64) {
        self.faded_for += dt;
        self.elapsed += dt;
        if self.faded_for >= self.fade_time {
            self.faded_for = f64::INFINITY;
            return;
        }
        for (command, rest) in commands.iter_mut().zip(&self.rests) {
            let rest = rest.faded(self.faded_for / self.fade_time, self.fade_time);
            if command.kp > 0.0 {
                command.position += rest.position;
            }
            if command.kd > 0.0 {
                command.velocity += rest.velocity;
            }
            command.effort += rest.effort;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_fades_smoothly_with_its_derivative() {
        let rest = Rest { position: 3e-3, velocity: -0.04, effort: 1.7 };
        let (begin, end) = (rest.faded(0.0, FADE), rest.faded(1.0, FADE));
        assert_eq!(begin, rest);
        for left in [end.position, end.velocity, end.effort] {
            assert!(left.abs() < 1e-15, "{end:?}");
        }
        let h = 1e-4;
        let mut hardest = 0.0_f64;
        for step in 1..10_000 {
            let s = f64::from(step) * h;
            let (before, now, after) =
                (rest.faded(s - h, FADE), rest.faded(s, FADE), rest.faded(s + h, FADE));
            let slope = (after.position - before.position) / (2.0 * h * FADE);
            assert!((slope - now.velocity).abs() < 1e-7, "at {s}: {slope} and {}", now.velocity);
            hardest = hardest.max(((after.velocity - before.velocity) / (2.0 * h * FADE)).abs());
        }
        // the bounds by which a setpoint counts as met
        assert!(hardest <= 5.8 * 3e-3 / FADE.powi(2) + 4.0 * 0.04 / FADE, "{hardest}");
    }
}
