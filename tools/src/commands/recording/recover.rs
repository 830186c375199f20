//! `motorium recover`: repairs a recording that is torn or damaged.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_bridges::recording::recover;

use crate::out::{errln, outln};
use crate::output::refuse_existing;
use crate::{exit, style};

/// Repair a recording that was cut short by a power failure or a full disk, or whose bytes have changed.
///
/// Writes the readable part to a new file with index and end; reading continues after damaged parts. The
/// original file is not changed. Messages of damaged chunks are copied without a checksum, and the new file
/// lists damaged and missing parts.
///
/// The exit code is 7 if messages are missing or damaged, and 0 if only the unfinished end was lost.
///
/// Example: motorium recover torn.mcap --output whole.mcap
#[derive(Debug, clap::Args)]
pub(crate) struct Recover {
    /// The damaged file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The repaired file [default: FILE with `.recovered.mcap` in place of `.mcap`]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    overwrite: bool,
}

impl Recover {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let output = self.output.unwrap_or_else(|| self.file.with_extension("recovered.mcap"));
        anyhow::ensure!(
            output.canonicalize().ok().is_none_or(|there| self.file.canonicalize().ok() != Some(there)),
            "the output {} is the input file: name another file with `--output`",
            self.file.display()
        );
        refuse_existing(&output, self.overwrite)?;
        let recovered = recover(&self.file, &output)?;
        let is_torn = !recovered.was_whole;
        let (file, messages, bytes) = (output.display(), recovered.messages, recovered.lost_bytes);
        if recovered.is_clean() {
            let what = if is_torn { "its end was torn" } else { "it was whole" };
            outln!("{file}: {messages} messages, {bytes} bytes at the end unreadable ({what})");
            return Ok(ExitCode::SUCCESS);
        }
        let torn = if is_torn { ", and its end was torn" } else { "" };
        outln!("{file}: {messages} messages, {bytes} bytes unreadable (it was damaged{torn})");
        let losses: Vec<String> =
            recovered.losses().iter().map(|(what, count)| format!("{what}: {count}")).collect();
        errln!("{} {} is damaged: {}", style::warning("warning:"), self.file.display(), losses.join(", "));
        Ok(exit::incomplete())
    }
}
