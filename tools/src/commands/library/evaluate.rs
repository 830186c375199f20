//! `motorium library evaluate`.

use std::path::PathBuf;
use std::process::ExitCode;

use indicatif::ProgressBar;
use motorium_library::{
    BALANCED, Keep, Metric, MotionLibrary, Recordings, SampledSpring, compare, nearest_neighbour_rate,
};

use super::source::{Shape, Source};
use crate::chart::{Chart, Series};
use crate::out::outln;

/// Learn from one part of recordings, and measure errors and recognition on the rest.
///
/// For each number of weights: eigenforces in both metrics, Fourier functions, and kernels.
///
/// Example: motorium library evaluate letters.jsonl --terms 4,8,16 --plot errors.svg
#[derive(Debug, clap::Args)]
pub(super) struct Evaluate {
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    shape: Shape,
    /// Hold out every K-th recording of each label
    #[arg(long, default_value_t = 5, value_name = "K")]
    hold_out: usize,
    /// Hold out a K-th of all recordings at random instead, N times; errors are means over the N, with their spread
    #[arg(long, value_name = "N")]
    splits: Option<u64>,
    /// Numbers of weights
    #[arg(long, value_delimiter = ',', default_values_t = [4, 8, 16, 32, 64])]
    terms: Vec<usize>,
    /// Draw the errors of position into this SVG file
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

const BASES: [&str; 5] = ["eigenforces, force", "eigenforces, position", BALANCED, "fourier", "kernels"];

/// A basis with a number of weights, one number for each split.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) basis: &'static str,
    pub(crate) n: usize,
    force: Vec<f64>,
    /// Mean over the movements, standard deviation and largest.
    pub(crate) position: Vec<f64>,
    deviation: Vec<f64>,
    worst: Vec<f64>,
}

/// What was measured in all splits.
#[derive(Debug, Default)]
pub(crate) struct Measured {
    pub(crate) rows: Vec<Row>,
    /// Part of the variance that each of the first eigenforces explains, in each split.
    pub(crate) explained: Vec<Vec<f64>>,
    /// Recognition in both metrics for each number of weights, in each split.
    rates: Vec<Vec<[f64; 2]>>,
}

/// Mean over the splits and standard deviation.
pub(crate) fn spread(values: &[f64]) -> [f64; 2] {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    [mean, (squares / (n - 1.0).max(1.0)).sqrt()]
}

impl Measured {
    /// Learns from one set and measures on the other.
    pub(crate) fn add(
        &mut self,
        (seen, held): (&Recordings, &Recordings),
        spring: SampledSpring,
        terms: &[usize],
        mut done: impl FnMut(),
    ) -> anyhow::Result<()> {
        let mut build = |metric| {
            done();
            MotionLibrary::build(seen, spring, metric, Keep::All)
        };
        let (force, position) = (build(Metric::Force)?, build(Metric::Position)?);
        let libraries = [(BASES[0], &force), (BASES[1], &position)];
        for (basis, e) in compare(&libraries, held, terms, &mut done) {
            let row = match self.rows.iter_mut().find(|row| row.basis == basis && row.n == e.n) {
                Some(row) => row,
                None => {
                    let none = Vec::new;
                    let (force, position, deviation, worst) = (none(), none(), none(), none());
                    self.rows.push(Row { basis, n: e.n, force, position, deviation, worst });
                    let last = self.rows.len() - 1;
                    &mut self.rows[last]
                }
            };
            row.force.push(e.force);
            row.position.push(e.position.mean);
            row.deviation.push(e.position.deviation);
            row.worst.push(e.position.worst);
        }
        self.explained.push(force.explained().into_iter().take(10).collect());
        if held.trajectories.iter().any(|trajectory| trajectory.label.is_some()) {
            let rate =
                |n: &usize| [&force, &position].map(|library| nearest_neighbour_rate(library, held, *n));
            self.rates.push(terms.iter().map(rate).collect());
        }
        Ok(())
    }
}

