//! Common vocabulary of all drives: commands, feedback, states, faults and ranges, in units of the output
//! shaft.

use crate::range::Range;

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
    /// Returns the torque \[N m\] that this command demands at a position \[rad\] and a velocity \[rad/s\],
    /// without limits.
    ///
    /// ```
    /// use motorium_can::drive::Command;
    ///
    /// let command = Command { position: 1.0, kp: 20.0, kd: 0.5, torque: 3.0, ..Command::default() };
    /// assert_eq!(command.torque_at(0.9, 2.0), 3.0 + 20.0 * (1.0 - 0.9) - 0.5 * 2.0);
    /// ```
    pub fn torque_at(&self, position: f64, velocity: f64) -> f64 {
        self.torque + self.kp * (self.position - position) + self.kd * (self.velocity - velocity)
    }
}

/// Answer of a drive, in units of the output shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Position, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Torque, N m.
    pub torque: f64,
    /// Temperature of the drive, degrees Celsius; `None` if not reported.
    pub temperature: Option<f64>,
    /// Supply voltage, V; `None` if not reported.
    pub voltage: Option<f64>,
    /// State of the drive.
    pub state: State,
}

/// State reported by a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Not reported.
    Unknown,
    /// The drive is disabled.
    Disabled,
    /// The drive follows commands.
    Enabled,
    /// The drive disabled itself because of a fault.
    Fault(Fault),
}

/// Fault of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The supply voltage is too high.
    OverVoltage,
    /// The supply voltage is too low.
    UnderVoltage,
    /// The current is too high.
    OverCurrent,
    /// The transistors are too hot.
    HotTransistors,
    /// The motor is too hot.
    HotMotor,
    /// No command arrived within the watchdog time.
    CommunicationLost,
    /// The torque demand exceeded the motor's capability for too long.
    Overload,
    /// The encoder failed.
    Encoder,
    /// Any other fault, with the drive's code.
    Other(u32),
}

impl Fault {
    /// Returns a short description of the fault.
    pub fn description(self) -> &'static str {
        match self {
            Self::OverVoltage => "supply voltage too high",
            Self::UnderVoltage => "supply voltage too low",
            Self::OverCurrent => "current too high",
            Self::HotTransistors => "transistors too hot",
            Self::HotMotor => "motor too hot",
            Self::CommunicationLost => "no command within the watchdog time",
            Self::Overload => "overload",
            Self::Encoder => "encoder failed",
            Self::Other(_) => "drive-specific fault",
        }
    }

    /// Returns the drive-specific code of [`Other`](Self::Other); `None` for all other faults.
    pub fn code(self) -> Option<u32> {
        match self {
            Self::Other(code) => Some(code),
            _ => None,
        }
    }
}

/// Ranges of the fields of a drive's frames, in units of its output shaft.
///
/// ```
/// use motorium_can::drive::Ranges;
///
/// assert_eq!(Ranges::MINI_CHEETAH.velocity.max, 65.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranges {
    /// Positions, rad.
    pub position: Range,
    /// Velocities, rad/s.
    pub velocity: Range,
    /// Position gains, N m/rad.
    pub kp: Range,
    /// Velocity gains, N m s/rad.
    pub kd: Range,
    /// Torques, N m.
    pub torque: Range,
}

impl Ranges {
    /// Creates ranges from the largest position (rad), velocity (rad/s) and torque (N m). Gains range up to
    /// 500 N m/rad and 5 N m s/rad.
    pub const fn new(position: f64, velocity: f64, torque: f64) -> Self {
        Self {
            position: Range::symmetric(position),
            velocity: Range::symmetric(velocity),
            kp: Range::from_zero(500.0),
            kd: Range::from_zero(5.0),
            torque: Range::symmetric(torque),
        }
    }

    /// Clamps each field of a command to its range.
    pub fn clamped(&self, command: &Command) -> Command {
        Command {
            position: self.position.nearest(command.position),
            velocity: self.velocity.nearest(command.velocity),
            kp: self.kp.nearest(command.kp),
            kd: self.kd.nearest(command.kd),
            torque: self.torque.nearest(command.torque),
        }
    }

    /// Sets the largest position gain `kp` (N m/rad) and velocity gain `kd` (N m s/rad).
    #[must_use]
    pub const fn with_gains(self, kp: f64, kd: f64) -> Self {
        Self { kp: Range::from_zero(kp), kd: Range::from_zero(kd), ..self }
    }
}

/// Zero point of the positions that a drive reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum PositionReference {
    /// Position at power-up.
    Relative = 0,
    /// Zero of the rotor encoder. With a gearbox, each output turn has one such position per rotor turn.
    Rotor = 1,
    /// Zero of the output, from an output encoder or because the position has been set.
    Output = 2,
}

impl core::fmt::Display for PositionReference {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Relative => "the power-up position",
            Self::Rotor => "the rotor encoder",
            Self::Output => "the output",
        })
    }
}
