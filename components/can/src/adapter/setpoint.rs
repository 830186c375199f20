//! Commands of joints.

/// Command of a joint, in joint units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Position, rad or m.
    pub position: f64,
    /// Velocity, rad/s or m/s.
    pub velocity: f64,
    /// Feed-forward effort, N m or N.
    pub effort: f64,
    /// Position gain, N m/rad or N/m.
    pub kp: f64,
    /// Velocity gain, N m s/rad or N s/m.
    pub kd: f64,
}