impl Evaluate {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let all = self.shape.shaped(self.source.read()?);
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
        let bar = ProgressBar::new((self.terms.len() as u64 + 2) * splits.len() as u64);
        let mut measured = Measured::default();
        let mut sizes = (0, 0);
        for (seen, held) in &splits {
            sizes = (seen.trajectories.len(), held.trajectories.len());
            anyhow::ensure!(
                sizes.0 > 0 && sizes.1 > 0,
                "{} recordings, too few to hold out every {}th",
                all.trajectories.len(),
                self.hold_out
            );
            measured.add((seen, held), spring, &self.terms, || bar.inc(1))?;
        }
        bar.finish_and_clear();
        if let Some(plot) = &self.plot {
            std::fs::write(plot, self.chart(&measured).svg())?;
        }
        if self.json {
            let report = self.report(&measured, sizes, splits.len());
            outln!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(ExitCode::SUCCESS);
        }
        outln!("learned from {}, measured on {}, {} time(s)", sizes.0, sizes.1, splits.len());
        let mut table =
            crate::report::table(["basis", "n", "force", "position", "spread", "deviation", "worst"]);
        for row in &measured.rows {
            let [position, spread_of_splits] = spread(&row.position);
            let spread_of_splits =
                if splits.len() > 1 { format!("{spread_of_splits:.5}") } else { String::new() };
            table.add_row([
                row.basis.to_string(),
                row.n.to_string(),
                format!("{:.4}", spread(&row.force)[0]),
                format!("{position:.5}"),
                spread_of_splits,
                format!("{:.4}", spread(&row.deviation)[0]),
                format!("{:.4}", spread(&row.worst)[0]),
            ]);
        }
        outln!("{}", table.trim_fmt());
        let explained: Vec<String> = (0..5)
            .filter_map(|k| {
                let each: Option<Vec<f64>> = measured.explained.iter().map(|e| e.get(k).copied()).collect();
                each.map(|each| format!("{:.3}", spread(&each)[0]))
            })
            .collect();
        outln!("explained by the first eigenforces (force): {}", explained.join(" "));
        for (k, n) in self.terms.iter().enumerate() {
            if let [force, position] = rates(&measured, k)[..] {
                outln!("nearest neighbour, n = {n}: {force:.3} (force), {position:.3} (position)");
            }
        }
        Ok(ExitCode::SUCCESS)
    }

    fn chart(&self, measured: &Measured) -> Chart {
        let series = BASES.into_iter().map(|name| Series {
            name: name.into(),
            points: measured
                .rows
                .iter()
                .filter(|row| row.basis == name)
                .map(|row| {
                    let [mean, of_splits] = spread(&row.position);
                    // between splits where there are several, else between movements
                    let bar = if row.position.len() > 1 { of_splits } else { spread(&row.deviation)[0] };
                    [row.n as f64, mean, bar]
                })
                .collect(),
        });
        let (x, y) = ("weights".to_string(), "error of position / spread".to_string());
        let title = "Errors on held-out recordings".to_string();
        Chart { title, x, y, log_x: true, log_y: true, series: series.collect() }
    }

    fn report(&self, measured: &Measured, (seen, held): (usize, usize), splits: usize) -> serde_json::Value {
        let errors: Vec<_> = measured
            .rows
            .iter()
            .map(|row| {
                let [mean, of_splits] = spread(&row.position);
                serde_json::json!({
                    "basis": row.basis,
                    "n": row.n,
                    "force": spread(&row.force)[0],
                    "position": {
                        "mean": mean,
                        "spread_of_splits": (splits > 1).then_some(of_splits),
                        "deviation": spread(&row.deviation)[0],
                        "worst": row.worst.iter().copied().fold(0.0, f64::max),
                    },
                })
            })
            .collect();
        let recognition = self.terms.iter().enumerate().filter_map(|(k, n)| match rates(measured, k)[..] {
            [force, position] => Some(serde_json::json!({ "n": n, "force": force, "position": position })),
            _ => None,
        });
        let first = measured.explained.first().map_or(0, Vec::len);
        let explained = (0..first).map(|k| {
            let each: Vec<f64> = measured.explained.iter().filter_map(|e| e.get(k).copied()).collect();
            spread(&each)[0]
        });
        serde_json::json!({
            "seen": seen,
            "held_out": held,
            "splits": splits,
            "explained": explained.collect::<Vec<_>>(),
            "errors": errors,
            "recognition": recognition.collect::<Vec<_>>(),
        })
    }
}

/// Recognition with the `k`-th number of weights, in both metrics: none without labels.
fn rates(measured: &Measured, k: usize) -> Vec<f64> {
    if measured.rates.is_empty() {
        return Vec::new();
    }
    [0, 1]
        .map(|metric| {
            let each: Vec<f64> = measured.rates.iter().map(|rates| rates[k][metric]).collect();
            spread(&each)[0]
        })
        .to_vec()
}
