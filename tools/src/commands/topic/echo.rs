//! `motorium topic echo`: prints the samples of a topic.

use std::fmt::Write as _;
use std::io::{ErrorKind, Write as _};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use motorium::plan::TopicPlan;
use motorium::state::{Decoded, Decoder, FieldValue, Stamp};
use motorium::transport::Sample;

use super::super::events::Follower;
use super::content::Content;
use super::find::find;
use super::json::Line;
use super::log;
use super::pace::Pace;
use super::text::readable;
use super::watch::{End, Look, Watch, poll_for};
use crate::out::errln;
use crate::runs::{LivingRun, RunArg};
use crate::style;

/// Print the samples of a topic.
///
/// Example: motorium topic echo panda/joint_state --rate 2 --count 10
#[derive(Debug, clap::Args)]
pub(super) struct Echo {
    /// The topic
    #[arg(add = crate::complete::topics())]
    topic: String,
    #[command(flatten)]
    run: RunArg,
    /// Stop after this many samples
    #[arg(long, short = 'n', value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Maximum rate at which the newest sample is shown, in Hz [default: 10]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Show every sample, starting with the history of the topic
    #[arg(long, conflicts_with = "rate")]
    every: bool,
    /// Print one JSON object per line
    #[arg(long)]
    json: bool,
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (1e-3..=1e5).contains(&rate) => Ok(rate),
        _ => Err("expected a number of samples a second, from 0.001 to 100000".to_string()),
    }
}

impl Echo {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.look()?;
        if self.topic == log::TOPIC && run.plan.topics.iter().all(|topic| topic.name != log::TOPIC) {
            return self.log(&run);
        }
        let (index, topic) = find(&run.plan, &self.topic)?;
        let joints = motorium_bridges::foxglove::joints_of_topic(&run.plan, index).unwrap_or_default();
        let decoder = Decoder::new(&topic.layout)?;
        let shown = Shown { run: &run, topic, decoder: &decoder, joints: &joints };
        let watch = Watch::open(&run, topic)?;
        let end = if self.every { self.every(&watch, &shown)? } else { self.newest(&watch, &shown)? };
        if end == End::RunOver {
            errln!("run {} is over", run.folder.id());
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Prints the newest sample in place whenever it is due.
    fn newest(&self, watch: &Watch<'_>, shown: &Shown<'_>) -> anyhow::Result<End> {
        let mut reader = watch.reader()?;
        let interval = Duration::from_secs_f64(1.0 / self.rate.unwrap_or(10.0));
        let (mut count, mut due) = (0, Instant::now());
        watch.follow(interval.min(Duration::from_millis(20)), None, || {
            let now = Instant::now();
            if now < due || !reader.poll() {
                return Ok(if reader.stamp().is_some() { Look::Seen } else { Look::Nothing });
            }
            let (Some(stamp), Some(bytes)) = (reader.stamp(), reader.bytes()) else {
                return Ok(Look::Nothing);
            };
            due = (due + interval).max(now);
            count += 1;
            self.print(shown, stamp, bytes, count)
        })
    }

    /// Prints every sample that can be read before it is overwritten.
    fn every(&self, watch: &Watch<'_>, shown: &Shown<'_>) -> anyhow::Result<End> {
        let mut tap = watch.tap()?;
        let (mut pace, mut count) = (Pace::default(), 0);
        let period_ns = shown.run.plan.components[shown.topic.writer].period_ns();
        let end = watch.follow(poll_for(period_ns), None, || {
            // A slow terminal must not delay the reading.
            let samples: Vec<Sample> = core::iter::from_fn(|| tap.next_unread()).collect();
            for sample in &samples {
                pace.see(&sample.stamp);
                count += 1;
                if self.print(shown, &sample.stamp, &sample.bytes, count)? == Look::Enough {
                    return Ok(Look::Enough);
                }
            }
            Ok(if samples.is_empty() { Look::Nothing } else { Look::Seen })
        })?;
        if pace.lost() > 0 {
            errln!("{} samples were overwritten before they could be read", pace.lost());
        }
        Ok(end)
    }

    /// Prints the sample with this number. Returns [`Look::Enough`] at `--count`, or if the reader has closed
    /// the pipe.
    fn print(&self, shown: &Shown<'_>, stamp: &Stamp, bytes: &[u8], number: u64) -> anyhow::Result<Look> {
        let Shown { run, topic, decoder, joints } = *shown;
        let is_last = self.count == Some(number);
        let value = match Content::read(topic, decoder, bytes) {
            Ok(value) => value,
            Err(error) => {
                errln!("sample {} of `{}` is malformed: {error}", stamp.sequence, self.topic);
                return Ok(if is_last { Look::Enough } else { Look::Seen });
            }
        };
        let line = Line {
            topic: &self.topic,
            sequence: stamp.sequence,
            time_s: stamp.publish_time.saturating_sub(run.start_ns()) as f64 * 1e-9,
            publish_time_ns: stamp.publish_time,
            source_time_ns: stamp.source_time,
            age_ns: run.now_ns().saturating_sub(stamp.publish_time),
            publisher: run
                .plan
                .components
                .get(stamp.publisher as usize)
                .map(|component| component.name.as_str()),
            restart_count: stamp.restart_count,
            joints: Some(joints).filter(|joints| are_of_joints(&value, joints.len())),
            episode: stamp.episode,
            value: &value,
        };
        Ok(if self.write(&line)? && !is_last { Look::Seen } else { Look::Enough })
    }

    /// Writes a line. Returns `false` once the reader has closed the pipe.
    fn write(&self, line: &Line<'_>) -> anyhow::Result<bool> {
        let text = if self.json { serde_json::to_string(line)? + "\n" } else { lines(line) };
        let mut out = anstream::stdout().lock();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
            Err(error) => Err(error.into()),
        }
    }
}

