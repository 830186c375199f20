//! `motorium topic list`: all topics of a running graph.

use std::process::ExitCode;
use std::time::Duration;

use comfy_table::CellAlignment;
use motorium::region::TopicBlock;
use motorium::units::TimeSpan;
use std::sync::atomic::Ordering::Relaxed;

use super::json::Row;
use super::log;
use super::text::{names, pattern, readable};
use crate::out::outln;
use crate::report::table;
use crate::runs::{LivingRun, RunArg};

/// List all topics: type, writer, readers, rate, age.
///
/// Example: motorium topic list --json
#[derive(Debug, clap::Args)]
pub(super) struct List {
    #[command(flatten)]
    run: RunArg,
    /// Time over which to measure the rates
    #[arg(long = "for", value_name = "TIME", default_value = "500ms", allow_hyphen_values = true)]
    time: TimeSpan,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Number of publications of a topic up to a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Count {
    published: u64,
    last_ns: u64,
}

impl Count {
    fn from_block(block: &TopicBlock) -> Self {
        Self { published: block.published.load(Relaxed), last_ns: block.last_publish_ns.load(Relaxed) }
    }

    /// Publications per second, from the last publication in `earlier` to the last one in `self`.
    fn rate_since(self, earlier: Self) -> Option<f64> {
        let count = self.published.checked_sub(earlier.published)?;
        let time = self.last_ns.checked_sub(earlier.last_ns)?;
        (earlier.published > 0 && count > 0 && time > 0).then(|| count as f64 * 1e9 / time as f64)
    }
}

impl List {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.look()?;
        let (before, time) = (run.region.events().count(), Duration::from_nanos(self.time.ns));
        let mut rows = rows(&run, time);
        if rows.iter().all(|row| row.name != log::TOPIC) {
            rows.push(log::row(&run, before, time.as_secs_f64().max(1e-9)));
        }
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&rows)?);
            return Ok(ExitCode::SUCCESS);
        }
        let mut listed = table(["topic", "type", "pattern", "writer", "readers", "Hz", "published", "age"]);
        for row in rows {
            listed.add_row([
                row.name,
                row.type_name,
                row.pattern,
                row.writer,
                row.readers.join(", "),
                row.rate_hz.map_or_else(|| "-".to_string(), |rate| format!("{rate:.1}")),
                row.published.to_string(),
                row.age_ns.map_or_else(|| "-".to_string(), readable),
            ]);
        }
        for column in listed.column_iter_mut().skip(5) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        outln!("{}", listed.trim_fmt());
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns all topics of a run, with rates measured over `time`.
pub(super) fn rows(run: &LivingRun, time: Duration) -> Vec<Row> {
    let blocks = run.region.topics();
    let before: Vec<Count> = blocks.iter().map(Count::from_block).collect();
    std::thread::sleep(time);
    let topics = run.plan.topics.iter().zip(blocks).zip(before);
    topics
        .map(|((topic, block), before)| {
            let count = Count::from_block(block);
            let age = run.now_ns().saturating_sub(count.last_ns);
            Row {
                name: topic.name.clone(),
                type_name: topic.layout.type_name.clone(),
                pattern: pattern(topic.pattern),
                writer: run.plan.components[topic.writer].name.clone(),
                readers: names(&run.plan, &topic.readers),
                rate_hz: count.rate_since(before),
                published: count.published,
                dropped: block.dropped.load(Relaxed),
                age_ns: (count.published > 0).then_some(age),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::Count;

    #[test]
    fn rate_is_measured_between_publications() {
        let count = |published, last_ns| Count { published, last_ns };
        assert_eq!(count(510, 1_500_000_000).rate_since(count(10, 1_000_000_000)), Some(1000.0));
        assert_eq!(count(10, 7).rate_since(count(10, 7)), None, "nothing came meanwhile");
        assert_eq!(count(3, 7).rate_since(count(0, 0)), None, "the first one has no earlier one");
    }
}
