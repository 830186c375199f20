//! `motorium library build`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::{MotionLibrary, Truncation};

use super::source::{MetricName, Shape, Source};

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
    /// What the eigenforces leave the least of
    #[arg(long, value_enum, default_value = "position")]
    metric: MetricName,
    /// Leave the least mean error with N eigenforces, instead of the least mean square with any number
    #[arg(long, value_name = "N")]
    balance: Option<usize>,
    #[command(flatten)]
    keep: KeepOptions,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// How many eigenforces are kept: all, unless one of these is given.
#[derive(Debug, Default, clap::Args)]
#[group(multiple = false)]
pub(super) struct KeepOptions {
    /// Keep so many eigenforces
    #[arg(long)]
    rank: Option<usize>,
    /// Keep as few as leave at most this part out, such as 0.05
    #[arg(long)]
    error: Option<f64>,
    /// Keep as many as fit into so many bytes
    #[arg(long)]
    bytes: Option<usize>,
}

impl KeepOptions {
    pub(super) fn keep(&self) -> Truncation {
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
        let recordings = self.shape.shaped(self.source.read()?);
        let (spring, metric) = (self.shape.spring()?, self.metric.into());
        let library = match self.balance {
            None => MotionLibrary::build(&recordings, spring, metric, self.keep.keep())?,
            Some(n) => MotionLibrary::build(&recordings, spring, metric, Truncation::All)?
                .balanced(n, self.keep.keep())?,
        };
        super::write(&library, &self.output)?;
        super::show(&library, Some(&self.output), self.json)
    }
}
