//! The `config` table of `control.wheels`.

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

/// Configuration of `control.wheels`. Every key has a default: for a robot of the catalogue the table may stay empty.
///
/// ```toml
/// speed = 0.15
/// acceleration = 0.5
/// start = { position = [1.0, 0.0], yaw = 1.57 }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WheelsConfig {
    /// Largest speed of the rim of a wheel, m/s. Default: that of the joints' velocity limits, which hold as well.
    pub speed: Option<f64>,
    /// Largest acceleration of the rim of a wheel, m/s^2; of joints that are the pose of the base, m/s^2 and rad/s^2.
    /// Acceleration limits of the profile hold as well. Default 1.
    pub acceleration: f64,
    /// Proportional gain of the wheels, N m/rad: it holds against friction. Default: that of the profile, or 20/s times
    /// `wheel_kd` where the profile has none.
    pub wheel_kp: Option<f64>,
    /// Derivative gain of the wheels, N m s/rad. Default: that of the profile.
    pub wheel_kd: Option<f64>,
    /// Largest angle by which the setpoint of a wheel may lead the measured angle, rad (m of a joint that slides).
    /// Default 0.5.
    pub max_lead: f64,
    /// Pose of the base in the world at the beginning, for the odometry. Default the origin.
    pub start: StartConfig,
    /// Slip that the covariance of the odometry counts with: standard deviation in a way of 1 m, m. Default 0.003.
    pub slip: f64,
    /// Compensation of the weight of joints that are held, such as those of an arm, by a feed-forward effort. Default true.
    pub gravity_compensation: bool,
    /// Acceleration of free fall in the world, m/s^2. Default: that of the graph's `[world]`, or [0, 0, -9.81].
    pub gravity: [f64; 3],
    /// Age from which a joint state is not acted upon: nothing is commanded then. Default 10 ms.
    pub state_timeout: TimeSpan,
    /// Age from which a target counts as zero, so that the base brakes. Default 100 ms.
    pub target_timeout: TimeSpan,
}

/// Pose of a base in the plane.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StartConfig {
    /// Position, m.
    pub position: [f64; 2],
    /// Angle about z, rad.
    pub yaw: f64,
}

impl Default for WheelsConfig {
    fn default() -> Self {
        Self {
            speed: None,
            acceleration: 1.0,
            wheel_kp: None,
            wheel_kd: None,
            max_lead: 0.5,
            start: StartConfig::default(),
            slip: 0.003,
            gravity_compensation: true,
            gravity: [0.0, 0.0, -9.81],
            state_timeout: TimeSpan { ns: 10_000_000 },
            target_timeout: TimeSpan { ns: 100_000_000 },
        }
    }
}
