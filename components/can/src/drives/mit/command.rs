//! Commands of MIT drives.

/// Command of a drive, in units of the output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Position setpoint, rad.
    pub position: f64,
    /// Velocity setpoint, rad/s.
    pub velocity: f64,
    /// Position gain, N m/rad.
    pub kp: f64,
    /// Velocity gain, N m s/rad.
    pub kd: f64,
    /// Feed-forward torque, N m.
    pub torque: f64,
}

impl Command {
    /// Torque that a drive applies for this command at this position \[rad\] and velocity \[rad/s\], without
    /// limits, N m.
    ///
    /// ```
    /// use motorium_can::mit::Command;
    ///
    /// let command = Command { position: 1.0, kp: 20.0, kd: 0.5, torque: 3.0, ..Command::default() };
    /// assert_eq!(command.torque_at(0.9, 2.0), 3.0 + 20.0 * (1.0 - 0.9) - 0.5 * 2.0);
    /// ```
    pub fn torque_at(&self, position: f64, velocity: f64) -> f64 {
        self.torque + self.kp * (self.position - position) + self.kd * (self.velocity - velocity)
    }
}
