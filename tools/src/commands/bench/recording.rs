//! `motorium bench recording`: runs a graph alternately with and without a recorder.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use comfy_table::CellAlignment;
use motorium::launcher::{Exit, Options};
use motorium::plan::{ClockKind, Plan};
use motorium::session::Session;
use motorium::telemetry::Snapshot;
use motorium::units::TimeSpan;
use serde_json::json;

use crate::commands::loading::{DEFAULT_GRAPH, GraphArgs, graph_file};
use crate::commands::recording::Overlay;
use crate::commands::view::Watched;
use crate::metrics::Sample;
use crate::out::{errln, outln};
use crate::runs::RunArg;
use crate::{registry, report};

/// Run a graph alternately with and without a recorder of all topics, and compare its times.
///
/// Each turn consists of a run without and a run with `--record`, in real time. With `--view`, a client of
/// `motorium view` also subscribes to every channel of the recorded run. Prints medians over the turns for
/// each latency of the graph and the execution time of each component. The ratio with / without recorder is
/// printed with its smallest and largest value in any turn. If these are on both sides of 1, the recorder's
/// cost is below the noise. Run it on an idle machine.
///
/// Example: motorium bench recording graphs/panda-reach.toml --turns 9
#[derive(Debug, clap::Args)]
pub(crate) struct Recording {
    /// The graph
    #[arg(default_value = DEFAULT_GRAPH, value_parser = graph_file())]
    graph: PathBuf,
    /// Number of turns
    #[arg(long, short = 'n', default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    turns: u32,
    /// Duration of each run
    #[arg(long = "for", value_name = "TIME", default_value = "4 s", allow_hyphen_values = true)]
    duration: TimeSpan,
    /// Also view all channels of the recorded runs through `motorium view`
    #[arg(long)]
    view: bool,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
}

/// Quantiles to compare.
const QUANTILES: [(&str, f64); 2] = [("p50", 0.5), ("p99", 0.99)];

/// The cost of the recorder in all turns.
#[derive(Default)]
struct Cost {
    /// Number of samples overwritten before the recorder read them.
    lost: u64,
    /// Processor time, s.
    cpu_s: f64,
}

/// The times of one quantity in each turn, ns.
struct Row {
    name: String,
    /// By quantile, then without and with the recorder.
    times: [[Vec<f64>; 2]; 2],
}

impl Recording {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let folder = std::env::temp_dir().join(format!("motorium-bench-{}", std::process::id()));
        std::fs::create_dir(&folder).with_context(|| folder.display().to_string())?;
        let measured = self.measure(&folder.join("run.mcap"));
        let _ = std::fs::remove_dir_all(&folder);
        let (rows, Cost { lost, cpu_s }) = match measured? {
            Ok(measured) => measured,
            Err(code) => return Ok(code),
        };
        if self.json {
            let rows = rows.iter().map(Row::json);
            let all = json!({ "turns": self.turns, "view": self.view, "lost": lost, "cpu_s": cpu_s, "times": rows.collect::<Vec<_>>() });
            outln!("{}", serde_json::to_string_pretty(&all)?);
            return Ok(ExitCode::SUCCESS);
        }
        let head =
            ["us", "p50 without", "with", "ratio (of turns)", "p99 without", "with", "ratio (of turns)"];
        let mut shown = report::table(head);
        for row in &rows {
            let cells = (0..QUANTILES.len()).flat_map(|which| row.cells(which));
            shown.add_row(std::iter::once(row.name.clone()).chain(cells));
        }
        shown.column_iter_mut().skip(1).for_each(|column| column.set_cell_alignment(CellAlignment::Right));
        outln!("{shown}");
        let recorded_s = f64::from(self.turns) * Duration::from(self.duration).as_secs_f64();
        outln!(
            "{} turns of {} each; {lost} samples lost; the recorder takes {:.2} % of a core",
            self.turns,
            self.duration,
            100.0 * cpu_s / recorded_s
        );
        Ok(ExitCode::SUCCESS)
    }

    /// Returns the times of all turns and the cost of the recorder, or an exit code if the graph is invalid.
    fn measure(&self, file: &Path) -> anyhow::Result<Result<(Vec<Row>, Cost), ExitCode>> {
        let overlay = Overlay::recording(file, None, true)?;
        let mut plans = Vec::new();
        for with in [Vec::new(), vec![overlay.path().to_path_buf()]] {
            let graph = GraphArgs { graph: self.graph.clone(), with, ..GraphArgs::default() };
            match graph.load(&registry::registry()) {
                Ok(checked) => plans.push(checked.plan),
                Err(code) => return Ok(Err(code)),
            }
        }
        let name = self.graph.display();
        anyhow::ensure!(
            plans[0].clock == ClockKind::Realtime,
            "{name} has the clock \"lockstep\", which measures no times: choose a graph with `clock = \"realtime\"`"
        );
        let (mut rows, mut cost): (Vec<Row>, Cost) = (Vec::new(), Cost::default());
        for turn in 0..self.turns {
            // The second run may find a warmer machine, so the order alternates.
            for with in if turn % 2 == 0 { [0, 1] } else { [1, 0] } {
                let times = self.once(plans[with].clone(), self.view && with == 1, &mut cost)?;
                for (name, snapshot) in times {
                    let row = match rows.iter().position(|row| row.name == name) {
                        Some(row) => row,
                        None => {
                            rows.push(Row { name, times: Default::default() });
                            rows.len() - 1
                        }
                    };
                    for (which, (_, share)) in QUANTILES.iter().enumerate() {
                        rows[row].times[which][with].push(quantile(&snapshot, *share));
                    }
                }
            }
            if !self.json {
                errln!("turn {} of {}", turn + 1, self.turns);
            }
        }
        // The recorder itself only exists in one of the two.
        rows.retain(|row| row.times[0].iter().all(|turns| !turns.is_empty()));
        Ok(Ok((rows, cost)))
    }

    /// Measures the latencies and execution times of one run.
    fn once(&self, mut plan: Plan, viewed: bool, cost: &mut Cost) -> anyhow::Result<Vec<(String, Snapshot)>> {
        plan.expectations.clear();
        plan.duration_ns = None;
        let mut session =
            Session::launch(plan, &registry::registry(), &Options::processes(std::env::current_exe()?))?;
        let mut viewer = viewed.then(|| Watched::start(session.id())).transpose()?;
        session.step_until(Duration::from(self.duration))?;
        let is_viewed = viewer.as_mut().is_none_or(Watched::goes_on);
        anyhow::ensure!(is_viewed, "the viewer has ended before the run");
        drop(viewer);
        let run = RunArg::named(Some(session.id())).open()?;
        let Sample { latencies, components, .. } = Sample::take(&run);
        let name = |topic: usize| run.plan.topics[topic].name.clone();
        let names = run
            .plan
            .latencies
            .iter()
            .map(|latency| format!("{} -> {}", name(latency.from), name(latency.to)));
        let latencies = names.zip(latencies.into_iter().map(|latency| latency.latency));
        let names = run.plan.components.iter().map(|component| component.name.clone());
        let components = names.zip(components.into_iter().map(|component| component.execution));
        let times = latencies.chain(components).collect();
        let ended = session.stop();
        if let Exit::SafeStop { reason } = &ended.exit {
            anyhow::bail!("{}: safe stop: {reason}", self.graph.display());
        }
        cost.lost += ended.results.values().filter_map(|result| result["lost"].as_u64()).sum::<u64>();
        cost.cpu_s += ended.results.values().filter_map(|result| result["cpu_s"].as_f64()).sum::<f64>();
        Ok(times)
    }
}

