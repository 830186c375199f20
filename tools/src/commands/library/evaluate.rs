//! `motorium library evaluate`.

use std::path::PathBuf;
use std::process::ExitCode;

use indicatif::ProgressBar;
use motorium_library::cross_validation::BASES;
use motorium_library::statistics::mean_and_deviation;
use motorium_library::{CrossValidation, Recordings};
use motorium_pictures::chart::{Chart, Series};

use super::source::{Shape, Source};
use crate::out::outln;
use crate::output::{Overwrite, check_format, write_file};
use crate::values::at_least;

/// Learn from some of the recordings, and measure errors and recognition on the others.
///
/// Compares eigenforces in both metrics, Fourier functions and kernels for each number of weights.
///
/// Example: motorium library evaluate letters.jsonl --eigenforces 4,8,16 --plot errors.svg
#[derive(Debug, clap::Args)]
pub(super) struct Evaluate {
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    shape: Shape,
    /// Hold out every K-th recording of each label
    #[arg(long, default_value_t = 5, value_name = "K", value_parser = at_least(2))]
    hold_out: usize,
    /// Hold out 1/K of all recordings at random instead, N times; errors are means over the splits, with
    /// their spread
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    splits: Option<u64>,
    /// Numbers of weights
    #[arg(long, value_delimiter = ',', default_values_t = [4, 8, 16, 32, 64], value_parser = at_least(1))]
    eigenforces: Vec<usize>,
    /// Draw the position errors into this SVG file
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Evaluate {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check(&self.source.data, &self.plot)?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let all = self.source.read()?;
        let spring = self.shape.spring()?;
        let splits: Vec<(Recordings, Recordings)> = match self.splits {
            None => vec![all.hold_out(self.hold_out)],
            Some(n) => (1..=n.max(1))
                .map(|seed| {
                    let (held, seen) = all.split(1.0 / self.hold_out.max(2) as f64, seed);
                    (seen, held)
                })
                .collect(),
        };
        let mut measured = CrossValidation::new(self.eigenforces.clone());
        let bar = ProgressBar::new((measured.progress_of_split() * splits.len()) as u64);
        let mut sizes = (0, 0);
        for (seen, held) in &splits {
            sizes = (seen.trajectories.len(), held.trajectories.len());
            anyhow::ensure!(
                sizes.0 > 0 && sizes.1 > 0,
                "{} recordings, too few to hold out every {}th",
                all.trajectories.len(),
                self.hold_out
            );
            measured.add(seen, held, spring, || bar.inc(1))?;
        }
        bar.finish_and_clear();
        if let Some(plot) = &self.plot {
            write_file(plot, self.chart(&measured).svg())?;
        }
        if self.json {
            let report = self.report(&measured, sizes);
            outln!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(ExitCode::SUCCESS);
        }
        let times = if splits.len() == 1 { "once".to_string() } else { format!("{} times", splits.len()) };
        outln!("learned from {}, measured on {}, {times}", sizes.0, sizes.1);
        let mut table =
            crate::report::table(["basis", "n", "force", "position", "spread", "deviation", "worst"]);
        let mean = |values: &[f64]| mean_and_deviation(values).0;
        for row in measured.errors() {
            let (position, spread_of_splits) = mean_and_deviation(&row.position);
            let spread_of_splits =
                if splits.len() > 1 { format!("{spread_of_splits:.5}") } else { String::new() };
            table.add_row([
                row.basis.to_string(),
                row.n.to_string(),
                format!("{:.4}", mean(&row.force)),
                format!("{position:.5}"),
                spread_of_splits,
                format!("{:.4}", mean(&row.deviation)),
                format!("{:.4}", mean(&row.worst)),
            ]);
        }
        outln!("{}", table.trim_fmt());
        let explained: Vec<String> =
            measured.explained().iter().take(5).map(|part| format!("{part:.3}")).collect();
        outln!("explained by the first eigenforces (force): {}", explained.join(" "));
        for (k, n) in self.eigenforces.iter().enumerate() {
            if let Some([force, position]) = measured.recognition(k) {
                outln!("nearest neighbour, n = {n}: {force:.3} (force), {position:.3} (position)");
            }
        }
        Ok(ExitCode::SUCCESS)
    }

    fn chart(&self, measured: &CrossValidation) -> Chart {
        let series = BASES.into_iter().map(|name| Series {
            name: name.into(),
            points: measured
                .errors()
                .iter()
                .filter(|row| row.basis == name)
                .map(|row| {
                    let (mean, of_splits) = mean_and_deviation(&row.position);
                    // between splits where there are several, else between movements
                    let bar = if measured.splits() > 1 { of_splits } else { row.deviation[0] };
                    [row.n as f64, mean, bar]
                })
                .collect(),
        });
        let (x, y) = ("weights".to_string(), "error of position / spread".to_string());
        let title = "Errors on held-out recordings".to_string();
        Chart { title, x, y, log_x: true, log_y: true, series: series.collect() }
    }

    fn report(&self, measured: &CrossValidation, (seen, held): (usize, usize)) -> serde_json::Value {
        let splits = measured.splits();
        let mean = |values: &[f64]| mean_and_deviation(values).0;
        let errors: Vec<_> = measured
            .errors()
            .iter()
            .map(|row| {
                let (position, of_splits) = mean_and_deviation(&row.position);
                serde_json::json!({
                    "basis": row.basis,
                    "n": row.n,
                    "force": mean(&row.force),
                    "position": {
                        "mean": position,
                        "spread_of_splits": (splits > 1).then_some(of_splits),
                        "deviation": mean(&row.deviation),
                        "worst": row.worst.iter().copied().fold(0.0, f64::max),
                    },
                })
            })
            .collect();
        let recognition = self.eigenforces.iter().enumerate().filter_map(|(k, n)| {
            let [force, position] = measured.recognition(k)?;
            Some(serde_json::json!({ "n": n, "force": force, "position": position }))
        });
        serde_json::json!({
            "seen": seen,
            "held_out": held,
            "splits": splits,
            "explained": measured.explained(),
            "errors": errors,
            "recognition": recognition.collect::<Vec<_>>(),
        })
    }
}
