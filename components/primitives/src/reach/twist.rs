//! Linear and angular motion together.

use std::ops::{Add, Mul};

use nalgebra::Vector3;

/// Velocity or acceleration of the hand in world axes: of its origin (m/s or m/s^2), and angular (rad/s or rad/s^2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Of the origin.
    pub linear: Vector3<f64>,
    /// Angular.
    pub angular: Vector3<f64>,
}

impl Mul<f64> for Twist {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { linear: self.linear * factor, angular: self.angular * factor }
    }
}

impl Add for Twist {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}
