//! External wrenches.

use nalgebra::Vector3;

use crate::math::{Spatial, V3};
use crate::model::flat::FramePlacement;

/// A force and a moment at the origin of a frame, in the axes of the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench {
    /// Force \[N\].
    pub force: Vector3<f64>,
    /// Moment about the frame's origin \[Nm\].
    pub moment: Vector3<f64>,
}

/// Returns the wrench about the origin of the node on which the frame is mounted, in its axes.
pub(super) fn at_slot(placement: &FramePlacement, wrench: &Wrench) -> Spatial {
    let force = placement.rotation * V3::from(wrench.force);
    Spatial {
        linear: force,
        angular: placement.rotation * V3::from(wrench.moment) + placement.position.cross(force),
    }
}
