//! The `config` table of `control.multirotor`.

use motorium::units::TimeSpan;
use motorium_control::with_defaults;
use schemars::JsonSchema;
use serde::Deserialize;

with_defaults! {
    /// Configuration of `control.multirotor`. Every key has a default; the catalogue's quadrotor flies with
    /// an empty table.
    ///
    /// ```toml
    /// position_frequency = 2.0
    /// max_tilt = 0.3
    /// ```
    #[derive(Debug, Clone, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct MultirotorConfig;

    /// Bandwidth of the critically damped position control, rad/s. Default 4.
    pub position_frequency: f64 = 4.0;
    /// Bandwidth of the critically damped attitude control, rad/s. Must be at least three times the position
    /// bandwidth. Default 20.
    pub attitude_frequency: f64 = 20.0;
    /// Rate of integral action on a persistent position error, for example from a wrong mass, 1/s. Must not
    /// exceed the position bandwidth. Default 1.
    pub integral_rate: f64 = 1.0;
    /// Maximum tilt of the thrust from the vertical, rad. Default 0.6.
    pub max_tilt: f64 = 0.6;
    /// Maximum fraction of the total thrust used for lift, 0.1 to 1; the remainder is reserved for torque.
    /// Default 0.9.
    pub max_thrust_share: f64 = 0.9;
    /// Gravity in the world frame, m/s^2, pointing downwards. Default: the value in the graph's world, or
    /// 9.81.
    pub gravity: [f64; 3] = [0.0, 0.0, -9.81];
    /// Position error within which a goal counts as reached, m. Default 0.01.
    pub position_tolerance: f64 = 0.01;
    /// Yaw error within which a goal counts as reached, rad. Default 0.05.
    pub yaw_tolerance: f64 = 0.05;
    /// Time to wait after the target comes to rest before errors are scored. Default 1 s.
    pub settle: TimeSpan = TimeSpan { ns: 1_000_000_000 };
    /// Maximum age of the base state. If the state is older, nothing is commanded and the rotors stop.
    /// Default 10 ms.
    pub state_timeout: TimeSpan = TimeSpan { ns: 10_000_000 };
    /// Age beyond which a target is treated as stationary. Default 50 ms.
    pub target_timeout: TimeSpan = TimeSpan { ns: 50_000_000 };
}
