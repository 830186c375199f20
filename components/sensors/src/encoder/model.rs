//! The joint sensors of a robot, all sampled together.

use std::time::Duration;

use super::settings::{Differentiation, EncoderSettings, JointErrors, SettingsError};
use crate::channel::{Channel, SettingError, Timing};
use crate::delay::DelayLine;
use crate::noise::{DROP_OUTS, Noise};
use crate::randomise::SensorDraw;

/// Model of a robot's joint sensors.
///
/// Every [`sample`](Self::sample) reads each joint's position, velocity and effort with the errors of a
/// [`Channel`]. Alternatively, the velocity is differentiated from the position readings. Some readings are
/// dropped; the [`reading`](Self::reading) becomes available after the latency. All memory is allocated by
/// [`new`](Self::new).
#[derive(Clone, Debug)]
pub struct EncoderModel {
    joints: usize,
    position: Channel,
    velocity: Velocity,
    effort: Channel,
    drop_out: f64,
    draws: Noise,
    dropped: u64,
    /// Time of the last sampled state, ns.
    since: Option<u64>,
    /// Measured positions, velocities and efforts.
    values: Vec<f64>,
    line: DelayLine,
}

#[derive(Clone, Debug)]
enum Velocity {
    Measured(Channel),
    Differentiated { cutoff_hz: f64, position: Vec<f64>, estimate: Vec<f64> },
}

/// Times of a joint state, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateTimes {
    /// Run time of the state.
    pub state: u64,
    /// Source time: the time of measurement in the state's stamp.
    pub source: u64,
}

/// One reading of all sensors, in the order of the joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<'a> {
    /// Time at which the state was sampled, ns.
    pub sampled_at: u64,
    /// Source time of the sampled state, as passed to [`sample_state`](EncoderModel::sample_state), ns.
    pub source: u64,
    /// Positions, rad or m.
    pub position: &'a [f64],
    /// Velocities, rad/s or m/s.
    pub velocity: &'a [f64],
    /// Efforts, N m or N.
    pub effort: &'a [f64],
}

/// The size of a joint state differs from the number of joints of the encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the joint state has {position} positions, {velocity} velocities and {effort} efforts, expected {joints} of each"
)]
pub struct SampleError {
    /// Number of positions found.
    pub position: usize,
    /// Number of velocities found.
    pub velocity: usize,
    /// Number of efforts found.
    pub effort: usize,
    /// Number of joints of the encoder.
    pub joints: usize,
}

/// Maximum number of readings in flight.
const MOST_FRAMES: u64 = 100_000;

impl EncoderModel {
    /// Creates sensors for `joints` joints, sampled at least `shortest_period` apart. `seed` seeds the noise
    /// if the settings have no seed.
    ///
    /// # Errors
    /// A list has the wrong length, a number is out of range, or the latency exceeds 100,000 periods.
    pub fn new(
        joints: usize,
        settings: &EncoderSettings,
        seed: u64,
        shortest_period: Duration,
    ) -> Result<Self, SettingsError> {
        Self::drawn(joints, settings, &SensorDraw::none(settings.latency), seed, shortest_period)
    }

