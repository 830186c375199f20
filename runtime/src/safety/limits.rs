//! Limits of a joint, and checks of setpoints against them.

use motorium_drive::{JointSetpoint, within_range, within_rate};

use crate::region::LimitKind;

/// Position gain per effort limit at which a drive applies its full effort at an error of ten milliradians
/// (or millimetres). A stiffer joint shakes at full effort, and shakes the weaker joints that it carries.
const KP_PER_EFFORT: f64 = 1e2;
/// Velocity gain per effort limit and velocity limit at which a drive applies its full effort at a thousandth
/// of its velocity limit.
const KD_PER_EFFORT: f64 = 1e3;
/// Largest gain of a drive without an effort limit.
const LARGEST_GAIN: f64 = 1e9;
/// Velocity limit of a joint whose model specifies zero, rad/s or m/s. Drives brake between the limit and
/// 1.05 times the limit, and that band must not be empty.
pub(super) const SLOWEST_LIMIT: f64 = 1e-3;

/// Limits of one joint and its drive, and the gains of its safe states.
///
/// The actuator reads these values from the robot's model. Infinity means no limit.
///
/// ```
/// use motorium::safety::JointLimits;
///
/// let elbow = JointLimits { lower: -3.07, upper: -0.07, velocity: 2.175, acceleration: 12.5, ..JointLimits::new("elbow") }
///     .with_effort(87.0);
/// assert_eq!(elbow.max_kp, 8.7e3);
/// assert!(JointLimits::new("wheel").velocity.is_infinite());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct JointLimits {
    /// Joint name, used in the report.
    pub name: String,
    /// Minimum position, rad or m.
    pub lower: f64,
    /// Maximum position, rad or m.
    pub upper: f64,
    /// Maximum velocity, rad/s or m/s; values below 0.001 are raised to 0.001.
    pub velocity: f64,
    /// Maximum acceleration, rad/s^2 or m/s^2.
    pub acceleration: f64,
    /// Maximum effort, N m or N.
    pub effort: f64,
    /// Maximum rate of change of the feed-forward effort, N m/s or N/s.
    pub effort_rate: f64,
    /// Maximum position gain, N m/rad or N/m.
    pub max_kp: f64,
    /// Maximum velocity gain, N m s/rad or N s/m. A drive that updates its effort once per `dt` is stable up
    /// to a gain of `2 inertia / dt`. Set this field to that gain if the inertia is known.
    pub max_kd: f64,
    /// Position gain of the safe states, N m/rad or N/m. If the gain of the last command is larger, `hold`
    /// keeps that gain, up to 16 times this value.
    pub kp: f64,
    /// Velocity gain of the safe states, N m s/rad or N s/m. If the gain of the last command is larger,
    /// `hold` keeps that gain, up to 20 times this value.
    pub kd: f64,
}

/// Limits of one joint as consecutive numbers in memory, compared with each of its commands.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(16))]
pub(super) struct Bounds {
    pub(super) max_kp: f64,
    pub(super) max_kd: f64,
    pub(super) effort: f64,
    pub(super) effort_rate: f64,
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) velocity: f64,
    pub(super) acceleration: f64,
    /// Distance to the end of the range below which the velocity limit is reduced, so that the joint can
    /// still be brought to rest before the end.
    distance: f64,
    twice_acceleration: f64,
}

/// Time in which a joint without an acceleration limit in its model reaches its velocity limit, s.
pub(super) const FULL_SPEED: f64 = 0.2;
/// Fraction of the velocity limit allowed at the end of the range. With zero, a joint could never leave the
/// end.
const CREEP: f64 = 0.05;

impl Bounds {
    pub(super) fn from_limits(limits: &JointLimits) -> Self {
        let JointLimits { lower, upper, velocity, acceleration, effort, effort_rate, max_kp, max_kd, .. } =
            *limits;
        let twice_acceleration = 2.0 * limits.usual_acceleration();
        let brakes = velocity.is_finite() && twice_acceleration > 0.0;
        let distance = if brakes { velocity.powi(2) / twice_acceleration } else { 0.0 };
        Self {
            max_kp,
            max_kd,
            effort,
            effort_rate,
            lower,
            upper,
            velocity,
            acceleration,
            distance,
            twice_acceleration,
        }
    }

    /// Returns the acceleration limit of a setpoint with these gains; infinite for pure effort.
    #[inline]
    pub(super) fn acceleration_of(&self, kp: f64, kd: f64) -> f64 {
        if kp > 0.0 || kd > 0.0 { self.acceleration } else { f64::INFINITY }
    }

    /// Returns the distance in which the joint stops from its velocity limit, rad or m; zero without limits.
    pub(super) fn braking_distance(&self) -> f64 {
        self.distance
    }

