//! Errors of a primitive in reproducing its recordings.

use std::path::{Path, PathBuf};

use motorium_primitives::file::PrimitiveFile;
use motorium_primitives::rollout::Trajectory;
use serde::Serialize;

use super::shown::Shown;
use crate::output::serialize_path;
use crate::report::table;
use crate::style;

/// The printed report.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    kind: &'static str,
    recordings: usize,
    duration_s: f64,
    dimensions: Vec<Dimension>,
    /// Root mean square over all dimensions.
    rms_error: f64,
    #[serde(serialize_with = "serialize_path")]
    output: Option<PathBuf>,
    #[serde(serialize_with = "serialize_path")]
    plot: Option<PathBuf>,
}

#[derive(Debug, Serialize)]
struct Dimension {
    name: String,
    start: f64,
    goal: f64,
    lowest: f64,
    highest: f64,
    rms_error: f64,
    largest_error: f64,
}

impl Report {
    pub(super) fn new(
        file: &PrimitiveFile,
        shown: &Shown,
        reproduced: &[Trajectory],
        [output, plot]: [Option<PathBuf>; 2],
    ) -> Self {
        let mut dimensions = Vec::new();
        for (d, name) in shown.names.iter().enumerate() {
            let (mut squares, mut count, mut largest) = (0.0, 0, 0.0_f64);
            let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
            for ((_, positions), trajectory) in shown.demonstrations.iter().zip(reproduced) {
                for (k, place) in trajectory.position.iter().enumerate().take(positions.nrows()) {
                    let error = place[d] - positions[(k, d)];
                    squares += error * error;
                    count += 1;
                    largest = largest.max(error.abs());
                    lowest = lowest.min(positions[(k, d)]);
                    highest = highest.max(positions[(k, d)]);
                }
            }
            let rms_error = (squares / f64::from(count.max(1))).sqrt();
            let (start, goal) = (file.start[d], file.goal[d]);
            dimensions.push(Dimension {
                name: name.clone(),
                start,
                goal,
                lowest,
                highest,
                rms_error,
                largest_error: largest,
            });
        }
        let squares: f64 = dimensions.iter().map(|dimension| dimension.rms_error.powi(2)).sum();
        Report {
            kind: file.primitive.kind(),
            recordings: shown.recordings,
            duration_s: file.duration,
            rms_error: (squares / dimensions.len() as f64).sqrt(),
            dimensions,
            output,
            plot,
        }
    }
}

/// Largest error of a dimension, as a fraction of its range, above which its primitive is reported as
/// doubtful.
const POOR: f64 = 0.25;

impl Report {
    /// Messages about dimensions that the primitive does not reproduce. Several recordings may differ from
    /// each other; the periods of a rhythm may not.
    pub(super) fn poor(&self) -> impl Iterator<Item = String> {
        let is_rhythm = self.kind == "rhythmic";
        let advice = match is_rhythm {
            true => "check --periods, or fit more --kernels",
            false => "look for a jump in the recording, or fit more --kernels",
        };
        self.dimensions.iter().filter(move |_| is_rhythm || self.recordings == 1).filter_map(move |d| {
            let range = d.highest - d.lowest;
            let is_poor = d.largest_error > POOR * range;
            // a constant channel has no shape to reproduce
            (is_poor && range > 1e-9 * d.highest.abs().max(d.lowest.abs())).then(|| {
                format!(
                    "`{}` is reproduced with errors up to {:.2e}, {:.0} % of its range; {advice}",
                    d.name,
                    d.largest_error,
                    100.0 * d.largest_error / range
                )
            })
        })
    }
}

/// Returns a count with its noun, such as `1 recording` and `2 recordings`.
fn counted(number: usize, thing: &str) -> String {
    format!("{number} {thing}{}", if number == 1 { "" } else { "s" })
}

pub(super) fn text(report: &Report) -> String {
    let mut rows = table(["dimension", "from", "to", "lowest", "highest", "rms error", "largest error"]);
    for d in &report.dimensions {
        let number = |x: f64| format!("{x:.4}");
        let small = |x: f64| format!("{x:.2e}");
        rows.add_row([
            d.name.clone(),
            number(d.start),
            number(d.goal),
            number(d.lowest),
            number(d.highest),
            small(d.rms_error),
            small(d.largest_error),
        ]);
    }
    let wrote = |what: &str, path: &Option<PathBuf>| {
        path.as_deref().map_or_else(String::new, |path: &Path| format!("{what} {}\n", path.display()))
    };
    format!(
        "{} primitive of {}, {:.3} s, from {}\n{}\n{}{}",
        style::strong(report.kind),
        counted(report.dimensions.len(), "dimension"),
        report.duration_s,
        counted(report.recordings, "recording"),
        rows.trim_fmt(),
        wrote("wrote", &report.output),
        wrote("drew", &report.plot),
    )
}
