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
    /// Joint positions.
    pub position: PositionLimit,
    /// Joint velocities.
    pub velocity: VelocityLimit,
    /// Joint accelerations, without `inverse_dynamics`. Default: no limits.
    pub acceleration: Option<AccelerationConfig>,
    /// Boxes and speeds of frames.
    pub frames: Vec<FrameLimitConfig>,
    /// Largest speeds of the centre of mass. Default: none.
    pub centre_of_mass_velocity: Option<CentreOfMassLimitConfig>,
    /// Minimum distances between links, and from the ground and objects of the world. Default: none.
    pub collision: Option<CollisionConfig>,
    /// A point that must stay above the support. Default: none.
    pub support: Option<SupportConfig>,
}
