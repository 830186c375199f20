//! The state of one body in each recursion.

use super::coriolis::Coriolis;
use crate::math::{ArticulatedInertia, M3, RigidInertia, Spatial, V3};

/// State of the recursion for one body, in its node frame.
#[derive(Clone, Debug)]
pub(super) struct Local {
    /// Pose in the parent.
    pub(super) rotation: M3,
    pub(super) translation: V3,
    /// Angular velocity.
    pub(super) angular: V3,
    /// Angular acceleration.
    pub(super) angular_rate: V3,
    /// Classical acceleration of the origin, with gravity as an upward acceleration.
    pub(super) acceleration: V3,
    /// `[alpha]x + [omega]x^2`: maps a fixed point of the body to its acceleration relative to the origin.
    pub(super) point_acceleration: M3,
    /// Net wrench on the body and everything it carries, about the origin.
    pub(super) wrench: Spatial,
}

impl Local {
    pub(super) const START: Self = Self {
        rotation: M3::IDENTITY,
        translation: V3::ZERO,
        angular: V3::ZERO,
        angular_rate: V3::ZERO,
        acceleration: V3::ZERO,
        point_acceleration: M3::ZERO,
        wrench: Spatial::ZERO,
    };
}

/// A body in base coordinates.
#[derive(Clone, Debug)]
pub(super) struct Composite {
    pub(super) rotation: M3,
    pub(super) position: V3,
    /// Motion of the body for one unit of joint velocity.
    pub(super) joint: Spatial,
    /// Inertia of the body; later including everything it carries.
    pub(super) inertia: RigidInertia,
}

impl Composite {
    pub(super) const START: Self = Self {
        rotation: M3::IDENTITY,
        position: V3::ZERO,
        joint: Spatial::ZERO,
        inertia: RigidInertia::ZERO,
    };
}

/// A body in base coordinates.
#[derive(Clone, Debug)]
pub(super) struct Articulated {
    pub(super) rotation: M3,
    pub(super) position: V3,
    pub(super) joint: Spatial,
    pub(super) velocity: Spatial,
    /// Acceleration caused by velocity products and gravity; later with the contribution of the efforts.
    pub(super) acceleration: Spatial,
    /// Wrench required by the motion beyond the applied one.
    pub(super) wrench: Spatial,
    pub(super) inertia: ArticulatedInertia,
    /// Wrench along the joint's motion.
    pub(super) yielding: Spatial,
    pub(super) inverse: f64,
    pub(super) effort: f64,
}

impl Articulated {
    pub(super) const START: Self = Self {
        rotation: M3::IDENTITY,
        position: V3::ZERO,
        joint: Spatial::ZERO,
        velocity: Spatial::ZERO,
        acceleration: Spatial::ZERO,
        wrench: Spatial::ZERO,
        inertia: ArticulatedInertia::ZERO,
        yielding: Spatial::ZERO,
        inverse: 0.0,
        effort: 0.0,
    };
}

/// Derivative workspace of one body, in addition to its composite inertia.
#[derive(Clone, Debug)]
pub(super) struct BodyDerivatives {
    pub(super) velocity: Spatial,
    pub(super) acceleration: Spatial,
    /// Rate of the joint's motion with the parent, and the rate of that rate.
    pub(super) first: Spatial,
    pub(super) second: Spatial,
    pub(super) coriolis: Coriolis,
    /// Wrench on the body and everything it carries.
    pub(super) wrench: Spatial,
}

impl BodyDerivatives {
    pub(super) const START: Self = Self {
        velocity: Spatial::ZERO,
        acceleration: Spatial::ZERO,
        first: Spatial::ZERO,
        second: Spatial::ZERO,
        coriolis: Coriolis::ZERO,
        wrench: Spatial::ZERO,
    };
}
