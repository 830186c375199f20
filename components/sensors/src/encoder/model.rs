//! The joint sensors of a robot, all sampled together.

use std::time::Duration;

use motorium_robots::PerJoint;

use super::settings::{EncoderSettings, SettingsError, VelocitySource, resolve};
use crate::delay::DelayLine;
use crate::noise::Noise;

/// The joint sensors of a robot.
///
/// At every [`sample`](Self::sample), for each joint: position `q* = r round((q + n) / r)` with resolution `r` and
/// noise `n`, so a reading is a whole number of steps; velocity measured with noise, or differentiated from `q*`;
/// effort with noise. The [`reading`](Self::reading) becomes available when the latency is over. All memory is taken by
/// [`new`](Self::new).
#[derive(Clone, Debug)]
pub struct EncoderModel {
    joints: usize,
    resolution: Vec<f64>,
    position: Channel,
    velocity: Velocity,
    effort: Channel,
    line: DelayLine,
}

#[derive(Clone, Debug)]
struct Channel {
    noise: Noise,
    deviations: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Velocity {
    Measured(Channel),
    Differentiated { cutoff_hz: f64, since: Option<u64>, position: Vec<f64>, estimate: Vec<f64> },
}

/// The times of a joint state, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateTimes {
    /// The time for which it is.
    pub state: u64,
    /// Its source time: that of its measurement, as its stamp has it.
    pub source: u64,
}

/// One reading of all sensors, in the order of the joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<'a> {
    /// Time of the sampling, ns.
    pub sampled_at: u64,
    /// Source time of the state that was sampled, as [`sample_state`](EncoderModel::sample_state) was given it, ns.
    pub source: u64,
    /// Positions, rad or m.
    pub position: &'a [f64],
    /// Velocities, rad/s or m/s.
    pub velocity: &'a [f64],
    /// Efforts, N m or N.
    pub effort: &'a [f64],
}

/// A joint state that cannot be sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the joint state has {position} positions, {velocity} velocities and {effort} efforts, the encoder {joints} joints"
)]
pub struct SampleError {
    /// Positions found.
    pub position: usize,
    /// Velocities found.
    pub velocity: usize,
    /// Efforts found.
    pub effort: usize,
    /// Joints of the encoder.
    pub joints: usize,
}

/// The most readings that may be under way at once.
const MOST_FRAMES: u64 = 100_000;

impl EncoderModel {
    /// Sensors for `joints` joints, sampled no more often than every `shortest_period`. `seed` is that of the noise
    /// unless the settings have one.
    ///
    /// # Errors
    /// A list of another length, a number out of range, a latency of more than 100,000 periods.
    pub fn new(
        joints: usize,
        settings: &EncoderSettings,
        seed: u64,
        shortest_period: Duration,
    ) -> Result<Self, SettingsError> {
        let seed = settings.seed.unwrap_or(seed);
        let channel = |name, deviations: &PerJoint, number| {
            Ok(Channel { noise: Noise::new(seed, number), deviations: resolve(name, deviations, joints)? })
        };
        let velocity = match settings.velocity {
            VelocitySource::Measured => {
                Velocity::Measured(channel("velocity_noise", &settings.velocity_noise, 1)?)
            }
            VelocitySource::Differentiated { .. }
                if settings.velocity_noise.values().iter().any(|deviation| *deviation != 0.0) =>
            {
                return Err(SettingsError::NeedlessVelocityNoise);
            }
            VelocitySource::Differentiated { cutoff_hz } if cutoff_hz > 0.0 && cutoff_hz.is_finite() => {
                let (position, estimate) = (vec![0.0; joints], vec![0.0; joints]);
                Velocity::Differentiated { cutoff_hz, since: None, position, estimate }
            }
            VelocitySource::Differentiated { cutoff_hz: value } => {
                let (name, expected) = ("velocity.cutoff_hz", "a positive number");
                return Err(SettingsError::OutOfRange { name, value, expected });
            }
        };
        let latency_ns = settings.latency.ns;
        let period_ns = u64::try_from(shortest_period.as_nanos()).unwrap_or(u64::MAX).max(1);
        let frames = latency_ns / period_ns;
        if frames > MOST_FRAMES {
            return Err(SettingsError::Latency { latency_ns, frames, period_ns, limit: MOST_FRAMES });
        }
        Ok(Self {
            joints,
            resolution: resolve("resolution", &settings.resolution, joints)?,
            position: channel("position_noise", &settings.position_noise, 0)?,
            velocity,
            effort: channel("effort_noise", &settings.effort_noise, 2)?,
            line: DelayLine::new(latency_ns, 3 * joints, period_ns),
        })
    }

