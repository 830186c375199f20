//! The common case of a gate's step: a new command within all limits, which is applied unchanged.

use motorium_drive::{JointSetpoint, ROUNDING};

use super::limits::{Bounds, JointLimits};
use crate::state::{Field as _, JointCommand};

/// Limits of all joints as consecutive numbers, as read by the common step.
#[derive(Debug)]
pub(super) struct Envelope {
    bounds: Vec<Bounds>,
}

impl Envelope {
    pub(super) fn from_limits(joints: &[JointLimits]) -> Self {
        Self { bounds: joints.iter().map(Bounds::from_limits).collect() }
    }

    /// Returns the numbers in memory order.
    pub(super) fn bounds(&self) -> &[Bounds] {
        &self.bounds
    }

    /// Applies a new command to the setpoints if it is valid and within all limits, including the rate limits
    /// over `over` s. `q` and `v` are the measured joint positions and velocities. Otherwise returns `false`
    /// and changes nothing; the command must then be checked joint by joint.
    ///
    /// All comparisons of a joint are made without branches between them.
    #[inline]
    pub(super) fn apply(
        &self,
        command: &JointCommand,
        (q, v): (&[f64], &[f64]),
        over: f64,
        setpoints: &mut [JointSetpoint],
    ) -> bool {
        let count = self.bounds.len();
        let (position, velocity, effort) = (command.position(), command.velocity(), command.effort());
        let (kp, kd) = (command.kp(), command.kd());
        let lengths = [position, velocity, effort, kp, kd, q, v].map(<[f64]>::len);
        if lengths != [count; 7] || setpoints.len() != count || command.check().is_err() {
            return false;
        }
        let mut exceeds = false;
        for i in 0..count {
            let (bounds, last) = (&self.bounds[i], &setpoints[i]);
            // A drive without a gain follows no setpoint, so the measured position is used.
            let position_before = if last.kp > 0.0 { last.position } else { q[i] };
            let velocity_before = if last.kd > 0.0 { last.velocity } else { v[i] };
            let beyond = |step: f64, rate: f64| step.abs() > rate * over * (1.0 + ROUNDING);
            let position_exceeds = (position[i] < bounds.lower)
                | (position[i] > bounds.upper)
                | beyond(position[i] - position_before, bounds.velocity);
            let velocity_exceeds = (velocity[i].abs() > bounds.velocity)
                | beyond(velocity[i] - velocity_before, bounds.acceleration);
            // Without its gain a setpoint has no effect and may have any value.
            exceeds |= (kp[i] < 0.0)
                | (kd[i] < 0.0)
                | (kp[i] > bounds.max_kp)
                | (kd[i] > bounds.max_kd)
                | (effort[i].abs() > bounds.effort)
                | beyond(effort[i] - last.effort, bounds.effort_rate)
                | (kp[i] > 0.0) & position_exceeds
                | (kd[i] > 0.0) & velocity_exceeds;
        }
        if exceeds {
            return false;
        }
        for (i, setpoint) in setpoints.iter_mut().enumerate() {
            let (min_velocity, max_velocity) = self.bounds[i].velocities_at(q[i]);
            *setpoint = JointSetpoint {
                position: position[i],
                velocity: velocity[i],
                effort: effort[i],
                kp: kp[i],
                kd: kd[i],
                min_velocity,
                max_velocity,
                max_acceleration: self.bounds[i].acceleration_of(kp[i], kd[i]),
                arrival_velocity: None,
            };
        }
        true
    }

    /// Sets the velocities beyond which the drives brake, depending on the joint positions.
    pub(super) fn bound_velocities(&self, setpoints: &mut [JointSetpoint], position: &[f64]) {
        for ((setpoint, bounds), q) in setpoints.iter_mut().zip(&self.bounds).zip(position) {
            (setpoint.min_velocity, setpoint.max_velocity) = bounds.velocities_at(*q);
        }
    }
}
