//! Limits of joints with followers, such that both the joint and its followers stay within their own limits.

use super::{Body, Coordinate, Joint, Limits};

/// Relative difference below which two ends of a range count as equal, to tolerate the rounding of a
/// division.
const SAME: f64 = 1e-9;

impl Joint {
    /// Returns the lowest and highest position of the leader at which this joint is within its own limits
    /// \[rad or m\]. `None` for an independent joint and for a joint that its leader does not move.
    pub(crate) fn range_of_leader(&self) -> Option<[f64; 2]> {
        let Coordinate::Mimic { multiplier, offset, .. } = self.coordinate else { return None };
        if multiplier == 0.0 {
            return None;
        }
        let [a, b] = [self.limits.lower, self.limits.upper].map(|end| (end - offset) / multiplier);
        Some([a.min(b), a.max(b)])
    }

    /// Returns the velocity of the leader at which this joint moves at its own limit \[rad/s or m/s\]. `None`
    /// as for the range, and for a limit of 0, which files use for unknown limits of followers.
    pub(crate) fn velocity_of_leader(&self) -> Option<f64> {
        let Coordinate::Mimic { multiplier, .. } = self.coordinate else { return None };
        (multiplier != 0.0 && self.limits.velocity > 0.0).then(|| self.limits.velocity / multiplier.abs())
    }
}

/// Returns the limits of every independent joint, narrowed such that its followers stay within their own
/// limits.
///
/// A follower whose range has no common position with its leader's does not narrow the limits: some files
/// limit a follower to a point.
pub(super) fn common_limits(bodies: &[Body], joint_bodies: &[usize]) -> Vec<Limits> {
    let mut common: Vec<Limits> = joint_bodies.iter().map(|&body| bodies[body].joint.limits).collect();
    for joint in bodies.iter().map(|body| &body.joint) {
        let own = &mut common[joint.coordinate.index()];
        if let Some([low, high]) = joint.range_of_leader()
            && low.max(own.lower) <= high.min(own.upper)
        {
            if is_below(own.lower, low) {
                own.lower = low;
            }
            if is_below(high, own.upper) {
                own.upper = high;
            }
        }
        if let Some(velocity) = joint.velocity_of_leader()
            && is_below(velocity, own.velocity)
        {
            own.velocity = velocity;
        }
    }
    common
}

/// Returns `true` if `a` is below `b` by more than rounding.
pub(crate) fn is_below(a: f64, b: f64) -> bool {
    a < b && (a.is_infinite() || b.is_infinite() || b - a > SAME * a.abs().max(b.abs()))
}
