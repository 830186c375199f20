//! Times of the episodes of a recording.

use motorium::declare::ClockKind;
use motorium::plan::Plan;
use motorium::state::Stamp;

use super::{EVENTS, ReadError, Recording};

/// Times of the first and the last publication of each span of a recording that is replayed from one reset to
/// the next. In lockstep, a span is an episode; in real time, where a replay has no resets, it is the whole
/// recording.
pub(super) struct Spans {
    /// The only episode that is read.
    only: Option<u64>,
    clock: ClockKind,
    /// Number of episodes up to the last one found.
    episodes: u64,
    first_ns: Option<u64>,
    last_ns: Vec<u64>,
}

impl Spans {
    /// Creates spans without samples for a recording with this clock. With `only`, other episodes are
    /// skipped.
    pub(super) fn new(clock: ClockKind, only: Option<u64>) -> Self {
        Self { only, clock, episodes: 0, first_ns: None, last_ns: Vec::new() }
    }

    /// Returns the spans of all samples of a recording.
    pub(super) fn from_recording(recording: &Recording, only: Option<u64>) -> Result<Self, ReadError> {
        let mut spans = Self::new(recording.plan()?.clock, only);
        for sample in recording.samples() {
            let sample = sample?;
            if recording.topics()[sample.topic].name != EVENTS {
                spans.add(&sample.stamp);
            }
        }
        Ok(spans)
    }

    /// Adds a sample. Returns the index of its span among the replayed ones, or `None` if its episode is
    /// skipped.
    pub(super) fn add(&mut self, stamp: &Stamp) -> Option<u64> {
        self.episodes = self.episodes.max(stamp.episode.saturating_add(1));
        let index = match (self.only, self.clock) {
            (Some(only), _) if only != stamp.episode => return None,
            (None, ClockKind::Lockstep) => stamp.episode,
            (Some(_), _) | (None, ClockKind::Realtime) => 0,
        };
        let place = usize::try_from(index).ok()?;
        if self.last_ns.len() <= place {
            self.last_ns.resize(place + 1, 0);
        }
        self.last_ns[place] = self.last_ns[place].max(stamp.publish_time);
        self.first_ns = Some(self.first_ns.map_or(stamp.publish_time, |first| first.min(stamp.publish_time)));
        Some(index)
    }

    /// Number of episodes, including skipped ones.
    pub(super) fn episodes(&self) -> u64 {
        self.episodes
    }

    /// Number of spans.
    pub(super) fn count(&self) -> u64 {
        self.last_ns.len() as u64
    }

    /// Time zero of the stamps: the first sample of a real-time run.
    pub(super) fn start_ns(&self, recorded: &Plan) -> u64 {
        match recorded.clock {
            ClockKind::Lockstep => 0,
            ClockKind::Realtime => self.first_ns.unwrap_or(0),
        }
    }

    /// Planned duration of an episode in simulated time, ns.
    fn planned_ns(recorded: &Plan) -> Option<u64> {
        recorded.duration_ns.filter(|_| recorded.clock == ClockKind::Lockstep)
    }

    /// Duration of each episode, ns: the planned one, unless the episode ended earlier.
    fn lengths(&self, recorded: &Plan) -> impl Iterator<Item = u64> {
        let start_ns = self.start_ns(recorded);
        let publishing = recorded.components.iter().filter(|component| !component.outputs.is_empty());
        let period_ns = publishing.map(|component| component.activation.period_ns()).max();
        let planned_ns = Self::planned_ns(recorded);
        self.last_ns.iter().map(move |last_ns| {
            // The last sample is at most a period before the end.
            let end_ns = last_ns.saturating_sub(start_ns) + period_ns.unwrap_or(0).max(1);
            planned_ns.map_or(end_ns, |planned_ns| planned_ns.min(end_ns))
        })
    }

    /// Duration of the longest episode, ns; `None` without samples.
    pub(super) fn longest_ns(&self, recorded: &Plan) -> Option<u64> {
        self.lengths(recorded).max()
    }

    /// For each episode that ended earlier than planned, the time of its last sample, ns.
    pub(super) fn early_ends(&self, recorded: &Plan) -> Vec<Option<u64>> {
        let (start_ns, planned_ns) = (self.start_ns(recorded), Self::planned_ns(recorded));
        let is_early = |length: u64| planned_ns.is_none_or(|planned_ns| length < planned_ns);
        let all = self.lengths(recorded).zip(&self.last_ns);
        all.map(|(length, last)| is_early(length).then(|| last.saturating_sub(start_ns))).collect()
    }
}