    /// Samples the true joint state at a time (ns): `q` (rad or m), `v` (per second), `tau` (N m or N), one number per
    /// joint each.
    ///
    /// # Errors
    /// Slices of another length than the encoder has joints; nothing is sampled then.
    pub fn sample(&mut self, time_ns: u64, q: &[f64], v: &[f64], tau: &[f64]) -> Result<(), SampleError> {
        self.sample_state(time_ns, StateTimes { state: time_ns, source: time_ns }, q, v, tau)
    }

    /// As [`sample`](Self::sample), with the times of the state: that for which it is, by which a velocity is
    /// differentiated (unlike the time of sampling it does not jitter), and its source time.
    ///
    /// # Errors
    /// As there.
    pub fn sample_state(
        &mut self,
        time_ns: u64,
        times: StateTimes,
        q: &[f64],
        v: &[f64],
        tau: &[f64],
    ) -> Result<(), SampleError> {
        let joints = self.joints;
        if [q.len(), v.len(), tau.len()] != [joints; 3] {
            return Err(SampleError { position: q.len(), velocity: v.len(), effort: tau.len(), joints });
        }
        let state_ns = times.state;
        let (position, rest) = self.line.push_noted(time_ns, times.source).split_at_mut(joints);
        let (velocity, effort) = rest.split_at_mut(joints);
        position.copy_from_slice(q);
        self.position.disturb(position);
        for (value, resolution) in position.iter_mut().zip(&self.resolution) {
            if *resolution > 0.0 {
                *value = (*value / resolution).round() * resolution;
            }
        }
        match &mut self.velocity {
            Velocity::Measured(channel) => {
                velocity.copy_from_slice(v);
                channel.disturb(velocity);
            }
            Velocity::Differentiated { cutoff_hz, since, position: previous, estimate } => {
                if since.is_none_or(|since| state_ns < since) {
                    estimate.fill(0.0);
                } else if let Some(elapsed) = since.map(|since| state_ns - since).filter(|ns| *ns > 0) {
                    let dt = elapsed as f64 * 1e-9;
                    let share = -(-std::f64::consts::TAU * *cutoff_hz * dt).exp_m1();
                    for ((estimate, now), before) in estimate.iter_mut().zip(&*position).zip(&*previous) {
                        *estimate += share * ((now - before) / dt - *estimate);
                    }
                }
                *since = Some(state_ns);
                previous.copy_from_slice(position);
                velocity.copy_from_slice(estimate);
            }
        }
        effort.copy_from_slice(tau);
        self.effort.disturb(effort);
        Ok(())
    }

    /// The newest reading that is available at a time (ns); none until the latency has passed once.
    pub fn reading(&mut self, now_ns: u64) -> Option<Reading<'_>> {
        let joints = self.joints;
        let (sampled_at, source, values) = self.line.read_noted(now_ns)?;
        let (position, rest) = values.split_at(joints);
        let (velocity, effort) = rest.split_at(joints);
        Some(Reading { sampled_at, source, position, velocity, effort })
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Readings lost because they were sampled more often than announced.
    pub fn lost(&self) -> u64 {
        self.line.lost()
    }
}

impl Channel {
    fn disturb(&mut self, values: &mut [f64]) {
        self.noise.add(&self.deviations, values);
    }
}
