//! Delivery of readings from sampling to output: drop-outs and latency.

use std::time::Duration;

use motorium::declare::{ConfigError, Declare};
use motorium::units::TimeSpan;

use crate::channel::{SettingError, Timing};
use crate::delay::DelayLine;
use crate::noise::{DROP_OUTS, Noise};

/// Maximum number of readings in flight.
const MOST: u64 = 100_000;

/// Maximum number of values in flight.
const MOST_NUMBERS: u64 = 1 << 25;

/// Readings in flight, each published once.
#[derive(Debug)]
pub(super) struct Readings {
    line: DelayLine,
    width: usize,
    drop_out: f64,
    draws: Noise,
    last: Option<u64>,
    published: u64,
    dropped: u64,
}

impl Readings {
    /// Checks the settings of readings of `width` numbers before the run, and warns if the period adds to the
    /// latency.
    pub(super) fn declare(timing: &Timing, width: usize, declare: &mut Declare) -> Result<(), ConfigError> {
        timing.check().map_err(refused)?;
        let Some(period) = declare.period() else { return Ok(()) };
        frames(timing, width, period)?;
        let latency = timing.latency;
        if latency.ns > 0 && Duration::from(latency) < period {
            let period = TimeSpan { ns: period.as_nanos() as u64 };
            declare.warn(format!("a latency of {latency} is shorter than the period")).key("latency").advise(
                format!(
                    "readings are published once per step, {period} late; set this latency, or raise the rate"
                ),
            );
        }
        Ok(())
    }

    /// Creates a queue for readings of `width` values.
    pub(super) fn new(
        timing: &Timing,
        width: usize,
        period: Duration,
        seed: u64,
    ) -> Result<Self, ConfigError> {
        timing.check().map_err(refused)?;
        let period_ns = frames(timing, width, period)?;
        Ok(Self {
            line: DelayLine::new(timing.latency.ns, width, period_ns),
            width,
            drop_out: timing.drop_out,
            draws: Noise::new(seed, DROP_OUTS),
            last: None,
            published: 0,
            dropped: 0,
        })
    }

    /// Adds a reading sampled at a time (ns) from a state with a source time; some are dropped.
    pub(super) fn push(&mut self, time_ns: u64, source: u64, values: &[f64]) {
        debug_assert_eq!(values.len(), self.width);
        // one draw per reading, so that other draws do not change with the fraction
        if self.drop_out > 0.0 && self.draws.uniform() < self.drop_out {
            self.dropped += 1;
            return;
        }
        self.line.push_noted(time_ns, source).copy_from_slice(values);
    }

    /// Returns the newest reading that is due and was not returned before, with its source time.
    pub(super) fn due(&mut self, now_ns: u64) -> Option<(u64, &[f64])> {
        let (time, source, values) = self.line.read_noted(now_ns)?;
        if self.last == Some(time) {
            return None;
        }
        self.last = Some(time);
        self.published += 1;
        Some((source, values))
    }

    /// Returns the part of a result that all sensors have.
    pub(super) fn result(&self) -> serde_json::Value {
        serde_json::json!({
            "readings": self.published,
            "dropped": self.dropped,
            "lost": self.line.lost(),
        })
    }
}

/// Returns the period in ns if the readings in flight fit.
fn frames(timing: &Timing, width: usize, period: Duration) -> Result<u64, ConfigError> {
    let period_ns = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX).max(1);
    let frames = timing.latency.ns / period_ns;
    let most = MOST.min(MOST_NUMBERS / width.max(1) as u64);
    if frames > most {
        let message =
            format!("a latency of {} delays {frames} readings, expected at most {most}", timing.latency);
        return Err(ConfigError::key("latency", message).advise("check the unit; is it meant to be ms?"));
    }
    Ok(period_ns)
}

/// Converts the error of a setting to an error at its key.
pub(super) fn refused(error: SettingError) -> ConfigError {
    let SettingError { setting, value, expected } = error;
    ConfigError::key(setting, format!("{value}, expected {expected}"))
}
