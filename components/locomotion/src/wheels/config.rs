//! Settings of the wheels of a robot: the `config` table of `control.wheels`.

use motorium::units::TimeSpan;
use motorium_control::with_defaults;
use schemars::JsonSchema;
use serde::Deserialize;

with_defaults! {
    /// Configuration of `control.wheels`. Every key has a default: for a robot of the catalogue the table may
    /// stay empty.
    ///
    /// ```toml
    /// speed = 0.15
    /// acceleration = 0.5
    /// start = { position = [1.0, 0.0], yaw = 1.57 }
    /// ```
    #[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct WheelsConfig;

    /// Maximum rim speed of a wheel, m/s, in addition to the velocity limits of the joints. Default: no
    /// additional limit.
    pub speed: Option<f64> = None;
    /// Maximum acceleration of the rim of a wheel, m/s^2; for joints that form the pose of the base, m/s^2
    /// and rad/s^2. The acceleration limits in the robot's profile apply in addition. Default 1.
    pub acceleration: f64 = 1.0;
    /// Proportional gain of the wheels, N m/rad, which acts against friction. Default: the profile's gain, or
    /// 20/s times `wheel_kd`.
    pub wheel_kp: Option<f64> = None;
    /// Derivative gain of the wheels, N m s/rad. Default: the profile's gain.
    pub wheel_kd: Option<f64> = None;
    /// Maximum lead of a wheel's setpoint over its measured angle, rad (m for a prismatic joint). Default
    /// 0.5.
    pub max_lead: f64 = 0.5;
    /// Initial pose of the base in the world, for the odometry. Default: the origin.
    pub start: StartConfig = StartConfig::default();
    /// Wheel slip assumed in the covariance of the odometry: standard deviation after 1 m travelled, m.
    /// Default 0.003.
    pub slip: f64 = 0.003;
    /// Adds a feed-forward effort that compensates the weight of held joints, such as an arm's. Default true.
    pub gravity_compensation: bool = true;
    /// Gravitational acceleration in the world, m/s^2. Default: the value in the graph's `[world]`, or [0, 0,
    /// -9.81].
    pub gravity: [f64; 3] = [0.0, 0.0, -9.81];
    /// Maximum age of the joint state. If the state is older, nothing is commanded. Default 10 ms.
    pub state_timeout: TimeSpan = TimeSpan { ns: 10_000_000 };
    /// Age beyond which a target counts as zero velocity, so that the base brakes. Default 100 ms.
    pub target_timeout: TimeSpan = TimeSpan { ns: 100_000_000 };
}

/// A planar pose of the base.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StartConfig {
    /// Position, m.
    pub position: [f64; 2],
    /// Angle about z, rad.
    pub yaw: f64,
}
