//! Real-time episodes, which are numbered sections of a run without a reset, in the event log and the report.

use std::sync::atomic::Ordering::Relaxed;

use super::{EpisodeReport, Event};
use crate::plan::{ClockKind, Plan};
use crate::region::{EpisodeStart, Region};

/// An episode that has begun.
#[derive(Debug, Clone, Copy)]
struct Began {
    start: EpisodeStart,
    /// Steps of all components before it, counted when the launcher detected it.
    steps: u64,
}

/// Real-time episodes that have begun since the start of the run.
#[derive(Debug, Default)]
pub(super) struct Episodes(Vec<Began>);

impl Episodes {
    /// Records an episode that has begun since the last call, here and in the event log, so that the next one
    /// may begin.
    pub(super) fn note(&mut self, region: &Region, observe: &mut dyn FnMut(Event<'_>)) {
        let header = region.header();
        if header.episode.load(Relaxed) == self.0.last().map_or(0, |last| last.start.index) {
            return;
        }
        let Some(start) = header.episode_start() else { return };
        self.0.push(Began { start, steps: steps(region) });
        header.note_episode(start.index);
        observe(Event::EpisodeBegan { episode: start.index, seed: start.seed });
    }

    /// Returns the episodes of a real-time run that ended at `end_ns` on `CLOCK_MONOTONIC`; empty for a run
    /// without episodes.
    pub(super) fn reports(&self, plan: &Plan, region: &Region, end_ns: u64) -> Vec<EpisodeReport> {
        let driven = plan.episodes.is_some() || plan.episode_driver().is_some();
        let began_ns = region.header().start_ns.load(Relaxed);
        let is_divided = driven || !self.0.is_empty();
        if plan.clock == ClockKind::Lockstep || began_ns == 0 || !is_divided {
            return Vec::new();
        }
        let first = Began { start: EpisodeStart { index: 0, seed: plan.seed, began_ns }, steps: 0 };
        let began: Vec<Began> = [first].into_iter().chain(self.0.iter().copied()).collect();
        let ends = began.iter().skip(1).map(|next| (next.start.began_ns, next.steps));
        let ends = ends.chain([(end_ns, steps(region))]);
        let reports =
            began.iter().zip(ends).map(|(Began { start, steps }, (end_ns, end_steps))| EpisodeReport {
                index: start.index,
                seed: start.seed,
                duration_s: end_ns.saturating_sub(start.began_ns) as f64 * 1e-9,
                steps: end_steps.saturating_sub(*steps),
                state_hash: None,
            });
        reports.collect()
    }
}

/// Returns the start of the current real-time episode, ns since the start of the run; 0 in lockstep.
pub(super) fn present_episode_ns(plan: &Plan, region: &Region) -> u64 {
    let header = region.header();
    if plan.clock == ClockKind::Lockstep || header.episode.load(Relaxed) == 0 {
        return 0;
    }
    let began_ns = header.episode_start().map_or(0, |start| start.began_ns);
    began_ns.saturating_sub(header.start_ns.load(Relaxed))
}

/// Returns the number of steps of all components so far.
fn steps(region: &Region) -> u64 {
    region.components().iter().map(|block| block.steps.load(Relaxed)).sum()
}
