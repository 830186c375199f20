//! Wrenches from outside.

use nalgebra::Vector3;

use crate::math::{Spatial, V3};
use crate::model::flat::FramePlacement;

/// A force and a moment at the origin of a frame, in its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench {
    /// Force \[N\].
    pub force: Vector3<f64>,
    /// Moment about the frame's origin \[Nm\].
    pub moment: Vector3<f64>,
}

/// The wrench about the origin of the node the frame is mounted on, in its axes.
pub(super) fn at_slot(placement: &FramePlacement, wrench: &Wrench) -> Spatial {
    let force = placement.rotation * V3::from(wrench.force);
    Spatial {
        linear: force,
        angular: placement.rotation * V3::from(wrench.moment) + placement.position.cross(force),
    }
}