    /// Returns the lowest and highest velocity allowed at position `q`.
    #[inline]
    pub(super) fn velocities_at(&self, q: f64) -> (f64, f64) {
        let (below, above) = (q - self.lower, self.upper - q);
        if (below < self.distance) | (above < self.distance) {
            return (-self.velocity_towards(below), self.velocity_towards(above));
        }
        (-self.velocity, self.velocity)
    }

    /// Returns the velocity limit towards an end of the range at this distance.
    #[cold]
    #[inline(never)]
    fn velocity_towards(&self, distance: f64) -> f64 {
        if distance < self.distance {
            (self.twice_acceleration * distance.max(0.0)).sqrt().max(CREEP * self.velocity)
        } else {
            self.velocity
        }
    }
}

/// The values of the previous setpoint from which rates of change are computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Before {
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) effort: f64,
}

impl JointLimits {
    /// Creates limits that allow everything, with zero gains.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_string(),
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            velocity: f64::INFINITY,
            acceleration: f64::INFINITY,
            effort: f64::INFINITY,
            effort_rate: f64::INFINITY,
            max_kp: LARGEST_GAIN,
            max_kd: LARGEST_GAIN,
            kp: 0.0,
            kd: 0.0,
        }
    }

    /// Returns the acceleration limit. Without a limit, returns the acceleration that reaches the velocity
    /// limit in 0.2 s.
    pub(super) fn usual_acceleration(&self) -> f64 {
        if self.acceleration.is_finite() { self.acceleration } else { self.velocity / FULL_SPEED }
    }

    /// Sets the effort limit, N m or N, and derives the maximum gains from it. With `max_kp`, a position
    /// error of 10 mrad (or 10 mm) requests the full effort; with `max_kd`, a velocity error of a thousandth
    /// of the velocity limit does.
    #[must_use]
    pub fn with_effort(mut self, effort: f64) -> Self {
        self.effort = effort;
        let velocity = if self.velocity.is_finite() { self.velocity } else { 1.0 };
        self.max_kp = (KP_PER_EFFORT * effort).min(LARGEST_GAIN);
        self.max_kd = (KD_PER_EFFORT * effort / velocity.max(1e-6)).min(LARGEST_GAIN);
        self
    }

    /// Clamps the values that do not depend on the previous step: position, velocity, effort and gains.
    /// Values within the limits are unchanged, bit for bit.
    #[inline]
    pub(super) fn clamp(&self, setpoint: &mut JointSetpoint, mut exceeded: impl FnMut(LimitKind)) {
        if setpoint.kp > self.max_kp {
            setpoint.kp = self.max_kp;
            exceeded(LimitKind::Kp);
        }
        if setpoint.kd > self.max_kd {
            setpoint.kd = self.max_kd;
            exceeded(LimitKind::Kd);
        }
        if setpoint.effort.abs() > self.effort {
            setpoint.effort = self.effort.copysign(setpoint.effort);
            exceeded(LimitKind::Effort);
        }
        // Without its gain a setpoint has no effect and may have any value.
        if setpoint.kp > 0.0
            && let Some(position) = within_range(setpoint.position, self.lower, self.upper)
        {
            setpoint.position = position;
            exceeded(LimitKind::Position);
        }
        if setpoint.kd > 0.0 && setpoint.velocity.abs() > self.velocity {
            setpoint.velocity = self.velocity.copysign(setpoint.velocity);
            exceeded(LimitKind::Velocity);
        }
    }

    /// Extrapolates the position with the velocity for `time` s, within the range of the joint.
    #[inline]
    pub(super) fn go_on(&self, setpoint: &mut JointSetpoint, time: f64) {
        if setpoint.kp > 0.0 && setpoint.kd > 0.0 {
            let position = setpoint.position;
            setpoint.position = (position + setpoint.velocity * time)
                .max(self.lower.min(position))
                .min(self.upper.max(position));
        }
    }

    /// Clamps the rates of change since the setpoint `before`, `dt` s ago. Positions change by at most
    /// `share` of the velocity limit.
    #[inline]
    pub(super) fn clamp_rates(
        &self,
        setpoint: &mut JointSetpoint,
        before: Before,
        (share, dt): (f64, f64),
        mut exceeded: impl FnMut(LimitKind),
    ) {
        let largest = share * self.velocity * dt;
        if setpoint.kp > 0.0
            && let Some(position) = within_rate(setpoint.position, before.position, largest)
        {
            setpoint.position = position;
            exceeded(LimitKind::PositionRate);
        }
        if setpoint.kd > 0.0
            && let Some(velocity) = within_rate(setpoint.velocity, before.velocity, self.acceleration * dt)
        {
            setpoint.velocity = velocity;
            exceeded(LimitKind::Acceleration);
        }
        if let Some(effort) = within_rate(setpoint.effort, before.effort, self.effort_rate * dt) {
            setpoint.effort = effort;
            exceeded(LimitKind::EffortRate);
        }
    }
}
