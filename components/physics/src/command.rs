//! The command of a drive.

/// The command of one drive. It stays in force until it is replaced.
///
/// The drive applies, at the end of every integration step,
///
/// ```text
/// tau = clamp(kp (position - q) + kd (velocity - v) + effort, -limit, +limit)
/// ```
///
/// with `limit` the effort limit of the joint: the impedance law of torque-controlled drives ("MIT mode").
/// `kp = kd = 0` is pure effort control, `kp = 0` velocity control. `q` and `v` are values at the *end* of
/// the step (implicit), so gains of any size are stable; a drive without `kd` is damped by the integration.
///
/// A joint that moves beyond `min_velocity` or `max_velocity` is braked, whatever the rest of the command:
/// the highest effort in the direction of its motion falls from `limit` at that velocity to `-limit` over a
/// twentieth of the larger of both.
///
/// # Example
///
/// ```
/// use motorium_physics::JointCommand;
///
/// let hold = JointCommand::hold(0.5, 100.0, 10.0);
/// assert!(hold.is_valid());
/// assert!(!JointCommand { kp: -1.0, ..hold }.is_valid());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCommand {
    /// Position setpoint \[rad or m\].
    pub position: f64,
    /// Velocity setpoint \[rad/s or m/s\].
    pub velocity: f64,
    /// Feed-forward effort \[Nm or N\].
    pub effort: f64,
    /// Position gain Kp \[Nm/rad or N/m\], not negative.
    pub kp: f64,
    /// Velocity gain Kd \[Nms/rad or Ns/m\], not negative.
    pub kd: f64,
    /// Lower velocity beyond which the drive brakes \[rad/s or m/s\], negative; minus infinity for none.
    pub min_velocity: f64,
    /// Upper velocity beyond which the drive brakes \[rad/s or m/s\], positive; infinity for none.
    pub max_velocity: f64,
}

/// Share of the larger velocity limit over which the effort of a drive goes from full to full braking.
pub(crate) const BRAKING_BAND: f64 = 0.05;

impl Default for JointCommand {
    /// No effort, at any velocity.
    fn default() -> Self {
        let (min_velocity, max_velocity) = (f64::NEG_INFINITY, f64::INFINITY);
        Self { position: 0.0, velocity: 0.0, effort: 0.0, kp: 0.0, kd: 0.0, min_velocity, max_velocity }
    }
}

impl JointCommand {
    /// A command of pure effort \[Nm or N\].
    pub fn effort(effort: f64) -> Self {
        Self { effort, ..Self::default() }
    }

    /// A command to hold `position` \[rad or m\] with gains `kp` \[Nm/rad or N/m\] and `kd` \[Nms/rad or
    /// Ns/m\].
    pub fn hold(position: f64, kp: f64, kd: f64) -> Self {
        Self { position, kp, kd, ..Self::default() }
    }

    /// Returns `true` if setpoints and gains are finite, no gain is negative, and zero velocity is within the
    /// limits.
    pub fn is_valid(&self) -> bool {
        [self.position, self.velocity, self.effort, self.kp, self.kd].iter().all(|x| x.is_finite())
            && self.kp >= 0.0
            && self.kd >= 0.0
            && self.min_velocity < 0.0
            && self.max_velocity > 0.0
    }
}
