//! `motorium library inspect`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::file;

use crate::eigenforces::eigenforces;

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
    /// Number of eigenforces to draw
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
            let chart = eigenforces(&library, "Eigenforces", 0..self.eigenforces);
            std::fs::write(plot, chart.svg())?;
        }
        super::output::show(&library, Some(&self.file), self.json)
    }
}
