//! The setpoint of one joint, and the laws of the drive that follows it.

/// Setpoint of one joint, which stays in force until the next setpoint replaces it.
///
/// A drive applies
///
/// ```text
/// tau = clamp(kp (position - q) + kd (velocity - v) + effort, low(v), high(v))
/// ```
///
/// at joint position `q` and velocity `v`: the impedance law of torque-controlled drives ("MIT mode") within
/// the joint's effort limit. `kp = kd = 0` is pure effort control and `kp = 0` is velocity control.
///
/// A joint that moves beyond `min_velocity` or `max_velocity` brakes, regardless of the rest of the setpoint.
/// Up to `max_velocity`, `high(v)` is the effort limit. Above `max_velocity`, it falls to the negative effort
/// limit over a band of [`BRAKING_BAND`] times the larger velocity limit; `low(v)` is symmetric. Without an
/// effort limit, the drive brakes with the maximum effort that the setpoint requests at up to twice the
/// velocity limits.
///
/// In addition, a drive keeps a joint with `max_acceleration` within the velocities that
/// [`end_velocities`](Self::end_velocities) returns. The effort that this requires, within the effort limit,
/// depends on all joints of the robot, so [`effort_at`](Self::effort_at) does not include it.
///
/// ```
/// use motorium_drive::JointSetpoint;
///
/// let hold = JointSetpoint::hold(0.5, 100.0, 10.0);
/// assert_eq!(hold.effort_at(0.4, 0.0, 87.0), 100.0 * (0.5 - 0.4));
/// assert!(hold.is_valid() && !JointSetpoint { kp: -1.0, ..hold }.is_valid());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSetpoint {
    /// Position \[rad or m\].
    pub position: f64,
    /// Velocity \[rad/s or m/s\].
    pub velocity: f64,
    /// Feed-forward effort \[N m or N\].
    pub effort: f64,
    /// Position gain \[N m/rad or N/m\], at least 0.
    pub kp: f64,
    /// Velocity gain \[N m s/rad or N s/m\], at least 0.
    pub kd: f64,
    /// Minimum velocity \[rad/s or m/s\], negative, beyond which the drive brakes; minus infinity for no
    /// limit. CAN drives ignore this field and apply their own limits.
    pub min_velocity: f64,
    /// Maximum velocity \[rad/s or m/s\], positive, beyond which the drive brakes; infinity for no limit. CAN
    /// drives ignore this field and apply their own limits.
    pub max_velocity: f64,
    /// Maximum acceleration of the joint in either direction \[rad/s2 or m/s2\]; infinity for no limit. The
    /// acceleration depends on the dynamics of the whole robot. Only drives of the simulation engine
    /// `articulated` apply the limit, within their effort limits, and only while the robot has a fixed base
    /// and nothing touches or pushes it ([`end_velocities`](Self::end_velocities)).
    pub max_acceleration: f64,
    /// Velocity of the position setpoint \[rad/s or m/s\], with which the joint must arrive at the setpoint.
    /// If set, the joint approaches only as fast as it can slow down to this velocity. Ignored without
    /// `max_acceleration` or `kp`.
    pub arrival_velocity: Option<f64>,
}

/// Width of the band in which a drive changes from full effort to full braking, as a fraction of the larger
/// velocity limit.
pub const BRAKING_BAND: f64 = 0.05;

impl Default for JointSetpoint {
    /// Zero effort at any velocity.
    fn default() -> Self {
        let (min_velocity, max_velocity) = (f64::NEG_INFINITY, f64::INFINITY);
        Self {
            position: 0.0,
            velocity: 0.0,
            effort: 0.0,
            kp: 0.0,
            kd: 0.0,
            min_velocity,
            max_velocity,
            max_acceleration: f64::INFINITY,
            arrival_velocity: None,
        }
    }
}

impl JointSetpoint {
    /// Creates a setpoint of pure `effort` \[N m or N\], with zero gains and without velocity limits.
    pub fn effort(effort: f64) -> Self {
        Self { effort, ..Self::default() }
    }

    /// Creates a setpoint that holds `position` \[rad or m\] with gains `kp` \[N m/rad or N/m\] and `kd`
    /// \[N m s/rad or N s/m\].
    pub fn hold(position: f64, kp: f64, kd: f64) -> Self {
        Self { position, kp, kd, ..Self::default() }
    }

    /// Returns `true` if setpoints and gains are finite, no gain is negative, and zero velocity is within the
    /// velocity limits.
    pub fn is_valid(&self) -> bool {
        [self.position, self.velocity, self.effort, self.kp, self.kd].iter().all(|x| x.is_finite())
            && self.kp >= 0.0
            && self.kd >= 0.0
            && self.min_velocity < 0.0
            && self.max_velocity > 0.0
    }

    /// Returns the effort \[N m or N\] that a drive with the effort limit `limit` applies at position `q` and
    /// velocity `v`.
    ///
    /// ```
    /// use motorium_drive::JointSetpoint;
    ///
    /// let free = JointSetpoint::effort(1e9);
    /// let push = JointSetpoint { min_velocity: -2.0, max_velocity: 2.0, ..free };
    /// assert_eq!(push.effort_at(0.0, 0.0, 87.0), 87.0);
    /// assert_eq!(push.effort_at(0.0, 2.1, 87.0), -87.0);
    /// ```
    pub fn effort_at(&self, q: f64, v: f64, limit: f64) -> f64 {
        let desired = self.kp * (self.position - q) + self.kd * (self.velocity - v) + self.effort;
        let band = self.braking_band();
        let limit = if limit.is_finite() || !band.is_finite() { limit } else { self.braking_effort_at(q) };
        let highest = |beyond: f64| {
            let brakes = beyond > 0.0 && limit.is_finite();
            if brakes { limit * (1.0 - 2.0 * (beyond / band).min(1.0)) } else { limit }
        };
        let (low, high) = (-highest(self.min_velocity - v), highest(v - self.max_velocity));
        if desired.is_nan() { 0.0 } else { desired.max(low).min(high) }
    }

    #[cold]
    fn braking_effort_at(&self, q: f64) -> f64 {
        self.braking_effort(self.kp * (self.position - q) + self.kd * self.velocity + self.effort, self.kd)
    }

    /// Returns the width \[rad/s or m/s\] of the band in which the drive changes from full effort to full
    /// braking. Without velocity limits, the width is infinite.
    #[inline]
    pub fn braking_band(&self) -> f64 {
        BRAKING_BAND * self.max_velocity.max(-self.min_velocity)
    }

    /// Returns the slope \[N m s/rad or N s/m\] of the braking effort beyond a velocity limit, for a drive
    /// with the effort limit `limit` \[N m or N\]. The slope is zero if the effort limit or the velocity
    /// limits are infinite.
    #[inline]
    pub fn braking_slope(&self, limit: f64) -> f64 {
        let band = self.braking_band();
        if limit.is_finite() && band.is_finite() { 2.0 * limit / band } else { 0.0 }
    }

    /// Returns the braking effort \[N m or N\] of a drive without an effort limit. It is the maximum effort
    /// that the law `at_rest - slope v` requests at up to twice the velocity limits, and has no effect within
    /// the velocity limits.
    #[inline]
    pub fn braking_effort(&self, at_rest: f64, slope: f64) -> f64 {
        let requested = |v: f64| (at_rest - 2.0 * slope * v).abs();
        requested(self.min_velocity).max(requested(self.max_velocity))
    }
}
