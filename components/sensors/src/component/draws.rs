//! Sensor parameters sampled for an episode, and their topic.

use motorium::prelude::*;
use motorium::state::Randomisation;

use super::readings::refused;
use crate::randomise::{SensorDraw, SensorRanges};

/// Sampled parameters of a sensor component.
#[derive(Debug)]
pub(super) struct Draws {
    ranges: SensorRanges,
    latency: TimeSpan,
    output: Option<Output<Randomisation>>,
    now: SensorDraw,
    episode: u64,
    seed: u64,
    /// True until the current draw has been published.
    is_new: bool,
}

impl Draws {
    /// Checks the ranges and declares the output if any parameter is sampled.
    pub(super) fn declare(ranges: &SensorRanges, declare: &mut Declare) -> Result<(), ConfigError> {
        ranges.check().map_err(refused)?;
        if !ranges.is_empty() {
            declare.output::<Randomisation>("drawn", "parameters of the sensor sampled for the episode");
        }
        Ok(())
    }

    /// Samples the parameters for the first episode. `latency` is the sensor's own latency.
    pub(super) fn open(
        ranges: &SensorRanges,
        latency: TimeSpan,
        seed: u64,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let output = if ranges.is_empty() { None } else { Some(setup.output("drawn")?) };
        let now = ranges.draw(seed, latency);
        Ok(Self { ranges: *ranges, latency, output, now, episode: 0, seed, is_new: true })
    }

    /// Returns the current draw.
    pub(super) fn now(&self) -> SensorDraw {
        self.now
    }

    /// Samples the parameters of the episode with this index from the sensor's seed in it.
    pub(super) fn reset(&mut self, episode: u64, seed: u64) -> SensorDraw {
        self.now = self.ranges.draw(seed, self.latency);
        (self.episode, self.seed, self.is_new) = (episode, seed, true);
        self.now
    }

    /// Publishes the draw of an episode once.
    pub(super) fn publish(&mut self) -> Result<(), StepError> {
        let is_new = core::mem::take(&mut self.is_new);
        let Some(output) = self.output.as_mut().filter(|output| is_new && output.is_wired()) else {
            return Ok(());
        };
        let SensorDraw { noise, bias, latency } = self.now;
        let all = [
            (self.ranges.noise.is_some(), Randomisation::SENSOR_NOISE, noise),
            (self.ranges.bias.is_some(), Randomisation::SENSOR_BIAS, bias),
            (self.ranges.latency.is_some(), Randomisation::SENSOR_LATENCY, latency.as_secs_f64()),
        ];
        let mut message = output.loan()?;
        (message.episode, message.seed) = (self.episode, self.seed);
        message.set_count(all.iter().filter(|(is_drawn, ..)| *is_drawn).count());
        for (entry, (_, property, value)) in all.iter().filter(|(is_drawn, ..)| *is_drawn).enumerate() {
            message.property_mut()[entry] = *property;
            message.part_mut()[entry] = 0;
            message.value_mut()[entry] = *value;
        }
        message.publish()
    }

    /// Adds the current draw to the result of the sensor.
    pub(super) fn report(&self, result: &mut serde_json::Value) {
        if self.output.is_some() {
            let SensorDraw { noise, bias, latency } = self.now;
            let latency = latency.as_secs_f64();
            result["drawn"] = serde_json::json!({ "noise": noise, "bias": bias, "latency_s": latency });
        }
    }
}
