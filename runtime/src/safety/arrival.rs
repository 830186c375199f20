//! Joints that their acceleration limit has kept behind their position setpoint.
//!
//! A drive that reaches the acceleration limit falls behind its setpoint. Its position feedback alone would
//! brake too late and overshoot, because it does not anticipate the limit. From the first restrained step
//! until the setpoint is met, the setpoint therefore carries the velocity with which to arrive.

use motorium_drive::JointSetpoint;

use super::limits::Bounds;

/// Time after the last restrained step for which a joint counts as behind its setpoint, s.
const BEHIND_FOR: f64 = 0.02;
/// Distance at which a setpoint is met, as a fraction of the distance in which the joint brakes from its
/// velocity limit with its acceleration limit.
const MET: f64 = 0.02;
/// Smallest distance at which a setpoint is met, rad or m.
const LEAST_MET: f64 = 1e-3;

/// One joint of [`Arrivals`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Arrival {
    /// True from the first restrained step until the setpoint is met.
    behind: bool,
    /// Time since the last restrained step, s.
    unrestrained_for: f64,
    /// Rate of change of the commanded positions, rad/s or m/s; zero while it is clamped, because nothing is
    /// known about the end of the motion.
    rate: f64,
}

/// The arrivals of all joints at their position setpoints.
#[derive(Debug)]
pub(super) struct Arrivals {
    joints: Vec<Arrival>,
    /// True if any joint is behind.
    any: bool,
}

impl Arrivals {
    pub(super) fn new(count: usize) -> Self {
        Self { joints: vec![Arrival::default(); count], any: false }
    }

    pub(super) fn reset(&mut self) {
        self.joints.fill(Arrival::default());
        self.any = false;
    }

    /// Returns `true` if any joint is behind its setpoint.
    #[inline]
    pub(super) fn any(&self) -> bool {
        self.any
    }

    /// Notes the joints that their acceleration limit restrained in the last step, of `dt` s, which ended at
    /// `position`.
    #[inline]
    pub(super) fn note(
        &mut self,
        restrained: &[bool],
        (setpoints, position): (&[JointSetpoint], &[f64]),
        bounds: &[Bounds],
        dt: f64,
    ) {
        if self.any || restrained.contains(&true) {
            self.update(restrained, (setpoints, position), bounds, dt);
        }
    }

    #[cold]
    #[inline(never)]
    fn update(
        &mut self,
        restrained: &[bool],
        (setpoints, position): (&[JointSetpoint], &[f64]),
        bounds: &[Bounds],
        dt: f64,
    ) {
        self.any = false;
        for (i, (joint, restrained)) in self.joints.iter_mut().zip(restrained).enumerate() {
            joint.unrestrained_for = if *restrained { 0.0 } else { joint.unrestrained_for + dt };
            joint.behind |= *restrained;
            let (setpoint, met) = (&setpoints[i], (MET * bounds[i].braking_distance()).max(LEAST_MET));
            let is_met = setpoint.kp == 0.0 || (setpoint.position - position[i]).abs() <= met;
            joint.behind &= joint.unrestrained_for < BEHIND_FOR || !is_met;
            self.any |= joint.behind;
        }
    }

    /// Notes that the commanded position of joint `i` changes at `rate`, or `None` while this is clamped.
    #[inline]
    pub(super) fn note_rate(&mut self, i: usize, rate: Option<f64>) {
        self.joints[i].rate = rate.unwrap_or(0.0);
    }

    /// Sets the acceleration limits of the setpoints of commands, and the velocities with which the joints
    /// behind them arrive. A joint without gains follows neither position nor velocity.
    pub(super) fn bound(&self, setpoints: &mut [JointSetpoint], bounds: &[Bounds]) {
        for ((setpoint, bounds), joint) in setpoints.iter_mut().zip(bounds).zip(&self.joints) {
            let stated = setpoint.kd > 0.0 && setpoint.velocity != 0.0;
            let velocity = if stated { setpoint.velocity } else { joint.rate };
            setpoint.max_acceleration = bounds.acceleration_of(setpoint.kp, setpoint.kd);
            setpoint.arrival_velocity = joint.behind.then_some(velocity);
        }
    }
}
