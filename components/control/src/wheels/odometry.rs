//! Dead reckoning from how far wheels turned.

use nalgebra::Matrix3;

use super::{PlanarPose, PlanarTwist, WheelBase};

/// The pose of a base, added up from the angles of its wheels along exact arcs, and how uncertain it is.
///
/// It assumes that wheels roll without slip, with the radii and places the base has. Between two samples the
/// velocity is taken for constant in the axes of the base, so that on an arc the period of the samples does
/// not matter. What a wheel slips is taken for random, of the standard deviation `slip * sqrt(way)` (`slip`
/// in m for a way of 1 m), each wheel by itself; a wrong radius or track is not random and not in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Odometry {
    pose: PlanarPose,
    covariance: Matrix3<f64>,
    distance: f64,
    slip: f64,
}

impl Default for Odometry {
    /// At the origin, with a slip of 3 mm in a way of 1 m.
    fn default() -> Self {
        Self::new(PlanarPose::default(), 0.003)
    }
}

impl Odometry {
    /// Starts at a pose that is known exactly.
    pub fn new(pose: PlanarPose, slip: f64) -> Self {
        Self { pose, covariance: Matrix3::zeros(), distance: 0.0, slip }
    }

    /// Adds the way for the angles by which the wheels turned \[rad\], and returns it.
    pub fn advance(&mut self, base: &WheelBase, turned: &[f64]) -> PlanarTwist {
        let way = base.way(turned);
        let slip = self.slip * self.slip;
        let noise = base.covariance(|wheel| slip * (base.wheels()[wheel].radius * turned[wheel]).abs());
        let before = self.pose;
        self.pose = before.after(&way);
        self.distance += way.x.hypot(way.y);
        // an error of the angle before swings the way; the error of the way itself lies in the axes half way
        // along it
        let mut swing = Matrix3::identity();
        swing[(0, 2)] = -(self.pose.y - before.y);
        swing[(1, 2)] = self.pose.x - before.x;
        let (sin, cos) = (before.yaw + 0.5 * way.yaw).sin_cos();
        let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        self.covariance = swing * self.covariance * swing.transpose() + turn * noise * turn.transpose();
        way
    }

    /// Goes on from what an earlier one knew.
    pub fn resumed(pose: PlanarPose, covariance: Matrix3<f64>, distance: f64, slip: f64) -> Self {
        Self { pose, covariance, distance, slip }
    }

    /// Takes over a pose that joints measure, which has no error of wheels. `moved` says that the base went
    /// there.
    pub fn place(&mut self, pose: PlanarPose, moved: bool) {
        if moved {
            self.distance += (pose.x - self.pose.x).hypot(pose.y - self.pose.y);
        }
        self.pose = pose;
    }

    /// The pose.
    pub fn pose(&self) -> PlanarPose {
        self.pose
    }

    /// Covariance of x, y \[m2\] and yaw \[rad2\].
    pub fn covariance(&self) -> &Matrix3<f64> {
        &self.covariance
    }

    /// The way of the base's origin so far \[m\].
    pub fn distance(&self) -> f64 {
        self.distance
    }
}
