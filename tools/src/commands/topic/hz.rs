//! `motorium topic hz`: measures the rate of a topic and the spread of its intervals.

use std::process::ExitCode;
use std::time::Duration;

use motorium::plan::ClockKind;
use motorium::telemetry::Percentiles;
use motorium::units::TimeSpan;
use serde::Serialize;

use super::find::find;
use super::pace::{Pace, percentiles};
use super::watch::{End, Look, Watch, poll_for};
use crate::out::{errln, out, outln};
use crate::report::microseconds;
use crate::runs::RunArg;
use crate::{exit, style};

/// Measure the rate of a topic and the spread of its intervals.
///
/// Rate and intervals are computed from the publisher's stamps, so the time of reading does not affect them.
///
/// Example: motorium topic hz panda/joint_state --for 5s
#[derive(Debug, clap::Args)]
pub(super) struct Hz {
    /// The topic
    #[arg(add = crate::complete::topics())]
    topic: String,
    #[command(flatten)]
    run: RunArg,
    /// Duration of the measurement
    #[arg(long = "for", value_name = "TIME", default_value = "2s", allow_hyphen_values = true)]
    time: TimeSpan,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The measurement as JSON.
#[derive(Debug, Serialize)]
struct Measured<'a> {
    topic: &'a str,
    rate_hz: Option<f64>,
    interval_ns: Option<Percentiles>,
    received: u64,
    lost: u64,
    measured_s: f64,
    clock: ClockKind,
}

impl Hz {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.look()?;
        let (_, topic) = find(&run.plan, &self.topic)?;
        let watch = Watch::open(&run, topic)?;
        let mut tap = watch.tap()?;
        let poll = poll_for(run.plan.components[topic.writer].period_ns());
        let (mut pace, mut intervals) = (Pace::default(), Vec::new());
        let end = watch.follow(poll, Some(Duration::from_nanos(self.time.ns)), || {
            let before = pace.received();
            while tap.read(|stamp, _| intervals.extend(pace.see(stamp))) {}
            Ok(if pace.received() > before { Look::Seen } else { Look::Nothing })
        })?;
        if end == End::RunOver {
            errln!("run {} is over", run.folder.id());
        }
        let measured = Measured {
            topic: &self.topic,
            rate_hz: pace.rate_hz(),
            interval_ns: percentiles(&mut intervals),
            received: pace.received(),
            lost: pace.lost(),
            measured_s: pace.span_ns() as f64 * 1e-9,
            clock: run.plan.clock,
        };
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&measured)?);
        } else {
            out!("{}", describe(&measured));
        }
        Ok(if measured.received == 0 { exit::FAILED } else { ExitCode::SUCCESS })
    }
}

fn describe(measured: &Measured<'_>) -> String {
    let Some(rate) = measured.rate_hz else {
        return format!("{}: {} samples, too few for a rate\n", measured.topic, measured.received);
    };
    let time = match measured.clock {
        ClockKind::Realtime => "",
        ClockKind::Lockstep => " of simulated time",
    };
    let mut text = format!(
        "{}  {}  over {:.2} s{time}\n",
        measured.topic,
        style::strong(format!("{rate:.3} Hz")),
        measured.measured_s
    );
    if let Some(interval) = measured.interval_ns {
        let [p50, p99, p999, max] =
            [interval.p50, interval.p99, interval.p999, interval.max].map(microseconds);
        text += &format!("  interval  p50 {p50} us, p99 {p99} us, p99.9 {p999} us, max {max} us\n");
    }
    text + &format!(
        "  samples   {} received, {} overwritten before this command read them\n",
        measured.received, measured.lost
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silent_topic_reports_too_few_samples() {
        let measured = Measured {
            topic: "a/b",
            rate_hz: None,
            interval_ns: None,
            received: 0,
            lost: 0,
            measured_s: 0.0,
            clock: ClockKind::Realtime,
        };
        assert_eq!(describe(&measured), "a/b: 0 samples, too few for a rate\n");
    }
}
