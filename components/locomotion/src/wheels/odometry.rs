//! Dead reckoning from the rotations of wheels.

use nalgebra::Matrix3;

use super::{PlanarPose, PlanarTwist, WheelBase};

/// Pose of a base with its uncertainty, integrated from wheel angles along exact arcs.
///
/// The odometry assumes rolling without slip, with the nominal radii and wheel positions. The velocity
/// between two samples is assumed constant in base axes, so on an arc the sample period has no effect. Slip
/// is modelled as random and independent per wheel, with the standard deviation `slip * sqrt(distance)`
/// (`slip` in m for 1 m travelled). Systematic errors of radius or track are not included.
#[derive(Clone, Debug, PartialEq)]
pub struct Odometry {
    pose: PlanarPose,
    covariance: Matrix3<f64>,
    distance: f64,
    slip: f64,
}

impl Default for Odometry {
    /// Starts at the origin, with a slip of 3 mm per 1 m travelled.
    fn default() -> Self {
        Self::new(PlanarPose::default(), 0.003)
    }
}

impl Odometry {
    /// Creates an odometry that starts at an exactly known pose. `slip` is the standard deviation \[m\] after
    /// 1 m travelled.
    pub fn new(pose: PlanarPose, slip: f64) -> Self {
        Self { pose, covariance: Matrix3::zeros(), distance: 0.0, slip }
    }

    /// Advances the pose by the displacement for the wheel rotations `turned` \[rad\], and returns the
    /// displacement.
    pub fn advance(&mut self, base: &WheelBase, turned: &[f64]) -> PlanarTwist {
        let way = base.way(turned);
        let slip = self.slip * self.slip;
        let noise = base.covariance(|wheel| slip * (base.wheels()[wheel].radius * turned[wheel]).abs());
        let before = self.pose;
        self.pose = before.after(&way);
        self.distance += way.x.hypot(way.y);
        // a previous heading error rotates the displacement; the displacement's own error is in the axes
        // half-way along it
        let mut swing = Matrix3::identity();
        swing[(0, 2)] = -(self.pose.y - before.y);
        swing[(1, 2)] = self.pose.x - before.x;
        let (sin, cos) = (before.yaw + 0.5 * way.yaw).sin_cos();
        let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        self.covariance = swing * self.covariance * swing.transpose() + turn * noise * turn.transpose();
        way
    }

    /// Creates an odometry that continues from an earlier pose, covariance and distance travelled \[m\].
    pub fn resumed(pose: PlanarPose, covariance: Matrix3<f64>, distance: f64, slip: f64) -> Self {
        Self { pose, covariance, distance, slip }
    }

    /// Sets a pose measured by pose joints, which has no wheel error. `moved` is `true` if the base moved
    /// since the previous pose.
    pub fn set_pose(&mut self, pose: PlanarPose, moved: bool) {
        if moved {
            self.distance += (pose.x - self.pose.x).hypot(pose.y - self.pose.y);
        }
        self.pose = pose;
    }

    /// Returns the pose.
    pub fn pose(&self) -> PlanarPose {
        self.pose
    }

    /// Returns the covariance of x, y \[m2\] and yaw \[rad2\].
    pub fn covariance(&self) -> &Matrix3<f64> {
        &self.covariance
    }

    /// Returns the total distance travelled by the base's origin \[m\].
    pub fn distance(&self) -> f64 {
        self.distance
    }
}
