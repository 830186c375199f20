//! Wheeled bases: exact planar kinematics, limits that preserve the curvature, odometry.
//!
//! ```text
//! speed of a wheel at (x, y), steered by d:   r w = (vx - wz y) cos d + (vy + wz x) sin d
//! no sideways motion of an axle at x = a:     vy = -wz a
//! ```
//!
//! - [`WheelBase`] converts the velocity of a base to speeds and angles of its wheels, and wheel rotations to
//!   the displacement of the base.
//! - [`WheelDrive`] moves the wheels towards a velocity of the base, within their limits of speed,
//!   acceleration and steering.
//! - [`RobotWheels`] turns the velocity of a robot's base into the setpoints of all its joints.
//! - [`Odometry`] integrates the displacement. It assumes rolling without slip, along an arc between two
//!   samples; only the covariance models slip.
//!
//! ```
//! use motorium_locomotion::wheels::{Odometry, PlanarTwist, Wheel, WheelBase};
//!
//! let wheel = |y| Wheel { position: [0.0, y], radius: 0.033, ..Wheel::default() };
//! let base = WheelBase::differential(vec![wheel(0.08), wheel(-0.08)])?;
//! let mut speeds = [0.0; 2];
//! base.speeds(&PlanarTwist { x: 0.2, y: 0.0, yaw: 0.5 }, &[], &mut speeds);
//! assert!((speeds[1] - (0.2 + 0.5 * 0.08) / 0.033).abs() < 1e-12);
//!
//! // half a turn on an arc of 0.4 m radius, in one sample
//! let seconds = std::f64::consts::PI / 0.5;
//! let mut odometry = Odometry::default();
//! odometry.advance(&base, &[speeds[0] * seconds, speeds[1] * seconds]);
//! assert!((odometry.pose().y - 0.8).abs() < 1e-12 && odometry.pose().x.abs() < 1e-12);
//! # Ok::<(), motorium_locomotion::wheels::WheelError>(())
//! ```

mod base;
mod config;
mod drive;
mod limits;
mod odometry;
mod robot;

pub use base::{BaseKind, Wheel, WheelBase, WheelError};
pub use config::{StartConfig, WheelsConfig};
pub use drive::WheelDrive;
pub use limits::WheelLimits;
pub use odometry::Odometry;
pub use robot::{BaseJoint, RobotWheels, RobotWheelsError};

/// A planar velocity in base axes, or a displacement at constant velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanarTwist {
    /// Forwards \[m/s, or m\].
    pub x: f64,
    /// To the left \[m/s, or m\].
    pub y: f64,
    /// Counterclockwise \[rad/s, or rad\].
    pub yaw: f64,
}

impl PlanarTwist {
    /// Returns the motion along the same arc, `factor` times as fast.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { x: factor * self.x, y: factor * self.y, yaw: factor * self.yaw }
    }
}

/// A planar pose. The angle is unwrapped: it includes whole turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanarPose {
    /// Position along x \[m\].
    pub x: f64,
    /// Position along y \[m\].
    pub y: f64,
    /// Angle about z \[rad\].
    pub yaw: f64,
}

impl PlanarPose {
    /// Returns the pose after a displacement in base axes at constant velocity: the exponential of planar
    /// motions.
    #[must_use]
    pub fn after(self, way: &PlanarTwist) -> Self {
        let [x, y] = chord(way);
        let (sin, cos) = self.yaw.sin_cos();
        Self { x: self.x + cos * x - sin * y, y: self.y + sin * x + cos * y, yaw: self.yaw + way.yaw }
    }
}

/// Returns the end point of a displacement at constant velocity, in the initial axes.
fn chord(way: &PlanarTwist) -> [f64; 2] {
    let half = 0.5 * way.yaw;
    // sin(t) / t and (1 - cos(t)) / t
    let (sine, cosine) = if half.abs() < 1e-4 {
        (1.0 - way.yaw * way.yaw / 6.0, half * (1.0 - way.yaw * way.yaw / 12.0))
    } else {
        (way.yaw.sin() / way.yaw, half.sin().powi(2) / half)
    };
    [sine * way.x - cosine * way.y, cosine * way.x + sine * way.y]
}
