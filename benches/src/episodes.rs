//! Component that measures the first step of an episode in real time.

use motorium::component::{Component, ConfigureError, EpisodeDriver, RunClock, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::worker::Kind;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::Distribution;

/// Steps of an episode at 1 kHz. The launcher notes an episode within 20 ms.
const EPISODE_STEPS: u64 = 50;
/// Maximum number of recorded steps.
const RECORDED: usize = 1 << 18;

/// Returns the kind of the component, for a host program.
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub(crate) fn kind() -> Kind {
    Kind::of::<Episodes>()
}

/// The `config` table of `bench.episodes`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EpisodesConfig {}

/// Starts episodes of 50 steps, and records the time from the release of each step to its first instruction.
pub(crate) struct Episodes {
    driver: Option<EpisodeDriver>,
    clock: RunClock,
    /// First steps of episodes, ns.
    first: Vec<u64>,
    /// All other steps, ns.
    other: Vec<u64>,
}

impl Component for Episodes {
    const KIND: &'static str = "bench.episodes";
    const SUMMARY: &'static str =
        "begins episodes of 50 steps and measures their first steps, for benchmarks";
    type Config = EpisodesConfig;

    fn declare(_: &EpisodesConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.may_begin_episodes();
        Ok(())
    }

    fn configure(_: EpisodesConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            driver: setup.episode_driver(),
            clock: setup.clock(),
            first: Vec::with_capacity(RECORDED),
            other: Vec::with_capacity(RECORDED),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let late = self.clock.now_ns().saturating_sub(tick.time_ns);
        // The first step of the run begins an episode as well, without entering it.
        let steps = if tick.begins_episode && tick.index > 0 { &mut self.first } else { &mut self.other };
        if steps.len() < RECORDED {
            steps.push(late);
        }
        if tick.index % EPISODE_STEPS == EPISODE_STEPS - 1
            && let Some(driver) = &self.driver
        {
            driver.begin(tick.episode + 1);
        }
        Ok(())
    }

    /// Returns the times of first steps and of all others.
    fn result(&self) -> Option<serde_json::Value> {
        let [first, other] = [&self.first, &self.other].map(|late| Distribution::from_samples(late.clone()));
        (first.count > 0).then(|| serde_json::json!({ "first_ns": first, "other_ns": other }))
    }
}
