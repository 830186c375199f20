//! A state of the graph, published by foreign programs.

use iceoryx2::node::Node;
use motorium::component::{ConfigureError, RunClock};
use motorium::declare::TopicPattern;
use motorium::os::monotonic_ns;
use motorium::raw::RawOutput;
use motorium::state::{EmergencyStop, StateBuffer as _};
use motorium::telemetry::set_apart;
use motorium::transport::Shared;
use serde_json::{Value, json};

use super::config::InboundConfig;
use super::counts::Refused;
use super::service::{PUBLISHERS, Queue, Service, receive};

/// An inbound state. The latest valid value is published, within the rate limit.
pub(super) struct Inbound {
    output: RawOutput,
    port: Queue,
    period_ns: u64,
    max_age_ns: u64,
    /// Last received value.
    taken: Box<[u8]>,
    /// Newest valid value, the time of the step that received it (ns on the stamp clock), and whether it is
    /// unpublished.
    newest: Box<[u8]>,
    taken_ns: u64,
    is_pending: bool,
    /// Time of the last publishing step, ns since the start of the run.
    published_ns: Option<u64>,
    /// Time at which the queue was last polled, ns.
    looked_ns: u64,
    /// Maximum number of waiting values per publisher.
    waiting: usize,
    /// `true` if the topic carries emergency stops. A pressed stop overrides newer values, `max_rate` and
    /// `max_age`.
    is_emergency_stop: bool,
    received: u64,
    published: u64,
    refused: Refused,
}

impl Inbound {
    /// Returns `None` if the output is not wired in the graph.
    pub(super) fn new(
        node: &Node<Shared>,
        output: RawOutput,
        config: &InboundConfig,
    ) -> Result<Option<Self>, ConfigureError> {
        let Some(topic) = output.topic() else { return Ok(None) };
        let service = Service::feeding(topic, output.layout(), TopicPattern::State);
        let (port, waiting) = (service.subscribe(node)?, service.waiting());
        let zeros = vec![0; output.layout().size].into_boxed_slice();
        Ok(Some(Self {
            port,
            period_ns: config.max_rate.period_ns,
            max_age_ns: config.max_age.ns,
            taken: zeros.clone(),
            newest: zeros,
            taken_ns: 0,
            is_pending: false,
            published_ns: None,
            looked_ns: monotonic_ns(),
            waiting,
            is_emergency_stop: output.layout().type_name == EmergencyStop::NAME,
            received: 0,
            published: 0,
            refused: Refused::default(),
            output,
        }))
    }

    /// Receives the values since the last step, and publishes the newest valid one if it is due.
    pub(super) fn step(&mut self, time_ns: u64, now_ns: u64, clock: &RunClock) {
        // A queued value arrived after the queue was last emptied, which bounds its age.
        let is_old = now_ns.saturating_sub(self.looked_ns) > self.max_age_ns;
        self.looked_ns = now_ns;
        if is_old && core::mem::take(&mut self.is_pending) {
            self.refused.too_old += 1;
        }
        let mut taken = 0;
        while taken < PUBLISHERS * self.waiting {
            // iceoryx2 allocates when a publisher connects or disconnects
            if set_apart(|| receive(&self.port, false, &mut self.taken)).is_none() {
                break;
            }
            taken += 1;
            self.received += 1;
            if self.is_emergency_stop && is_pressed(&self.taken) {
                self.stop(time_ns, clock);
            } else if is_old {
                self.refused.too_old += 1;
            } else {
                self.admit(clock.stamp_ns(time_ns));
            }
        }
        if self.is_emergency_stop && taken >= self.waiting {
            // The queue may have overflowed and dropped an emergency stop.
            self.taken.copy_from_slice(&1_u64.to_ne_bytes());
            self.stop(time_ns, clock);
        }
        let is_time = self.published_ns.is_none_or(|last| time_ns.saturating_sub(last) >= self.period_ns);
        if is_time && core::mem::take(&mut self.is_pending) {
            // The source time of a delayed value is the step that received it.
            match self.output.publish_from(&self.newest, self.taken_ns) {
                Ok(()) => {
                    self.published += 1;
                    self.published_ns = Some(time_ns);
                }
                Err(error) => self.refused.unpublished(error),
            }
        }
    }

    /// Publishes the last received value, an emergency stop, immediately. A pending value is older, so it is
    /// dropped.
    fn stop(&mut self, time_ns: u64, clock: &RunClock) {
        if core::mem::take(&mut self.is_pending) {
            self.refused.above_max_rate += 1;
        }
        match self.output.publish_from(&self.taken, clock.stamp_ns(time_ns)) {
            Ok(()) => {
                self.published += 1;
                self.published_ns = Some(time_ns);
            }
            Err(error) => self.refused.unpublished(error),
        }
    }

    /// Stores the value received by the step at `taken_ns` if it is valid.
    fn admit(&mut self, taken_ns: u64) {
        if let Err(defect) = self.output.check(&self.taken) {
            self.refused.defective(defect);
            return;
        }
        core::mem::swap(&mut self.taken, &mut self.newest);
        self.taken_ns = taken_ns;
        if core::mem::replace(&mut self.is_pending, true) {
            self.refused.above_max_rate += 1;
        }
    }

    pub(super) fn result(&self) -> (String, Value) {
        let topic = self.output.topic().unwrap_or_default().to_string();
        let Self { received, published, refused, .. } = self;
        (topic, json!({ "received": received, "published": published, "refused": refused }))
    }
}

/// Returns `true` if the bytes are a pressed emergency stop.
fn is_pressed(value: &[u8]) -> bool {
    value.iter().any(|byte| *byte != 0)
}
