//! Episodes of real time: numbered stretches of a run without a reset, in the log of events and in the
//! report.

use std::sync::atomic::Ordering::Relaxed;

use super::event_log::logging;
use super::{EpisodeReport, Event, Launch};
use crate::os::monotonic_ns;
use crate::plan::ClockKind;
use crate::region::EpisodeStart;

/// An episode that has begun.
#[derive(Debug, Clone, Copy)]
pub(super) struct Began {
    start: EpisodeStart,
    /// Steps of all components before it, counted when the launcher saw it.
    steps: u64,
}

impl Launch {
    /// Begins the next episode, and returns its number. For runs whose episodes no component begins.
    pub(crate) fn begin_episode(&mut self, seed: u64, observe: &mut dyn FnMut(Event<'_>)) -> u64 {
        let observe = &mut logging(&self.log, observe);
        let region = self.region.clone();
        // The launcher itself notes every episode that it begins.
        region.header().begin_next_episode(seed, monotonic_ns());
        self.note_episodes(observe);
        region.header().episode.load(Relaxed)
    }

    /// Enters an episode that has begun since the last call into the account and the log, so that the next
    /// one may begin.
    pub(super) fn note_episodes(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let header = self.region.header();
        if header.episode.load(Relaxed) == self.episodes.last().map_or(0, |last| last.start.index) {
            return;
        }
        let Some(start) = header.episode_start() else { return };
        self.episodes.push(Began { start, steps: self.steps() });
        header.note_episode(start.index);
        observe(Event::EpisodeBegan { episode: start.index, seed: start.seed });
    }

    /// Start of the present episode of real time, ns since the start of the run; 0 in lockstep.
    pub(crate) fn episode_ns(&self) -> u64 {
        let header = self.region.header();
        if self.plan.clock == ClockKind::Lockstep || header.episode.load(Relaxed) == 0 {
            return 0;
        }
        let began_ns = header.episode_start().map_or(0, |start| start.began_ns);
        began_ns.saturating_sub(header.start_ns.load(Relaxed))
    }

    /// The episodes of a run in real time that ended at `end_ns` on `CLOCK_MONOTONIC`; empty if it was not
    /// divided.
    pub(super) fn episode_reports(&self, end_ns: u64) -> Vec<EpisodeReport> {
        let driven = self.plan.episodes.is_some() || self.plan.episode_driver().is_some();
        let began_ns = self.region.header().start_ns.load(Relaxed);
        let is_divided = driven || !self.episodes.is_empty();
        if self.plan.clock == ClockKind::Lockstep || began_ns == 0 || !is_divided {
            return Vec::new();
        }
        let first = Began { start: EpisodeStart { index: 0, seed: self.plan.seed, began_ns }, steps: 0 };
        let began: Vec<Began> = [first].into_iter().chain(self.episodes.iter().copied()).collect();
        let ends = began.iter().skip(1).map(|next| (next.start.began_ns, next.steps));
        let ends = ends.chain([(end_ns, self.steps())]);
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

    /// Steps of all components so far.
    fn steps(&self) -> u64 {
        self.region.components().iter().map(|block| block.steps.load(Relaxed)).sum()
    }
}
