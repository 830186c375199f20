//! Attitude from gyroscope and accelerometer.

use motorium_robots::lie::so3;
use nalgebra::{UnitQuaternion, Vector3};

/// A complementary filter for attitude. The filter follows the gyroscope at high frequencies and the
/// direction of gravity at low frequencies.
///
/// ```text
/// e = f / |f| x R' z        dR/dt = R (omega - b + kp e)^        db/dt = -ki e
/// ```
///
/// The inputs are the angular velocity `omega` and the specific force `f` in the axes of the sensor. The
/// filter estimates the attitude `R` of the sensor in the world (z up) and the bias `b` of the gyroscope.
/// This is the explicit complementary filter of Mahony, Hamel and Pflimlin (IEEE TAC 53(5), 2008). Yaw is
/// integrated from the gyroscope alone. The filter ignores a specific force whose magnitude differs from
/// gravity by more than the fraction `tolerance`.
///
/// ```
/// use motorium_sensors::estimation::ComplementaryFilter;
/// use nalgebra::Vector3;
///
/// let mut filter = ComplementaryFilter::new(1.0, 0.0);
/// // At rest, tilted by 0.2 rad about x.
/// let force = Vector3::new(0.0, 9.81 * 0.2_f64.sin(), 9.81 * 0.2_f64.cos());
/// for _ in 0..10_000 {
///     filter.update(&Vector3::zeros(), &force, 1e-3);
/// }
/// assert!((filter.attitude().euler_angles().0 - 0.2).abs() < 1e-3, "rad");
/// ```
#[derive(Clone, Debug)]
pub struct ComplementaryFilter {
    kp: f64,
    ki: f64,
    tolerance: f64,
    gravity: f64,
    attitude: UnitQuaternion<f64>,
    bias: Vector3<f64>,
}

impl ComplementaryFilter {
    /// Creates a filter that starts level. The attitude gain `kp` \[1/s\] is the crossover frequency of the
    /// two sensors in rad/s; `ki` \[1/s2\] is the gain of the gyroscope bias.
    pub fn new(kp: f64, ki: f64) -> Self {
        let (attitude, bias) = (UnitQuaternion::identity(), Vector3::zeros());
        Self { kp, ki, tolerance: 0.5, gravity: 9.81, attitude, bias }
    }

    /// Sets the maximum deviation of the specific force from gravity, as a fraction of gravity, beyond which
    /// a sample is ignored. Default 0.5; infinity uses every sample.
    pub fn with_tolerance(mut self, tolerance: f64) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// Restarts from an attitude, with a bias of zero.
    pub fn reset(&mut self, attitude: UnitQuaternion<f64>) {
        (self.attitude, self.bias) = (attitude, Vector3::zeros());
    }

    /// Advances by `dt` \[s\] with an angular velocity \[rad/s\] and a specific force \[m/s2\] in the axes of
    /// the sensor.
    pub fn update(&mut self, angular_velocity: &Vector3<f64>, specific_force: &Vector3<f64>, dt: f64) {
        let size = specific_force.norm();
        let mut error = Vector3::zeros();
        if size > 0.0 && (size - self.gravity).abs() <= self.tolerance * self.gravity {
            let up = self.attitude.inverse_transform_vector(&Vector3::z());
            error = (specific_force / size).cross(&up);
        }
        let rate = angular_velocity - self.bias + error * self.kp;
        self.bias -= error * (self.ki * dt);
        self.attitude = UnitQuaternion::new_normalize((self.attitude * so3::exp(&(rate * dt))).into_inner());
    }

    /// Returns the attitude of the sensor in the world.
    pub fn attitude(&self) -> UnitQuaternion<f64> {
        self.attitude
    }

    /// Returns the bias of the gyroscope \[rad/s\].
    pub fn bias(&self) -> Vector3<f64> {
        self.bias
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_rest(attitude: &UnitQuaternion<f64>) -> Vector3<f64> {
        attitude.inverse_transform_vector(&Vector3::new(0.0, 0.0, 9.81))
    }

    #[test]
    fn follows_a_turning_sensor_exactly_without_noise() {
        let (mut filter, mut truth) = (ComplementaryFilter::new(0.5, 0.05), UnitQuaternion::identity());
        for k in 0..5000_u32 {
            let t = 1e-3 * f64::from(k);
            let omega = Vector3::new(t.sin(), 0.7 * (1.3 * t).cos(), 0.4);
            truth *= so3::exp(&(omega * 1e-3));
            // the force at the end of one step is the force at the start of the next
            filter.update(&omega, &at_rest(&(truth * so3::exp(&(-omega * 1e-3)))), 1e-3);
        }
        assert!(filter.attitude().angle_to(&truth) < 1e-9, "{}", filter.attitude().angle_to(&truth));
        assert!(filter.bias().norm() < 1e-9);
    }

    #[test]
    fn small_tilt_decays_at_the_rate_kp() {
        let mut filter = ComplementaryFilter::new(2.0, 0.0);
        filter.reset(UnitQuaternion::from_euler_angles(0.01, 0.0, 0.0));
        for _ in 0..1000 {
            filter.update(&Vector3::zeros(), &Vector3::new(0.0, 0.0, 9.81), 1e-3);
        }
        let expected = 0.01 * (-2.0_f64).exp();
        assert!((filter.attitude().euler_angles().0 / expected - 1.0).abs() < 2e-3);
    }

    #[test]
    fn estimates_the_horizontal_gyroscope_bias() {
        let mut filter = ComplementaryFilter::new(1.0, 0.3);
        let bias = Vector3::new(0.02, -0.01, 0.0);
        for _ in 0..60_000 {
            filter.update(&bias, &Vector3::new(0.0, 0.0, 9.81), 1e-3);
        }
        assert!((filter.bias() - bias).norm() < 1e-6, "{}", filter.bias());
        assert!(filter.attitude().angle() < 1e-6);
    }

    #[test]
    fn implausible_force_does_not_change_the_tilt() {
        let mut filter = ComplementaryFilter::new(1.0, 0.1);
        for _ in 0..1000 {
            filter.update(&Vector3::zeros(), &Vector3::new(20.0, 0.0, 9.81), 1e-3);
            filter.update(&Vector3::zeros(), &Vector3::zeros(), 1e-3);
        }
        assert_eq!(filter.attitude(), UnitQuaternion::identity());
    }
}
