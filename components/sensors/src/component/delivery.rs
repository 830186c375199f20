//! Readings of a sensor from sampling to output, with the parameters sampled for every episode.

use std::time::Duration;

use motorium::prelude::*;

use super::config::Common;
use super::draws::Draws;
use super::readings::Readings;
use crate::channel::Timing;
use crate::randomise::SensorDraw;

impl Common<'_> {
    /// Checks the ranges of `randomise` and declares the topic of the sampled values. Returns a draw for
    /// checks of the sensor.
    pub(super) fn declare_draws(&self, declare: &mut Declare) -> Result<SensorDraw, ConfigError> {
        Draws::declare(self.randomise, declare)?;
        Ok(self.randomise.draw(0, self.timing.latency))
    }

    /// Checks that readings of `width` numbers can be in flight for the longest latency.
    pub(super) fn declare_readings(&self, width: usize, declare: &mut Declare) -> Result<(), ConfigError> {
        Readings::declare(&self.timing.late(self.randomise.longest(self.timing.latency)), width, declare)
    }

    /// Samples the parameters of the first episode.
    pub(super) fn open(&self, setup: &mut Setup) -> Result<Opened, ConfigureError> {
        let first = self.seed.unwrap_or(setup.seed());
        let draws = Draws::open(self.randomise, self.timing.latency, first, setup)?;
        Ok(Opened { draws, timing: self.timing, seed: self.seed, first, period: setup.period() })
    }
}

/// The sampled parameters of a sensor whose width is not known yet.
pub(super) struct Opened {
    draws: Draws,
    timing: Timing,
    seed: Option<u64>,
    /// Seed of the first episode.
    first: u64,
    period: Duration,
}

impl Opened {
    /// Returns the seed and the draw of the first episode.
    pub(super) fn start(&self) -> (u64, SensorDraw) {
        (self.first, self.draws.now())
    }

    /// Prepares the delivery of readings of `width` numbers.
    pub(super) fn deliver(self, width: usize) -> Result<Delivery, ConfigError> {
        let Self { draws, timing, seed, first, period } = self;
        let readings = Readings::new(&timing.late(draws.now().latency), width, period, first)?;
        Ok(Delivery { readings, draws, timing, seed, width, period })
    }
}

/// Readings in flight, and the sampled parameters of the episode.
#[derive(Debug)]
pub(super) struct Delivery {
    readings: Readings,
    draws: Draws,
    /// Latency and drop-outs before randomisation.
    timing: Timing,
    seed: Option<u64>,
    width: usize,
    period: Duration,
}

impl Delivery {
    /// Publishes the sampled parameters of an episode, once.
    pub(super) fn publish_draws(&mut self) -> Result<(), StepError> {
        self.draws.publish()
    }

    /// Accepts a reading that was sampled at a time (ns) from a state of a source time; some are dropped.
    pub(super) fn push(&mut self, time_ns: u64, source: u64, values: &[f64]) {
        self.readings.push(time_ns, source, values);
    }

    /// Returns the newest reading that is due and was not returned before, with its source time.
    pub(super) fn due(&mut self, now_ns: u64) -> Option<(u64, &[f64])> {
        self.readings.due(now_ns)
    }

    /// Discards the readings in flight and samples the parameters of an episode. Returns the seed and the
    /// draw.
    pub(super) fn reset(&mut self, episode: &Episode) -> Result<(u64, SensorDraw), StepError> {
        let seed = self.seed.unwrap_or(episode.seed);
        let draw = self.draws.reset(episode.index, seed);
        self.readings = Readings::new(&self.timing.late(draw.latency), self.width, self.period, seed)
            .map_err(|error| StepError::failed(error.to_string()))?;
        Ok((seed, draw))
    }

    /// Returns the part of a result that all sensors have.
    pub(super) fn result(&self) -> serde_json::Value {
        let mut result = self.readings.result();
        self.draws.report(&mut result);
        result
    }
}
