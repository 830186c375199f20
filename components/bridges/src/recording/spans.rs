//! The times of the episodes of a recording.

use motorium::declare::ClockKind;
use motorium::plan::Plan;
use motorium::state::Stamp;

use super::{EVENTS, ReadError, Recording};

/// The times of the first and the last publication of each episode, as the stamps tell them.
pub(super) struct Spans {
    /// The one episode that is looked at.
    only: Option<u64>,
    first_ns: Option<u64>,
    last_ns: Vec<u64>,
}

impl Spans {
    /// Of no sample yet. With `only`, other episodes are passed over.
    pub(super) fn new(only: Option<u64>) -> Self {
        Self { only, first_ns: None, last_ns: Vec::new() }
    }

    /// Of all samples of a recording.
    pub(super) fn of(recording: &Recording, only: Option<u64>) -> Result<Self, ReadError> {
        let mut spans = Self::new(only);
        for sample in recording.samples() {
            let sample = sample?;
            if recording.topics()[sample.topic].name != EVENTS {
                spans.add(&sample.stamp);
            }
        }
        Ok(spans)
    }

    /// Adds a sample. Returns the index of its episode among those that are replayed; `None` if its episode is left out.
    pub(super) fn add(&mut self, stamp: &Stamp) -> Option<u64> {
        let index = match self.only {
            Some(only) if only != stamp.episode => return None,
            Some(_) => 0,
            None => stamp.episode,
        };
        let place = usize::try_from(index).ok()?;
        if self.last_ns.len() <= place {
            self.last_ns.resize(place + 1, 0);
        }
        self.last_ns[place] = self.last_ns[place].max(stamp.publish_time);
        self.first_ns = Some(self.first_ns.map_or(stamp.publish_time, |first| first.min(stamp.publish_time)));
        Some(index)
    }

    /// Number of the episodes.
    pub(super) fn count(&self) -> u64 {
        self.last_ns.len() as u64
    }

    /// The time zero of the stamps: that of the first sample of a run in real time.
    pub(super) fn start_ns(&self, recorded: &Plan) -> u64 {
        match recorded.clock {
            ClockKind::Lockstep => 0,
            ClockKind::Realtime => self.first_ns.unwrap_or(0),
        }
    }

    /// The duration that the plan gives an episode of simulated time, ns.
    fn planned_ns(recorded: &Plan) -> Option<u64> {
        recorded.duration_ns.filter(|_| recorded.clock == ClockKind::Lockstep)
    }

    /// The duration of each episode, ns: that of the plan unless it was over before.
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

    /// The duration of the longest episode, ns; `None` if there is no sample.
    pub(super) fn longest_ns(&self, recorded: &Plan) -> Option<u64> {
        self.lengths(recorded).max()
    }

    /// Of each episode that was over before the plan says, the time of its last sample, ns.
    pub(super) fn early_ends(&self, recorded: &Plan) -> Vec<Option<u64>> {
        let (start_ns, planned_ns) = (self.start_ns(recorded), Self::planned_ns(recorded));
        let is_early = |length: u64| planned_ns.is_none_or(|planned_ns| length < planned_ns);
        let all = self.lengths(recorded).zip(&self.last_ns);
        all.map(|(length, last)| is_early(length).then(|| last.saturating_sub(start_ns))).collect()
    }
}
