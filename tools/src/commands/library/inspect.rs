//! `motorium library inspect`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::file;

use crate::chart::{Chart, Series};

/// Show the content of a library.
///
/// Example: motorium library inspect letters.library
#[derive(Debug, clap::Args)]
pub(super) struct Inspect {
    /// The library
    file: PathBuf,
    /// Draw the first eigenforces over time into this SVG file
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    /// Eigenforces to draw
    #[arg(long, default_value_t = 4)]
    eigenforces: usize,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Inspect {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let library = file::read(&self.file)?;
        if let Some(plot) = &self.plot {
            let steps = library.spring().forces();
            let names = library.layout().names();
            let mut series = Vec::new();
            for k in 0..self.eigenforces.min(library.rank()) {
                let column = library.eigenforces().column(k);
                for (name, forces) in names.iter().zip(column.as_slice().chunks_exact(steps)) {
                    let points =
                        forces.iter().enumerate().map(|(i, f)| [i as f64 * library.spring().step(), *f, 0.0]);
                    series.push(Series { name: format!("{} {name}", k + 1), points: points.collect() });
                }
            }
            let (x, y) = ("time, durations".to_string(), "force".to_string());
            let chart = Chart { title: "Eigenforces".into(), x, y, log_x: false, log_y: false, series };
            std::fs::write(plot, chart.svg())?;
        }
        super::show(&library, Some(&self.file), self.json)
    }
}
