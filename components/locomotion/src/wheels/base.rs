//! Kinematics of a wheeled base.

use motorium_control::with_defaults;
use nalgebra::{Matrix3, Vector3};

use super::PlanarTwist;

with_defaults! {
    /// A wheel, in the axes of the base.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Wheel;

    /// Position of the wheel centre \[m\].
    pub position: [f64; 2] = [0.0; 2];
    /// Radius of the wheel \[m\].
    pub radius: f64 = 1.0;
    /// `true` if the wheel is steered.
    pub steered: bool = false;
    /// Tangent of the roller angle of a mecanum wheel, 1 or -1; 0 for a plain wheel.
    pub rollers: f64 = 0.0;
}

/// Drive type of a wheeled base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaseKind {
    /// Wheels on one axle, or in a left and a right row, with independent speeds.
    Differential,
    /// Steered wheels whose axes meet in one centre of rotation on the axle line of the fixed wheels.
    Ackermann,
    /// Mecanum wheels, which allow any planar velocity.
    Mecanum,
    /// Three joints that form the pose of the base: x, y, yaw.
    Planar,
}

/// Error returned when the wheels do not suit the kind of base.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WheelError {
    /// There are too few fixed wheels.
    #[error("found {found} fixed wheels, expected at least two, one on each side")]
    Fixed {
        /// Number of fixed wheels.
        found: usize,
    },
    /// There is no steered wheel.
    #[error("found no steered wheel, expected at least one")]
    Steered,
    /// All fixed wheels are on one line along x.
    #[error("all fixed wheels are on one line, so their speeds do not determine the rotation of the base")]
    OneLine,
    /// A steered wheel is on the axle of the fixed wheels.
    #[error("steered wheel {wheel} is on the axle of the fixed wheels, where it cannot steer the base")]
    OnAxle {
        /// Index of the wheel.
        wheel: usize,
    },
    /// The speeds of the mecanum wheels do not determine the velocity of the base.
    #[error("the positions of the mecanum wheels do not determine the velocity of the base")]
    Mecanum,
    /// A radius is not positive.
    #[error("wheel {wheel} has a radius of {found} m, expected a positive number")]
    Radius {
        /// Index of the wheel.
        wheel: usize,
        /// Radius found \[m\].
        found: f64,
    },
}

/// A wheeled base that rolls without slip.
#[derive(Clone, Debug, PartialEq)]
pub struct WheelBase {
    kind: BaseKind,
    wheels: Vec<Wheel>,
    /// Position of the axle, where the base cannot move sideways, x \[m\].
    axle: f64,
    /// Displacement of the base per unit of each wheel angle.
    ways: Vec<Vector3<f64>>,
}

impl WheelBase {
    /// Creates a base with fixed wheels.
    ///
    /// # Errors
    /// [`WheelError`] if there are fewer than two wheels, or all are on one line along x.
    pub fn differential(wheels: Vec<Wheel>) -> Result<Self, WheelError> {
        Self::rolling(BaseKind::Differential, wheels)
    }

    /// Creates a base with fixed and steered wheels, any of which may be driven.
    ///
    /// # Errors
    /// [`WheelError`] if there is no steered wheel, if a steered wheel is on the axle of the fixed wheels, or
    /// if there are too few fixed wheels.
    pub fn ackermann(wheels: Vec<Wheel>) -> Result<Self, WheelError> {
        let base = Self::rolling(BaseKind::Ackermann, wheels)?;
        if !base.wheels.iter().any(|wheel| wheel.steered) {
            return Err(WheelError::Steered);
        }
        let on_axle = |wheel: &Wheel| wheel.steered && (wheel.position[0] - base.axle).abs() < 1e-6;
        match base.wheels.iter().position(on_axle) {
            Some(wheel) => Err(WheelError::OnAxle { wheel }),
            None => Ok(base),
        }
    }

    /// Creates a base with mecanum wheels.
    ///
    /// # Errors
    /// [`WheelError`] if the wheel speeds do not determine the velocity of the base.
    pub fn mecanum(wheels: Vec<Wheel>) -> Result<Self, WheelError> {
        check_radii(&wheels)?;
        let row = |wheel: &Wheel| {
            let [x, y] = wheel.position;
            Vector3::new(1.0, wheel.rollers, wheel.rollers * x - y)
        };
        let normal: Matrix3<f64> = wheels.iter().map(|wheel| row(wheel) * row(wheel).transpose()).sum();
        let values = normal.symmetric_eigenvalues();
        if wheels.len() < 3 || values.min() < 1e-9 * values.max() {
            return Err(WheelError::Mecanum);
        }
        let inverse = normal.try_inverse().ok_or(WheelError::Mecanum)?;
        let ways = wheels.iter().map(|wheel| inverse * row(wheel) * wheel.radius).collect();
        Ok(Self { kind: BaseKind::Mecanum, wheels, axle: 0.0, ways })
    }

    /// Creates a base whose pose is given by three joints, x, y and yaw. The velocities of these joints are
    /// treated as wheel speeds.
    pub fn planar() -> Self {
        let ways = vec![Vector3::x(), Vector3::y(), Vector3::z()];
        Self { kind: BaseKind::Planar, wheels: vec![Wheel::default(); 3], axle: 0.0, ways }
    }