impl Echo {
    /// Prints all events of a run as messages.
    fn log(&self, run: &LivingRun) -> anyhow::Result<ExitCode> {
        anyhow::ensure!(
            self.rate.is_none(),
            "each event of `{}` is shown as it arrives; remove --rate",
            log::TOPIC
        );
        run.stand_aside();
        let mut follower = Follower::new(run);
        let mut shown = 0;
        while let Some(records) = follower.next() {
            for record in &records {
                shown += 1;
                let message = log::message(record);
                let value = Content::Value(log::decoded(&message));
                if !self.write(&log::line(run, record, shown, &value))? || self.count == Some(shown) {
                    return Ok(ExitCode::SUCCESS);
                }
            }
        }
        errln!("run {} is over", run.folder.id());
        Ok(ExitCode::SUCCESS)
    }
}

/// The topic that is shown, and how.
#[derive(Clone, Copy)]
struct Shown<'a> {
    run: &'a LivingRun,
    topic: &'a TopicPlan,
    decoder: &'a Decoder,
    /// Names of the joints to which its arrays belong.
    joints: &'a [String],
}

/// Returns `true` if a value has arrays with one entry per joint.
fn are_of_joints(value: &Content<'_>, joints: usize) -> bool {
    let Content::Value(value) = value else { return false };
    joints > 0 && value.0.iter().any(|(_, value)| is_of_joints(value, joints))
}

fn is_of_joints(value: &FieldValue, joints: usize) -> bool {
    matches!(value, FieldValue::Many(numbers) if numbers.len() == joints)
}

/// Returns a sample as readable lines: the stamp, then its content.
fn lines(line: &Line<'_>) -> String {
    let chain = line.publish_time_ns.saturating_sub(line.source_time_ns);
    let text = format!(
        "{} {}\n",
        style::strong(format!("#{} at {:.6} s", line.sequence, line.time_s)),
        style::dim(format!("age {}, {} after its source", readable(line.age_ns), readable(chain)))
    );
    let value = match line.value {
        Content::Value(value) => value,
        Content::Slice(slice) => return text + &slice.lines(),
    };
    text + &value_lines(value, line.joints.unwrap_or_default())
}

/// Formats a value with one field per line; arrays with one entry per joint become a table with one row per
/// joint.
fn value_lines(value: &Decoded<'_>, joints: &[String]) -> String {
    let mut text = String::new();
    let tabled = |value: &FieldValue| !joints.is_empty() && is_of_joints(value, joints.len());
    let plain = || value.0.iter().filter(|(_, value)| !tabled(value));
    let width = plain().map(|(name, _)| name.len()).max().unwrap_or(0);
    for (name, value) in plain() {
        let _ = write!(text, "  {name:width$} ");
        if let FieldValue::Text(words) = value {
            let _ = write!(text, " {words:?}");
        }
        for number in value.numbers() {
            let _ = write!(text, " {:>11}", number.to_string());
        }
        text.push('\n');
    }
    let columns: Vec<(&str, Vec<String>)> = value
        .0
        .iter()
        .filter(|(_, value)| tabled(value))
        .map(|(name, value)| (*name, value.numbers().iter().map(ToString::to_string).collect()))
        .collect();
    if columns.is_empty() {
        return text;
    }
    // five columns next to names of 20 letters are 80 characters wide
    let widths = |(name, numbers): &(&str, Vec<String>)| {
        numbers.iter().map(String::len).chain([name.len(), 10]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = columns.iter().map(widths).collect();
    let first = joints.iter().map(String::len).chain(["joint".len()]).max().unwrap_or(0);
    let _ = write!(text, "  {:first$}", "joint");
    for ((name, _), width) in columns.iter().zip(&widths) {
        let _ = write!(text, " {name:>width$}");
    }
    text.push('\n');
    for (index, joint) in joints.iter().enumerate() {
        let _ = write!(text, "  {joint:first$}");
        for ((_, numbers), width) in columns.iter().zip(&widths) {
            let _ = write!(text, " {:>width$}", numbers[index]);
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use motorium::state::Number;

    use super::*;

    #[test]
    fn joint_arrays_are_a_table_with_one_row_per_joint() {
        let many = |numbers: &[f64]| FieldValue::Many(numbers.iter().map(|x| Number::Double(*x)).collect());
        let value = Content::Value(Decoded(vec![
            ("count", FieldValue::One(Number::Natural(2))),
            ("position", many(&[0.5, -1.0])),
            ("velocity", many(&[0.0, 2.0])),
        ]));
        let joints = ["hip".to_string(), "knee".to_string()];
        let line = Line {
            topic: "leg/state",
            sequence: 7,
            time_s: 1.5,
            publish_time_ns: 2000,
            source_time_ns: 1000,
            age_ns: 0,
            publisher: None,
            restart_count: 0,
            episode: 0,
            joints: Some(&joints),
            value: &value,
        };
        let text = lines(&line);
        let table: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(
            table,
            [
                "  count            2",
                "  joint   position   velocity",
                "  hip     0.500000   0.000000",
                "  knee   -1.000000   2.000000",
            ]
        );
        assert!(!are_of_joints(&value, 3) && !are_of_joints(&value, 0));
    }
}
