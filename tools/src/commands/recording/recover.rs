//! `motorium recover`: repairs a recording whose writer was interrupted.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_bridges::recording::recover;

use crate::out::outln;

/// Repair a recording that a power cut or a full disk has torn: everything up to the damage, with index and end.
///
/// The torn file stays as it is.
///
/// Example: motorium recover torn.mcap --output whole.mcap
#[derive(Debug, clap::Args)]
pub(crate) struct Recover {
    /// The torn file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The repaired file; FILE with `.recovered.mcap` in place of `.mcap` if not given
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

impl Recover {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let output = self.output.unwrap_or_else(|| self.file.with_extension("recovered.mcap"));
        anyhow::ensure!(
            output.canonicalize().ok().is_none_or(|there| self.file.canonicalize().ok() != Some(there)),
            "{} would be written over while it is read: name another file by `--output`",
            self.file.display()
        );
        let recovered = recover(&self.file, &output)?;
        let what = if recovered.was_whole { "it was whole" } else { "its end was torn" };
        outln!(
            "{}: {} messages, {} bytes at the end unreadable ({what})",
            output.display(),
            recovered.messages,
            recovered.lost_bytes
        );
        Ok(ExitCode::SUCCESS)
    }
}
