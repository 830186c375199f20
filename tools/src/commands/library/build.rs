//! `motorium library build`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::{MotionLibrary, Truncation};

use super::source::{MetricName, Shape, Source};
use crate::output::Overwrite;
use crate::values::{at_least, fraction};

/// Learn a library from recordings.
///
/// Example: motorium library build letters.jsonl --output letters.library --error 0.02
#[derive(Debug, clap::Args)]
pub(super) struct Build {
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    shape: Shape,
    /// The file to write
    #[arg(long, short)]
    output: PathBuf,
    /// Error minimised by the eigenforces
    #[arg(long, value_enum, default_value = "position")]
    metric: MetricName,
    /// Minimise the mean error with N eigenforces, instead of the mean square error with any number
    #[arg(long, value_name = "N", value_parser = at_least(1))]
    balance: Option<usize>,
    #[command(flatten)]
    truncation: TruncationOptions,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// Options that limit the number of eigenforces. Without any, all are kept.
#[derive(Debug, Default, clap::Args)]
#[group(multiple = false)]
pub(super) struct TruncationOptions {
    /// Keep this number of eigenforces
    #[arg(long, value_parser = at_least(1))]
    rank: Option<usize>,
    /// Keep the smallest number whose relative error is at most this value, such as 0.05
    #[arg(long, value_parser = fraction)]
    error: Option<f64>,
    /// Keep as many as fit into this number of bytes
    #[arg(long, value_parser = at_least(1))]
    bytes: Option<usize>,
}

impl TruncationOptions {
    pub(super) fn truncation(&self) -> Truncation {
        match (self.rank, self.error, self.bytes) {
            (Some(rank), _, _) => Truncation::Rank(rank),
            (_, Some(error), _) => Truncation::Error(error),
            (_, _, Some(bytes)) => Truncation::Bytes(bytes),
            _ => Truncation::All,
        }
    }
}

impl Build {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check(&self.source.data, [&self.output])?;
        let recordings = self.source.read()?;
        let (spring, metric) = (self.shape.spring()?, self.metric.into());
        let library = match self.balance {
            None => MotionLibrary::build(&recordings, spring, metric, self.truncation.truncation())?,
            Some(n) => MotionLibrary::build(&recordings, spring, metric, Truncation::All)?
                .balanced(n, self.truncation.truncation())?,
        };
        super::output::write(&library, &self.output)?;
        super::output::show(&library, Some(&self.output), self.json)
    }
}
