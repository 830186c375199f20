//! The table `limits` of `control.qp`.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    AccelerationConfig, CentreOfMassLimitConfig, CollisionConfig, FrameLimitConfig, PositionLimit,
    SupportConfig, VelocityLimit,
};

/// Limits of the commanded motion, always enforced on the setpoint.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LimitsConfig {
    /// Limits of joint positions.
    pub position: PositionLimit,
    /// Limits of joint velocities.
    pub velocity: VelocityLimit,
    /// Limits of joint accelerations. Only without `inverse_dynamics`. Default: no limits.
    pub acceleration: Option<AccelerationConfig>,
    /// Limits of the positions and velocities of frames. Default: no limits.
    pub frames: Vec<FrameLimitConfig>,
    /// Maximum speeds of the centre of mass. Default: no limits.
    pub centre_of_mass_velocity: Option<CentreOfMassLimitConfig>,
    /// Minimum distances of links from each other, from the ground and from objects of the world. Default: no
    /// limits.
    pub collision: Option<CollisionConfig>,
    /// Limit that keeps a point of the robot above the support polygon. Default: no limit.
    pub support: Option<SupportConfig>,
}