    /// Creates sensors like [`new`](Self::new), with the scales of noise and bias and the latency that `draw`
    /// contains for an episode.
    ///
    /// # Errors
    /// Same as [`new`](Self::new).
    pub fn drawn(
        joints: usize,
        settings: &EncoderSettings,
        draw: &SensorDraw,
        seed: u64,
        shortest_period: Duration,
    ) -> Result<Self, SettingsError> {
        let seed = settings.seed.unwrap_or(seed);
        let out_of_range =
            |SettingError { setting, value, expected }| SettingsError::out_of_range(setting, value, expected);
        let timing = Timing { latency: draw.latency, drop_out: settings.drop_out };
        timing.check().map_err(out_of_range)?;
        let channel = |name, errors: &JointErrors, number: u64| {
            let errors = errors.resolve(name, joints)?.iter().map(|errors| draw.errors(errors)).collect();
            // the noises of readings are the first streams of a seed
            let first = 16 * (number + 1);
            Channel::each(name, errors, seed, [first, first + 1, number, first + 3]).map_err(out_of_range)
        };
        let velocity = match settings.differentiate {
            None => Velocity::Measured(channel("velocity", &settings.velocity, 1)?),
            Some(_) if settings.velocity != JointErrors::default() => {
                return Err(SettingsError::NeedlessVelocityErrors);
            }
            Some(Differentiation { cutoff_hz }) if cutoff_hz > 0.0 && cutoff_hz.is_finite() => {
                let (position, estimate) = (vec![0.0; joints], vec![0.0; joints]);
                Velocity::Differentiated { cutoff_hz, position, estimate }
            }
            Some(Differentiation { cutoff_hz }) => {
                let name = "differentiate.cutoff_hz";
                return Err(SettingsError::out_of_range(name, cutoff_hz, "a positive number"));
            }
        };
        let latency_ns = draw.latency.ns;
        let period_ns = u64::try_from(shortest_period.as_nanos()).unwrap_or(u64::MAX).max(1);
        let frames = latency_ns / period_ns;
        if frames > MOST_FRAMES {
            return Err(SettingsError::Latency { latency_ns, frames, period_ns, limit: MOST_FRAMES });
        }
        Ok(Self {
            joints,
            position: channel("position", &settings.position, 0)?,
            velocity,
            effort: channel("effort", &settings.effort, 2)?,
            drop_out: settings.drop_out,
            draws: Noise::new(seed, DROP_OUTS),
            dropped: 0,
            since: None,
            values: vec![0.0; 3 * joints],
            line: DelayLine::new(latency_ns, 3 * joints, period_ns),
        })
    }

    /// Samples the true joint state at a time (ns): `q` (rad or m), `v` (per second) and `tau` (N m or N),
    /// each with one number per joint.
    ///
    /// # Errors
    /// A slice's length differs from the number of joints. In this case, nothing is sampled.
    pub fn sample(&mut self, time_ns: u64, q: &[f64], v: &[f64], tau: &[f64]) -> Result<(), SampleError> {
        self.sample_state(time_ns, StateTimes { state: time_ns, source: time_ns }, q, v, tau)
    }

    /// Samples the joint state like [`sample`](Self::sample), with the run time and the source time of the
    /// state. Velocities are differentiated over the run time, which is free of sampling jitter.
    ///
    /// # Errors
    /// Same as [`sample`](Self::sample).
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
        let since = self.since.replace(state_ns);
        let elapsed = since.map_or(0, |since| state_ns.saturating_sub(since)) as f64 * 1e-9;
        let (position, rest) = self.values.split_at_mut(joints);
        let (velocity, effort) = rest.split_at_mut(joints);
        position.copy_from_slice(q);
        self.position.measure(elapsed, position);
        match &mut self.velocity {
            Velocity::Measured(channel) => {
                velocity.copy_from_slice(v);
                channel.measure(elapsed, velocity);
            }
            Velocity::Differentiated { cutoff_hz, position: previous, estimate } => {
                if since.is_none_or(|since| state_ns < since) {
                    estimate.fill(0.0);
                } else if elapsed > 0.0 {
                    let share = -(-std::f64::consts::TAU * *cutoff_hz * elapsed).exp_m1();
                    for ((estimate, now), before) in estimate.iter_mut().zip(&*position).zip(&*previous) {
                        *estimate += share * ((now - before) / elapsed - *estimate);
                    }
                }
                previous.copy_from_slice(position);
                velocity.copy_from_slice(estimate);
            }
        }
        effort.copy_from_slice(tau);
        self.effort.measure(elapsed, effort);
        // one draw per reading, so that other draws do not change with the fraction
        if self.drop_out > 0.0 && self.draws.uniform() < self.drop_out {
            self.dropped += 1;
            return Ok(());
        }
        self.line.push_noted(time_ns, times.source).copy_from_slice(&self.values);
        Ok(())
    }

    /// Returns the newest reading available at a time (ns); `None` before the first reading is due.
    pub fn reading(&mut self, now_ns: u64) -> Option<Reading<'_>> {
        let joints = self.joints;
        let (sampled_at, source, values) = self.line.read_noted(now_ns)?;
        let (position, rest) = values.split_at(joints);
        let (velocity, effort) = rest.split_at(joints);
        Some(Reading { sampled_at, source, position, velocity, effort })
    }

    /// Returns the number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Returns the number of readings lost because they were sampled closer together than `shortest_period`.
    pub fn lost(&self) -> u64 {
        self.line.lost()
    }

    /// Returns the number of readings dropped by `drop_out`.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}
