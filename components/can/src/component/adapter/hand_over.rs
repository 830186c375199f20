//! Latency from the publication of a command until its frames are sent.

use motorium::state::Stamp;
use motorium::telemetry::Histogram;

/// Latency from the publication of a command until its frames have been handed to all buses, for each command
/// that the drives follow. A command that is repeated for lack of a newer one counts once.
#[derive(Default)]
pub(super) struct HandOver {
    times: Box<Histogram>,
    /// Publisher, restart count and sequence number of the last command used.
    last: Option<(u32, u32, u64)>,
    /// Publication time of this cycle's command, ns, if the command is new.
    published_ns: Option<u64>,
}

impl HandOver {
    /// Records the command that this cycle follows; `None` if it follows none.
    pub(super) fn take(&mut self, stamp: Option<Stamp>) {
        self.published_ns = None;
        let Some(stamp) = stamp else { return };
        let this = (stamp.publisher, stamp.restart_count, stamp.sequence);
        if self.last.replace(this) != Some(this) {
            self.published_ns = Some(stamp.publish_time);
        }
    }

    /// Records that the frames of this cycle were handed over at `now_ns`, on the stamp clock.
    pub(super) fn sent(&mut self, now_ns: u64) {
        if let Some(published_ns) = self.published_ns.take() {
            self.times.record(now_ns.saturating_sub(published_ns));
        }
    }

    /// Returns percentiles, us; `None` if the drives followed no command.
    pub(super) fn result(&self) -> Option<serde_json::Value> {
        let (count, times) = (self.times.count(), self.times.percentiles());
        let us = |ns: u64| ns as f64 * 1e-3;
        (count > 0).then(|| {
            serde_json::json!({
                "count": count,
                "p50": us(times.p50),
                "p99": us(times.p99),
                "p999": us(times.p999),
                "max": us(times.max),
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(sequence: u64, publish_time: u64) -> Option<Stamp> {
        Some(Stamp { sequence, publish_time, ..Stamp::default() })
    }

    #[test]
    fn each_command_counts_once_until_its_first_frames() {
        let mut hand_over = HandOver::default();
        assert_eq!(hand_over.result(), None);
        // the second command is sent twice, and the last cycle has no command
        let cycles = [
            (command(1, 1_000), 3_000),
            (command(2, 10_000), 17_000),
            (command(2, 10_000), 90_000),
            (None, 99_000),
        ];
        for (stamp, sent_ns) in cycles {
            hand_over.take(stamp);
            hand_over.sent(sent_ns);
        }
        let result = hand_over.result().expect("two commands");
        assert_eq!((&result["count"], &result["max"]), (&2.into(), &7.0.into()), "{result}");
    }

    #[test]
    fn a_command_of_a_restarted_publisher_is_new() {
        let mut hand_over = HandOver::default();
        for restart_count in [0, 1] {
            hand_over.take(Some(Stamp { sequence: 1, restart_count, ..Stamp::default() }));
            hand_over.sent(5_000);
        }
        assert_eq!(hand_over.result().expect("two commands")["count"], 2);
    }
}
