//! The command of a drive.

/// The command of one drive. It stays in force until it is replaced.
///
/// The drive applies, at the end of every integration step,
///
/// ```text
/// tau = clamp(kp (position - q) + kd (velocity - v) + effort, -limit, +limit)
/// ```
///
/// with `limit` the effort limit of the joint: the impedance law of torque-controlled drives ("MIT mode"). `kp = kd =
/// 0` is pure effort control, `kp = 0` velocity control. `q` and `v` are those at the *end* of the step (implicit),
/// so gains of any size are stable; a drive without `kd` is damped by the integration.
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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
}

impl JointCommand {
    /// A command of pure effort \[Nm or N\].
    pub fn effort(effort: f64) -> Self {
        Self { effort, ..Self::default() }
    }

    /// A command to hold `position` \[rad or m\] with gains `kp` \[Nm/rad or N/m\] and `kd` \[Nms/rad or Ns/m\].
    pub fn hold(position: f64, kp: f64, kd: f64) -> Self {
        Self { position, kp, kd, ..Self::default() }
    }

    /// True when every field is finite and no gain is negative.
    pub fn is_valid(&self) -> bool {
        [self.position, self.velocity, self.effort, self.kp, self.kd].iter().all(|x| x.is_finite())
            && self.kp >= 0.0
            && self.kd >= 0.0
    }
}
