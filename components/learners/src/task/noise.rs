//! Noise of the measurements that a policy observes.

use motorium_models::policy::BaseMotion;
use rand::{Rng, RngExt as _};
use serde::Deserialize;

use super::TaskError;
use crate::random::{Counter, Purpose};

/// Noise of the measurements that a policy observes in training, as the maximum error of each quantity.
/// Errors are uniformly distributed, and independent for each number and each step. Rewards and terminations
/// use true states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeasurementNoise {
    /// Maximum error of joint positions \[rad or m\]. Default: 0.
    pub joint_positions: f64,
    /// Maximum error of joint velocities \[rad/s or m/s\]. Default: 0.
    pub joint_velocities: f64,
    /// Maximum error of the velocity of the base \[m/s\]. Default: 0.
    pub base_linear_velocity: f64,
    /// Maximum error of the angular velocity of the base \[rad/s\]. Default: 0.
    pub base_angular_velocity: f64,
    /// Maximum error of each component of the gravity direction, a unit vector in base axes. Default: 0.
    pub projected_gravity: f64,
}

impl MeasurementNoise {
    /// Checks all numbers.
    pub(super) fn check(&self) -> Result<(), TaskError> {
        for (key, number) in [
            ("joint_positions", self.joint_positions),
            ("joint_velocities", self.joint_velocities),
            ("base_linear_velocity", self.base_linear_velocity),
            ("base_angular_velocity", self.base_angular_velocity),
            ("projected_gravity", self.projected_gravity),
        ] {
            if !(number >= 0.0 && number.is_finite()) {
                return Err(TaskError::value(format!("noise.{key}"), number, "at least 0"));
            }
        }
        Ok(())
    }
}

/// Adds uniformly distributed noise between `-most` and `most` to each number.
fn disturb(numbers: &mut [f64], most: f64, random: &mut impl Rng) {
    for number in numbers {
        let share: f64 = random.random();
        *number += most * (2.0 * share - 1.0);
    }
}

/// Measured states of a robot. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub(super) struct NoisyState {
    noise: MeasurementNoise,
    positions: Vec<f64>,
    velocities: Vec<f64>,
}

impl NoisyState {
    /// Creates buffers for the measurements of a robot.
    pub(super) fn new(noise: MeasurementNoise, joints: usize) -> Self {
        let zeros = vec![0.0; joints];
        Self { noise, positions: zeros.clone(), velocities: zeros }
    }

    /// Measures a state: positions and velocities of the joints, and the motion of the base. The counter
    /// determines the noise.
    pub(super) fn measure(
        &mut self,
        counter: Counter,
        (positions, velocities, mut base): (&[f64], &[f64], BaseMotion),
    ) -> (&[f64], &[f64], BaseMotion) {
        let noise = self.noise;
        let mut random = counter.stream(Purpose::Measurement);
        self.positions.copy_from_slice(positions);
        self.velocities.copy_from_slice(velocities);
        disturb(&mut self.positions, noise.joint_positions, &mut random);
        disturb(&mut self.velocities, noise.joint_velocities, &mut random);
        disturb(&mut base.linear_velocity, noise.base_linear_velocity, &mut random);
        disturb(&mut base.angular_velocity, noise.base_angular_velocity, &mut random);
        disturb(&mut base.gravity, noise.projected_gravity, &mut random);
        (&self.positions, &self.velocities, base)
    }
}