    fn rolling(kind: BaseKind, wheels: Vec<Wheel>) -> Result<Self, WheelError> {
        check_radii(&wheels)?;
        let fixed: Vec<Wheel> = wheels.iter().filter(|wheel| !wheel.steered).copied().collect();
        if fixed.len() < 2 {
            return Err(WheelError::Fixed { found: fixed.len() });
        }
        let count = fixed.len() as f64;
        let axle = fixed.iter().map(|wheel| wheel.position[0]).sum::<f64>() / count;
        let middle = fixed.iter().map(|wheel| wheel.position[1]).sum::<f64>() / count;
        let spread: f64 = fixed.iter().map(|wheel| (wheel.position[1] - middle).powi(2)).sum();
        if spread < 1e-12 {
            return Err(WheelError::OneLine);
        }
        // straight line through (y, distance rolled by the wheel): its slope is the rotation, its value at
        // y = 0 the distance ahead
        let ways = wheels.iter().map(|wheel| {
            if wheel.steered {
                return Vector3::zeros();
            }
            let turn = -(wheel.position[1] - middle) / spread;
            wheel.radius * Vector3::new(1.0 / count + middle * turn, -axle * turn, turn)
        });
        let ways = ways.collect();
        Ok(Self { kind, wheels, axle, ways })
    }

    /// Returns the kind of base.
    pub fn kind(&self) -> BaseKind {
        self.kind
    }

    /// Returns the wheels of the base.
    pub fn wheels(&self) -> &[Wheel] {
        &self.wheels
    }

    /// Projects `twist` onto the velocities that the wheels allow without slip. A base that cannot move
    /// sideways has no lateral velocity at the axle. The curvature limits of a steered base are ignored; see
    /// [`curvatures`](Self::curvatures).
    #[must_use]
    pub fn feasible(&self, twist: &PlanarTwist) -> PlanarTwist {
        match self.kind {
            BaseKind::Differential | BaseKind::Ackermann => {
                PlanarTwist { y: -twist.yaw * self.axle, ..*twist }
            }
            BaseKind::Mecanum | BaseKind::Planar => *twist,
        }
    }

    /// Writes the wheel speeds \[rad/s\] that move the base at `twist` with the given steering angles
    /// \[rad\]. `steering` may be empty if no wheel is steered. For a planar base with pose joints, writes
    /// the joint speeds at yaw 0.
    pub fn speeds(&self, twist: &PlanarTwist, steering: &[f64], speeds: &mut [f64]) {
        if self.kind == BaseKind::Planar {
            speeds.copy_from_slice(&[twist.x, twist.y, twist.yaw]);
            return;
        }
        for (index, (speed, wheel)) in speeds.iter_mut().zip(&self.wheels).enumerate() {
            let [x, y] = wheel.position;
            let (ahead, aside) = (twist.x - twist.yaw * y, twist.y + twist.yaw * x);
            let (sin, cos) = steering.get(index).copied().unwrap_or(0.0).sin_cos();
            *speed = match self.kind {
                BaseKind::Mecanum => ahead + wheel.rollers * aside,
                _ => ahead * cos + aside * sin,
            } / wheel.radius;
        }
    }

    /// Returns the angle of a steered wheel \[rad\] for a path curvature \[1/m\] at the middle of the axle.
    /// Returns 0 for a fixed wheel.
    pub fn steering(&self, wheel: usize, curvature: f64) -> f64 {
        let Wheel { position: [x, y], steered, .. } = self.wheels[wheel];
        if !steered {
            return 0.0;
        }
        (curvature * (x - self.axle)).atan2(1.0 - curvature * y)
    }

    /// Returns the range of path curvatures \[1/m\] that a steered wheel allows at angles from `lower` to
    /// `upper` \[rad\]; unlimited for a fixed wheel.
    pub fn curvatures(&self, wheel: usize, lower: f64, upper: f64) -> [f64; 2] {
        let Wheel { position: [x, y], steered, .. } = self.wheels[wheel];
        if !steered {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        let curvature = |angle: f64| {
            // limited to the angle at which the centre of rotation is on the wheel's own line
            let tangent = angle.clamp(-1.5, 1.5).tan();
            tangent / (x - self.axle + y * tangent)
        };
        let (one, other) = (curvature(lower), curvature(upper));
        [one.min(other), one.max(other)]
    }

    /// Returns the displacement of the base, in base axes, while the wheels turn at constant speed by the
    /// angles `turned` \[rad\].
    pub fn way(&self, turned: &[f64]) -> PlanarTwist {
        let way: Vector3<f64> = self.ways.iter().zip(turned).map(|(way, angle)| way * *angle).sum();
        PlanarTwist { x: way.x, y: way.y, yaw: way.z }
    }

    /// Returns the covariance of the [displacement](Self::way) for independent variances of the distance
    /// rolled by each wheel \[m2\].
    pub(super) fn covariance(&self, variance: impl Fn(usize) -> f64) -> Matrix3<f64> {
        let of_wheel = |(index, way): (usize, &Vector3<f64>)| {
            let per_metre = way / self.wheels[index].radius;
            per_metre * per_metre.transpose() * variance(index)
        };
        self.ways.iter().enumerate().map(of_wheel).sum()
    }
}

fn check_radii(wheels: &[Wheel]) -> Result<(), WheelError> {
    let wrong = |wheel: &Wheel| !(wheel.radius.is_finite() && wheel.radius > 0.0);
    match wheels.iter().position(wrong) {
        Some(wheel) => Err(WheelError::Radius { wheel, found: wheels[wheel].radius }),
        None => Ok(()),
    }
}
