//! The Coriolis matrix of a body or composite.

use crate::math::{M3, RigidInertia, S3, Spatial, V3};

/// The Coriolis matrix of a body or composite, for motions in base coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coriolis {
    /// Linear momentum.
    pub(super) momentum: V3,
    /// `w -> sum m r x (w x velocity)`
    pub(super) moment: M3,
}

impl Coriolis {
    pub(super) const ZERO: Self = Self { momentum: V3::ZERO, moment: M3::ZERO };

    #[inline(always)]
    pub(super) fn new(inertia: &RigidInertia, velocity: Spatial) -> Self {
        let (u, w) = (velocity.linear, velocity.angular);
        // sum m r r'
        let i = &inertia.rotational;
        let half = 0.5 * (i.xx + i.yy + i.zz);
        let spread =
            S3 { xx: half - i.xx, yy: half - i.yy, zz: half - i.zz, xy: -i.xy, xz: -i.xz, yz: -i.yz };
        // sum m r velocity', where a point has the velocity u + w x r
        let arms = M3::outer(inertia.moment, u) - spread.columns() * M3::skew(w);
        let trace = arms.trace();
        let turned = arms.transpose();
        Self {
            momentum: u * inertia.mass + w.cross(inertia.moment),
            moment: M3 {
                x: V3::new(trace, 0.0, 0.0) - turned.x,
                y: V3::new(0.0, trace, 0.0) - turned.y,
                z: V3::new(0.0, 0.0, trace) - turned.z,
            },
        }
    }

    #[inline(always)]
    pub(super) fn add(&mut self, other: &Self) {
        self.momentum += other.momentum;
        self.moment += other.moment;
    }

    #[inline(always)]
    pub(super) fn twice(&self, motion: Spatial) -> Spatial {
        Spatial { linear: motion.angular.cross(self.momentum), angular: self.moment * motion.angular } * 2.0
    }

    /// Returns the angular part of `2 B' motion`; the linear part is zero.
    #[inline(always)]
    pub(super) fn twice_transposed(&self, motion: Spatial) -> V3 {
        (self.momentum.cross(motion.linear) + self.moment.tr_mul(motion.angular)) * 2.0
    }
}
