//! The command of a drive.

/// The command of one drive. It stays in force until it is replaced.
///
/// At the end of every integration step the drive applies
///
/// ```text
/// tau = clamp(kp (position - q) + kd (velocity - v) + effort, -limit, +limit)
/// ```
///
/// with `limit` the effort limit of the joint: the impedance law of torque-controlled drives ("MIT mode").
/// `kp = kd = 0` is pure effort control and `kp = 0` is velocity control. `q` and `v` are evaluated at the
/// *end* of the step (implicitly), so gains of any size are stable. A drive without `kd` is damped by the
/// integration.
///
/// A joint that moves beyond `min_velocity` or `max_velocity` brakes, regardless of the rest of the command.
/// The highest effort in the direction of motion falls from `limit` at the velocity limit to `-limit` over a
/// velocity band of one twentieth of the larger limit.
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
    /// Velocity limit backwards beyond which the drive brakes \[rad/s or m/s\], negative; minus infinity for
    /// no limit.
    pub min_velocity: f64,
    /// Velocity limit forwards beyond which the drive brakes \[rad/s or m/s\], positive; infinity for no
    /// limit.
    pub max_velocity: f64,
}

/// Width of the band in which a drive passes from full effort to full braking, as a share of the larger
/// velocity limit.
pub(crate) const BRAKING_BAND: f64 = 0.05;

impl Default for JointCommand {
    /// Commands zero effort at any velocity.
    fn default() -> Self {
        let (min_velocity, max_velocity) = (f64::NEG_INFINITY, f64::INFINITY);
        Self { position: 0.0, velocity: 0.0, effort: 0.0, kp: 0.0, kd: 0.0, min_velocity, max_velocity }
    }
}

impl JointCommand {
    /// Creates a command of pure effort \[Nm or N\].
    pub fn effort(effort: f64) -> Self {
        Self { effort, ..Self::default() }
    }

    /// Creates a command that holds `position` \[rad or m\] with gains `kp` \[Nm/rad or N/m\] and `kd`
    /// \[Nms/rad or Ns/m\].
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
}
