//! Velocity control of a base's wheels within their limits.

use super::{BaseKind, PlanarTwist, WheelBase, WheelLimits};

/// Computes wheel speeds and steering angles that move a base at a desired velocity, within the limits of the
/// wheels.
///
/// A velocity beyond the limits is scaled down, which preserves the arc. The wheels of a steered base turn
/// towards the desired curvature at the rate of the slowest wheel; at rest they keep their angles. If the
/// desired curvature exceeds the limit, the base drives the tightest possible arc at the commanded forward
/// speed.
#[derive(Clone, Debug)]
pub struct WheelDrive {
    base: WheelBase,
    limits: WheelLimits,
    /// Lowest angle, highest angle \[rad\] and maximum rate \[rad/s\] of the steered wheels.
    steering_limits: Vec<[f64; 3]>,
    curvatures: [f64; 2],
    curvature: f64,
    steering: Vec<f64>,
    steering_rate: Vec<f64>,
    speeds: Vec<f64>,
    desired: Vec<f64>,
    /// Forward velocity of a steered base \[m/s\].
    ahead: f64,
}

/// Number of bisections for a step of the curvature: to within a billionth of the command.
const HALVINGS: usize = 30;

impl WheelDrive {
    /// Creates a drive at rest with straight wheels. `steering` contains the lowest and highest angle \[rad\]
    /// and the maximum rate \[rad/s\] of every wheel, in order; entries of fixed wheels are ignored.
    pub fn new(base: WheelBase, limits: WheelLimits, steering: Vec<[f64; 3]>) -> Self {
        let count = base.wheels().len();
        let mut curvatures = [f64::NEG_INFINITY, f64::INFINITY];
        if base.kind() == BaseKind::Ackermann {
            for (wheel, [lower, upper, _]) in steering.iter().enumerate() {
                let [low, high] = base.curvatures(wheel, *lower, *upper);
                curvatures = [curvatures[0].max(low), curvatures[1].min(high)];
            }
        }
        Self {
            base,
            limits,
            steering_limits: steering,
            curvatures,
            curvature: 0.0,
            steering: vec![0.0; count],
            steering_rate: vec![0.0; count],
            speeds: vec![0.0; count],
            desired: vec![0.0; count],
            ahead: 0.0,
        }
    }

    /// Returns the base.
    pub fn base(&self) -> &WheelBase {
        &self.base
    }

    /// Returns the wheel speeds \[rad/s\], or the velocities of the pose joints \[m/s, rad/s\].
    pub fn speeds(&self) -> &[f64] {
        &self.speeds
    }

    /// Returns the steering angles \[rad\]; 0 for fixed wheels.
    pub fn steering(&self) -> &[f64] {
        &self.steering
    }

    /// Returns the rates of the steering angles \[rad/s\].
    pub fn steering_rate(&self) -> &[f64] {
        &self.steering_rate
    }

    /// Returns the lowest and highest curvature that the steering allows \[1/m\].
    pub fn curvatures(&self) -> [f64; 2] {
        self.curvatures
    }

    /// Resets the drive to rest, with the steered wheels at the measured angles `steering` \[rad\].
    pub fn begin(&mut self, steering: &[f64]) {
        self.speeds.fill(0.0);
        self.steering_rate.fill(0.0);
        (self.ahead, self.curvature) = (0.0, 0.0);
        if self.base.kind() == BaseKind::Ackermann {
            // the mean over the steered wheels
            let (mut sum, mut count) = (0.0, 0.0);
            for (wheel, angle) in steering.iter().enumerate() {
                if self.base.wheels()[wheel].steered {
                    sum += self.base.curvatures(wheel, *angle, *angle)[0];
                    count += 1.0;
                }
            }
            self.curvature = (sum / count).clamp(self.curvatures[0], self.curvatures[1]);
            self.steer();
        }
    }

    /// Moves the wheel speeds towards the velocity `twist` for a time step `dt` \[s\]. `yaw` \[rad\] matters
    /// only for a base with pose joints. Returns `true` once the velocity is reached.
    pub fn follow(&mut self, twist: &PlanarTwist, yaw: f64, dt: f64) -> bool {
        match self.base.kind() {
            BaseKind::Ackermann => self.follow_steered(twist, dt),
            kind => {
                let twist = self.base.feasible(twist);
                let twist = if kind == BaseKind::Planar { turned(&twist, yaw) } else { twist };
                self.base.speeds(&twist, &[], &mut self.desired);
                let factor = self.limits.speed_factor(&self.desired);
                self.desired.iter_mut().for_each(|speed| *speed *= factor);
                self.limits.approach(&mut self.speeds, &self.desired, dt) && factor == 1.0
            }
        }
    }

    fn follow_steered(&mut self, twist: &PlanarTwist, dt: f64) -> bool {
        let requested = match (twist.x, twist.yaw) {
            (0.0, 0.0) => self.curvature,
            (x, yaw) => yaw / x,
        };
        let requested = if requested.is_nan() { self.curvature } else { requested };
        let curvature = requested.clamp(self.curvatures[0], self.curvatures[1]);
        let before = self.curvature;
        let (mut share, mut step) = (1.0, 0.5);
        if !self.reaches(before, curvature, dt) {
            share = 0.0;
            for _ in 0..HALVINGS {
                if self.reaches(before, before + (share + step) * (curvature - before), dt) {
                    share += step;
                }
                step *= 0.5;
            }
        }
        self.curvature = before + share * (curvature - before);
        for wheel in 0..self.steering.len() {
            let angle = self.base.steering(wheel, self.curvature);
            self.steering_rate[wheel] = (angle - self.steering[wheel]) / dt;
        }
        self.steer();
        // wheel speeds at 1 m/s forwards
        let unit = self.base.feasible(&PlanarTwist { x: 1.0, y: 0.0, yaw: self.curvature });
        self.base.speeds(&unit, &self.steering, &mut self.desired);
        let mut change = f64::INFINITY;
        let mut fastest = f64::INFINITY;
        for (wheel, unit) in self.desired.iter().enumerate() {
            change = change.min(self.limits.acceleration[wheel] * dt / unit.abs());
            fastest = fastest.min(self.limits.speed[wheel] / unit.abs());
        }
        let ahead = twist.x.clamp(-fastest, fastest);
        self.ahead = ahead.clamp(self.ahead - change, self.ahead + change);
        self.speeds.iter_mut().zip(&self.desired).for_each(|(speed, unit)| *speed = self.ahead * unit);
        share == 1.0 && self.ahead == twist.x && curvature == requested
    }

    /// Returns `true` if every steered wheel can change from one curvature to another in a time step.
    fn reaches(&self, from: f64, to: f64, dt: f64) -> bool {
        let limits = self.steering_limits.iter().enumerate();
        limits.filter(|(wheel, _)| self.base.wheels()[*wheel].steered).all(|(wheel, [_, _, rate])| {
            (self.base.steering(wheel, to) - self.base.steering(wheel, from)).abs() <= rate * dt
        })
    }

    fn steer(&mut self) {
        for wheel in 0..self.steering.len() {
            self.steering[wheel] = self.base.steering(wheel, self.curvature);
        }
    }
}

/// Rotates a velocity from base axes to world axes, for a base at angle `yaw`.
fn turned(twist: &PlanarTwist, yaw: f64) -> PlanarTwist {
    let (sin, cos) = yaw.sin_cos();
    PlanarTwist { x: cos * twist.x - sin * twist.y, y: sin * twist.x + cos * twist.y, yaw: twist.yaw }
}
