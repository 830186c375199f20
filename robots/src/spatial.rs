//! Spatial vectors: linear part first, then angular.

use nalgebra::{Vector3, Vector6};

/// The point a spatial velocity is taken at and the axes it is expressed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reference {
    /// Point: the frame's origin. Axes: the frame's.
    Local,
    /// Point: the world's origin. Axes: the world's.
    World,
    /// Point: the frame's origin. Axes: the world's. The natural choice for tasks in metres and radians.
    LocalWorldAligned,
}

/// A spatial velocity, or an acceleration in the units of one per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// Velocity of the reference point \[m/s\].
    pub linear: Vector3<f64>,
    /// Angular velocity \[rad/s\].
    pub angular: Vector3<f64>,
}

impl Twist {
    /// Nothing moves.
    pub fn zero() -> Self {
        Self { linear: Vector3::zeros(), angular: Vector3::zeros() }
    }

    /// Six numbers, linear first: comparable to a Jacobian times a joint velocity.
    pub fn vector(&self) -> Vector6<f64> {
        let (l, a) = (&self.linear, &self.angular);
        Vector6::new(l.x, l.y, l.z, a.x, a.y, a.z)
    }
}
