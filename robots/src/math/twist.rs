//! Spatial velocities: linear part first, then angular.

use std::ops::{Add, Mul, Neg, Sub};

use nalgebra::{Vector3, Vector6};

/// Reference point and axes in which a spatial velocity is expressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reference {
    /// At the frame's origin, in the frame's axes.
    Local,
    /// At the world's origin, in world axes.
    World,
    /// At the frame's origin, in world axes. Usual choice for targets in the world.
    LocalWorldAligned,
}

/// A spatial velocity (linear and angular), or an acceleration in the same units per second.
///
/// ```
/// use motorium_robots::Twist;
/// use nalgebra::Vector3;
///
/// let twist = Twist { linear: Vector3::x(), angular: Vector3::z() } * 0.5 + Twist::default();
/// assert_eq!(twist.vector().as_slice(), [0.5, 0.0, 0.0, 0.0, 0.0, 0.5]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Velocity of the reference point \[m/s\].
    pub linear: Vector3<f64>,
    /// Angular velocity \[rad/s\].
    pub angular: Vector3<f64>,
}

impl Twist {
    /// Returns the twist of a frame at rest.
    pub fn zero() -> Self {
        Self::default()
    }

    /// Returns the six components, linear part first, in the order of the rows of a Jacobian.
    pub fn vector(&self) -> Vector6<f64> {
        let (l, a) = (&self.linear, &self.angular);
        Vector6::new(l.x, l.y, l.z, a.x, a.y, a.z)
    }
}

impl From<Vector6<f64>> for Twist {
    /// Six numbers, linear first.
    fn from(vector: Vector6<f64>) -> Self {
        let (linear, angular) = (vector.fixed_rows::<3>(0), vector.fixed_rows::<3>(3));
        Self { linear: linear.into_owned(), angular: angular.into_owned() }
    }
}

impl Add for Twist {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { linear: self.linear + other.linear, angular: self.angular + other.angular }
    }
}

impl Sub for Twist {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { linear: self.linear - other.linear, angular: self.angular - other.angular }
    }
}

impl Neg for Twist {
    type Output = Self;

    fn neg(self) -> Self {
        Self { linear: -self.linear, angular: -self.angular }
    }
}

impl Mul<f64> for Twist {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { linear: self.linear * factor, angular: self.angular * factor }
    }
}
