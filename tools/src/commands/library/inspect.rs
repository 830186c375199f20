//! `motorium library inspect`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::file;

use crate::eigenforces::eigenforces;
use crate::output::{Overwrite, check_format, write_file};
use crate::values::at_least;

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
    #[arg(long, default_value_t = 4, value_parser = at_least(1))]
    eigenforces: usize,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Inspect {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check([&self.file], &self.plot)?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let library = file::read(&self.file)?;
        if let Some(plot) = &self.plot {
            let chart = eigenforces(&library, "Eigenforces", 0..self.eigenforces);
            write_file(plot, chart.svg())?;
        }
        super::output::show(&library, Some(&self.file), self.json)
    }
}
