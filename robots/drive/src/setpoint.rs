//! The setpoint of one joint, and the laws of the drive that follows it.

/// The setpoint of one joint. It stays in force until it is replaced.
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
/// A joint that moves beyond `min_velocity` or `max_velocity` brakes, regardless of the rest of the setpoint:
/// `high(v)` is the effort limit up to `max_velocity` and falls from there to the negative effort limit over
/// [`BRAKING_BAND`] of the larger of both velocities; `low(v)` likewise. A drive without an effort limit
/// brakes with the largest effort that its setpoint requests up to twice these velocities.
///
/// A joint with `max_acceleration` is also kept within the velocities that
/// [`end_velocities`](Self::end_velocities) returns, by any effort within the effort limit. This effort
/// depends on the other joints, so [`effort_at`](Self::effort_at) does not include it.
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
    /// Position gain \[N m/rad or N/m\], not negative.
    pub kp: f64,
    /// Velocity gain \[N m s/rad or N s/m\], not negative.
    pub kd: f64,
    /// Backward velocity limit beyond which the drive brakes \[rad/s or m/s\], negative; minus infinity for
    /// no limit. CAN drives apply their own limits and ignore this one.
    pub min_velocity: f64,
    /// Forward velocity limit beyond which the drive brakes \[rad/s or m/s\], positive; infinity for no
    /// limit. CAN drives apply their own limits and ignore this one.
    pub max_velocity: f64,
    /// Largest acceleration of the joint in either direction \[rad/s2 or m/s2\]; infinity for no limit. It
    /// depends on the dynamics of the whole robot: only drives of the articulated engine apply it, within
    /// their effort limits, in robots with a fixed base that nothing touches or pushes
    /// ([`end_velocities`](Self::end_velocities)).
    pub max_acceleration: f64,
    /// If set, the velocity of the position setpoint \[rad/s or m/s\], with which the joint arrives there: it
    /// approaches only as fast as it can slow down to it. Ignored without `max_acceleration` or `kp`.
    pub arrival_velocity: Option<f64>,
}

/// Width of the band in which a drive passes from full effort to full braking, as a fraction of the larger
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
    /// Creates a pure effort setpoint \[N m or N\].
    pub fn effort(effort: f64) -> Self {
        Self { effort, ..Self::default() }
    }

    /// Creates a setpoint that holds `position` \[rad or m\] with gains `kp` \[N m/rad or N/m\] and `kd`
    /// \[N m s/rad or N s/m\].
    pub fn hold(position: f64, kp: f64, kd: f64) -> Self {
        Self { position, kp, kd, ..Self::default() }
    }

    /// Returns `true` if setpoints and gains are finite, no gain is negative and zero velocity is within the
    /// limits.
    pub fn is_valid(&self) -> bool {
        [self.position, self.velocity, self.effort, self.kp, self.kd].iter().all(|x| x.is_finite())
            && self.kp >= 0.0
            && self.kd >= 0.0
            && self.min_velocity < 0.0
            && self.max_velocity > 0.0
    }

    /// Effort of a drive with this effort limit \[N m or N\] at position `q` and velocity `v`.
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

    /// Width of the band in which the drive passes from full effort to full braking \[rad/s or m/s\];
    /// infinite without velocity limits.
    #[inline]
    pub fn braking_band(&self) -> f64 {
        BRAKING_BAND * self.max_velocity.max(-self.min_velocity)
    }

    /// Slope of the braking effort beyond a velocity limit, for a drive with this effort limit \[N m s/rad or
    /// N s/m\]; zero without limits.
    #[inline]
    pub fn braking_slope(&self, limit: f64) -> f64 {
        let band = self.braking_band();
        if limit.is_finite() && band.is_finite() { 2.0 * limit / band } else { 0.0 }
    }

    /// Largest effort that the law `at_rest - slope v` requests up to twice the velocity limits: the braking
    /// effort of a drive without an effort limit. Up to the velocity limits it does not affect the setpoint.
    #[inline]
    pub fn braking_effort(&self, at_rest: f64, slope: f64) -> f64 {
        let requested = |v: f64| (at_rest - 2.0 * slope * v).abs();
        requested(self.min_velocity).max(requested(self.max_velocity))
    }
}
