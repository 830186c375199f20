//! A stream or slices of the graph, published by foreign programs.

use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::node::Node;
use motorium::component::{ConfigureError, RunClock};
use motorium::declare::TopicPattern;
use motorium::os::monotonic_ns;
use motorium::raw::RawStreamOutput;
use motorium::telemetry::set_apart;
use motorium::transport::Shared;
use serde_json::{Value, json};

use super::config::InboundConfig;
use super::counts::Refused;
use super::service::{Arrived, PUBLISHERS, Queue, Service, receive};

/// An inbound stream, or inbound slices. All valid values are published in order, within the rate limit.
pub(super) struct InboundStream {
    output: RawStreamOutput,
    port: Queue,
    /// Last received value, with room for the longest one.
    taken: Box<[u8]>,
    limit: RateLimit,
    max_age_ns: u64,
    /// Time at which the queue was last emptied, ns.
    emptied_ns: u64,
    /// Maximum number of waiting values per publisher.
    waiting: usize,
    sequences: Sequences,
    received: u64,
    published: u64,
    refused: Refused,
}

impl InboundStream {
    /// Returns `None` if the output is not wired in the graph.
    pub(super) fn new(
        node: &Node<Shared>,
        output: RawStreamOutput,
        config: &InboundConfig,
    ) -> Result<Option<Self>, ConfigureError> {
        let Some(topic) = output.topic() else { return Ok(None) };
        let service = Service::feeding(topic, output.layout(), config.pattern);
        let (port, waiting) = (service.subscribe(node)?, service.waiting());
        let is_slices = matches!(config.pattern, TopicPattern::Slices { .. });
        Ok(Some(Self {
            port,
            taken: vec![0; output.layout().size * output.longest()].into_boxed_slice(),
            limit: RateLimit::new(config.max_rate.period_ns, waiting),
            max_age_ns: config.max_age.ns,
            emptied_ns: monotonic_ns(),
            waiting,
            sequences: Sequences::default(),
            received: 0,
            published: 0,
            refused: if is_slices { Refused::of_slices() } else { Refused::default() },
            output,
        }))
    }

    /// Publishes the values received since the last step.
    pub(super) fn step(&mut self, time_ns: u64, now_ns: u64, clock: &RunClock) {
        // A queued value arrived after the queue was last emptied, which bounds its age.
        let is_old = now_ns.saturating_sub(self.emptied_ns) > self.max_age_ns;
        for _ in 0..PUBLISHERS * self.waiting {
            // iceoryx2 allocates when a publisher connects or disconnects
            let Some(arrived) = set_apart(|| receive(&self.port, true, &mut self.taken)) else {
                break;
            };
            self.received += 1;
            self.sequences.take(&arrived);
            match self.taken.get(..arrived.length) {
                _ if is_old => self.refused.too_old += 1,
                None => self.refused.too_long(),
                Some(_) if !self.limit.admits(time_ns) => self.refused.above_max_rate += 1,
                Some(value) => match self.output.publish_from(value, clock.stamp_ns(time_ns)) {
                    Ok(()) => {
                        self.published += 1;
                        self.limit.count(time_ns);
                    }
                    Err(error) => self.refused.unpublished(error),
                },
            }
        }
        self.emptied_ns = now_ns;
    }

    pub(super) fn result(&self) -> (String, Value) {
        let topic = self.output.topic().unwrap_or_default().to_string();
        let Self { received, published, refused, sequences, .. } = self;
        let lost = sequences.lost;
        let counts =
            json!({ "received": received, "published": published, "lost": lost, "refused": refused });
        (topic, counts)
    }
}

/// Sequence numbers of the values sent by foreign programs. A gap is the number of values dropped by a queue
/// overflow.
#[derive(Debug, Default)]
struct Sequences {
    /// Publishers, with the sequence numbers of their newest values.
    newest: [Option<(UniquePublisherId, u64)>; PUBLISHERS],
    /// Index of the most recently added publisher.
    last: usize,
    lost: u64,
}

impl Sequences {
    fn take(&mut self, arrived: &Arrived) {
        let Arrived { publisher, sequence, .. } = *arrived;
        // the program does not number its values
        if sequence == 0 {
            return;
        }
        let known = self.newest.iter().position(|known| known.is_some_and(|(known, _)| known == publisher));
        let place = known.unwrap_or((self.last + 1) % PUBLISHERS);
        // a gap before the first value may predate the bridge
        let before = self.newest[place].filter(|_| known.is_some()).map_or(sequence, |(_, before)| before);
        self.lost += sequence.saturating_sub(before.saturating_add(1));
        self.newest[place] = Some((publisher, sequence.max(before)));
        self.last = place;
    }
}

/// Limit on the mean rate that permits bursts.
#[derive(Debug, Clone, PartialEq, Eq)]
struct RateLimit {
    period_ns: u64,
    /// Maximum time by which values may be ahead of the rate, ns.
    ahead_ns: u64,
    /// Time at which the next value would be due at the maximum rate, ns.
    due_ns: u64,
}

impl RateLimit {
    /// Creates a limit of one value per `period_ns`, with bursts of up to `burst` values.
    fn new(period_ns: u64, burst: usize) -> Self {
        let ahead_ns = period_ns.saturating_mul((burst as u64).saturating_sub(1));
        Self { period_ns, ahead_ns, due_ns: 0 }
    }

    /// Returns `true` if a value at this time is within the limit.
    fn admits(&self, time_ns: u64) -> bool {
        self.due_ns <= time_ns.saturating_add(self.ahead_ns)
    }

    /// Counts a value that was published at this time.
    fn count(&mut self, time_ns: u64) {
        self.due_ns = self.due_ns.max(time_ns).saturating_add(self.period_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of admitted values at each time, when `offered` values arrive.
    fn admitted(
        limit: &mut RateLimit,
        times_ns: impl IntoIterator<Item = u64>,
        offered: usize,
    ) -> Vec<usize> {
        let mut at = |time_ns: u64| {
            let take = |_: &usize| {
                let admits = limit.admits(time_ns);
                if admits {
                    limit.count(time_ns);
                }
                admits
            };
            (0..offered).filter(take).count()
        };
        times_ns.into_iter().map(&mut at).collect()
    }

    #[test]
    fn bursts_pass_within_the_mean_rate() {
        // 1 kHz through steps of 5 ms
        let mut limit = RateLimit::new(1_000_000, 8);
        assert_eq!(admitted(&mut limit, [0, 5_000_000, 10_000_000], 20), [8, 5, 5]);
        assert_eq!(
            admitted(&mut limit, [1_000_000_000], 20),
            [8],
            "a pause fills the burst again, and no more"
        );
    }

    #[test]
    fn values_at_the_rate_are_never_refused() {
        let mut limit = RateLimit::new(1_000_000, 1);
        assert!(admitted(&mut limit, (0..100).map(|k| k * 1_000_000), 1).iter().all(|count| *count == 1));
        assert_eq!(admitted(&mut limit, (100..104).map(|k| k * 1_000_000), 3), [1; 4]);
    }
}