impl Row {
    /// Returns the ratio of the medians, and the smallest and largest ratio of a turn.
    fn ratios(&self, which: usize) -> [f64; 3] {
        let [without, with] = &self.times[which];
        let of_turns = with.iter().zip(without).map(|(with, without)| with / without.max(1.0));
        let (least, most) =
            of_turns.fold((f64::INFINITY, 0.0_f64), |(least, most), it| (least.min(it), most.max(it)));
        [median(with) / median(without).max(1.0), least, most]
    }

    fn cells(&self, which: usize) -> [String; 3] {
        let [without, with] = [0, 1].map(|with| format!("{:.2}", median(&self.times[which][with]) * 1e-3));
        let [ratio, least, most] = self.ratios(which);
        [without, with, format!("{ratio:.3} ({least:.2} to {most:.2})")]
    }

    fn json(&self) -> serde_json::Value {
        let mut all = json!({ "name": self.name });
        for (which, (quantile, _)) in QUANTILES.iter().enumerate() {
            let [without, with] = &self.times[which];
            all[quantile] = json!({ "without_ns": without, "with_ns": with, "ratio": self.ratios(which)[0] });
        }
        all
    }
}

/// Returns the quantile of a histogram, ns, interpolated linearly within its bucket. Buckets have a relative
/// width of up to 1/32, more than the cost of a recorder.
fn quantile(snapshot: &Snapshot, share: f64) -> f64 {
    let (wanted, mut seen) = (share * snapshot.count() as f64, 0.0);
    // The last bucket is filled up to this point.
    let greatest = snapshot.percentiles().max;
    for &(bound, count) in snapshot.buckets() {
        let count = count as f64;
        if seen + count >= wanted && count > 0.0 {
            // Bucket width: 1/32 of the next lower power of two, at least 1 ns.
            let width = (((bound + 1).next_power_of_two() / 2).max(32) / 32) as f64;
            let (low, high) = (bound as f64 - width, bound.min(greatest) as f64);
            return low + (high - low) * (wanted - seen) / count;
        }
        seen += count;
    }
    0.0
}

fn median(values: &[f64]) -> f64 {
    let mut rising = values.to_vec();
    rising.sort_by(f64::total_cmp);
    let middle = rising.len() / 2;
    match rising.len() % 2 {
        _ if rising.is_empty() => 0.0,
        0 => 0.5 * (rising[middle - 1] + rising[middle]),
        _ => rising[middle],
    }
}

#[cfg(test)]
mod tests {
    use motorium::telemetry::Histogram;

    use super::*;

    #[test]
    fn even_median_is_the_mean_of_the_middle_two() {
        assert_eq!((median(&[3.0, 1.0, 2.0]), median(&[4.0, 1.0, 3.0, 2.0]), median(&[])), (2.0, 2.5, 0.0));
    }

    #[test]
    fn quantiles_are_finer_than_the_buckets_of_their_histogram() {
        // Evenly spread values have known quantiles.
        for scale in [1_u64, 13, 400] {
            let histogram = Histogram::default();
            (0..20_000).for_each(|value| histogram.record(10_000 + value * scale));
            for share in [0.1, 0.5, 0.9, 0.99] {
                let expected = 10_000.0 + 20_000.0 * share * scale as f64;
                let found = quantile(&histogram.snapshot(), share);
                assert!(
                    (found / expected - 1.0).abs() < 1e-3,
                    "{scale}, {share}: {found}, expected {expected}"
                );
            }
        }
        assert_eq!(quantile(&Snapshot::default(), 0.5), 0.0);
    }
}
