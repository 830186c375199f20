//! `motorium library evaluate`.

use std::path::PathBuf;
use std::process::ExitCode;

use indicatif::ProgressBar;
use motorium_policies::library::{Keep, Metric, MotionLibrary, compare, nearest_neighbour_rate};

use super::source::{Shape, Source};
use crate::commands::reproduce::chart::{Chart, Series};

/// Learn from one part of recordings, and measure errors and recognition on the rest.
///
/// For each number of weights: eigenforces in both metrics, Fourier functions, and kernels.
#[derive(Debug, clap::Args)]
pub(super) struct Evaluate {
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    shape: Shape,
    /// Hold out every K-th recording of each label
    #[arg(long, default_value_t = 5, value_name = "K")]
    hold_out: usize,
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

impl Evaluate {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let all = self.source.read()?;
        let (seen, held) = all.hold_out(self.hold_out);
        anyhow::ensure!(
            !held.trajectories.is_empty(),
            "{} recordings, too few to hold out every {}th",
            all.trajectories.len(),
            self.hold_out
        );
        let spring = self.shape.spring()?;
        let bar = ProgressBar::new(self.terms.len() as u64 + 2);
        let build = |metric| {
            bar.inc(1);
            MotionLibrary::build(&seen, spring, metric, Keep::All)
        };
        let (force, position) = (build(Metric::Force)?, build(Metric::Position)?);
        let libraries = [("eigenforces, force", &force), ("eigenforces, position", &position)];
        let found = compare(&libraries, &held, &self.terms, || bar.inc(1));
        let labelled = held.trajectories.iter().any(|trajectory| trajectory.label.is_some());
        let rates: Vec<Option<[f64; 2]>> = self
            .terms
            .iter()
            .map(|&n| {
                labelled.then(|| [&force, &position].map(|library| nearest_neighbour_rate(library, &held, n)))
            })
            .collect();
        bar.finish_and_clear();
        if let Some(plot) = &self.plot {
            let names = ["eigenforces, force", "eigenforces, position", "fourier", "kernels"];
            let series = names.into_iter().map(|name| Series {
                name: name.into(),
                points: found
                    .iter()
                    .filter(|(basis, _)| *basis == name)
                    .map(|(_, e)| [e.n as f64, e.position.mean, e.position.deviation])
                    .collect(),
            });
            let (x, y) = ("weights".to_string(), "error of position / spread".to_string());
            let title = "Errors on held-out recordings".to_string();
            std::fs::write(
                plot,
                Chart { title, x, y, log_x: true, log_y: true, series: series.collect() }.svg(),
            )?;
        }
        if self.json {
            let errors: Vec<_> = found
                .iter()
                .map(|(basis, e)| serde_json::json!({ "basis": basis, "n": e.n, "force": e.force, "position": e.position }))
                .collect();
            let recognition: Vec<_> = self
                .terms
                .iter()
                .zip(&rates)
                .filter_map(|(n, rates)| {
                    rates.map(|[f, p]| serde_json::json!({ "n": n, "force": f, "position": p }))
                })
                .collect();
            let report = serde_json::json!({
                "seen": seen.trajectories.len(),
                "held_out": held.trajectories.len(),
                "explained": force.explained().iter().take(10).collect::<Vec<_>>(),
                "errors": errors,
                "recognition": recognition,
            });
            println!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(ExitCode::SUCCESS);
        }
        println!("learned from {}, measured on {}", seen.trajectories.len(), held.trajectories.len());
        let mut table = crate::report::table(["basis", "n", "force", "position", "deviation", "worst"]);
        for (basis, e) in &found {
            let p = &e.position;
            let row = [e.force, p.mean, p.deviation, p.worst].map(|x| format!("{x:.4}"));
            table.add_row([vec![(*basis).to_string(), e.n.to_string()], row.to_vec()].concat());
        }
        println!("{}", table.trim_fmt());
        for (n, rates) in self.terms.iter().zip(&rates) {
            if let Some([force, position]) = rates {
                println!("nearest neighbour, n = {n}: {force:.3} (force), {position:.3} (position)");
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}
