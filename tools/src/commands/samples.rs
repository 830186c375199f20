//! Options that select the samples of a recording.

use std::path::Path;

use motorium_recordings::{Recording, Selection, read};

use crate::out::errln;
use crate::style;
use crate::values::positive;

/// The samples of recordings, selected by topic, field and channel.
#[derive(Debug, clap::Args)]
pub(super) struct SampleArgs {
    /// Field of the samples, or columns `NAME_FIELD` of a table [default: position]
    #[arg(long, value_name = "NAME")]
    field: Option<String>,
    /// Channel of an MCAP file [default: the only one with such samples, or with joint states]
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
    /// Column to keep; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    channel: Vec<String>,
    /// Samples per second of recordings without times
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate: Option<f64>,
}

impl SampleArgs {
    /// Returns the recording in `file` with whole turns removed, which are printed.
    pub(super) fn read(&self, file: &Path) -> anyhow::Result<Recording> {
        let is_mcap = file.extension().is_some_and(|ending| ending == "mcap");
        anyhow::ensure!(
            is_mcap || self.topic.is_none() || file.is_dir(),
            "{}: `--topic` selects a channel of an .mcap file, expected `--channel` for the columns of a table",
            file.display()
        );
        let selection = Selection {
            field: self.field.clone(),
            channels: self.channel.clone(),
            topic: self.topic.clone(),
            rate: self.rate,
        };
        let (recording, removed) = read(file, &selection)?.continuous();
        for removed in removed {
            errln!("{} {}: {removed}", style::warning("note:"), file.display());
        }
        Ok(recording)
    }
}
