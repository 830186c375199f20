//! Recordings: making, repairing and replaying them.

mod animate;
mod export;
mod log;
mod page;
mod plot;
mod recover;
mod replay;
mod score;

use std::fs::OpenOptions;
use std::io::Write as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use motorium::os::random_bytes;
use motorium::units::TimeSpan;
use motorium_bridges::recording::{Opened, Recording, open};

pub(super) use animate::Animate;
pub(super) use export::Export;
pub(super) use page::Report;
pub(super) use plot::Plot;
pub(super) use recover::Recover;
pub(super) use replay::Replay;
pub(super) use score::Score;

use crate::out::errln;
use crate::output::{format, refuse_existing};
use crate::{overheads, style};

/// Opens a recording, and warns of missing or damaged parts.
pub(super) fn opened(file: &Path) -> anyhow::Result<Recording> {
    let recording = Recording::open(file)?;
    warn(file, recording.faults());
    Ok(recording)
}

/// Opens a recording or an MCAP file of another program, and warns of missing or damaged parts.
fn opened_any(file: &Path) -> anyhow::Result<Opened> {
    let opened = open(file)?;
    warn(
        file,
        match &opened {
            Opened::Run(recording) => recording.faults(),
            Opened::Other(log) => log.faults(),
        },
    );
    Ok(opened)
}

fn warn(file: &Path, faults: Vec<String>) {
    for fault in faults {
        errln!("{} {} {fault}", style::warning("warning:"), file.display());
    }
}

/// Name of the component that `motorium run --record` adds.
const RECORDER: &str = "recorder";

/// A file in the folder for temporary files that is removed when this is dropped.
pub(super) struct Temporary(PathBuf);

impl Temporary {
    /// Writes a file that only this user reads.
    pub(super) fn write(extension: &str, text: &str) -> anyhow::Result<Self> {
        // An unguessable name and a new file, because other users write into this folder, too.
        let name: String = random_bytes::<8>()?.iter().map(|byte| format!("{byte:02x}")).collect();
        let path = std::env::temp_dir().join(format!("motorium-{name}.{extension}"));
        let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&path);
        let this = Self(path);
        file.and_then(|mut file| file.write_all(text.as_bytes()))
            .with_context(|| format!("writing {}", this.0.display()))?;
        Ok(this)
    }

    /// Returns the file.
    pub(super) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// An overlay that adds a recorder of all topics to a graph.
pub(super) struct Overlay(Temporary);

impl Overlay {
    /// Writes an overlay that records into the file `output`.
    pub(super) fn recording(output: &Path, last: Option<TimeSpan>, overwrite: bool) -> anyhow::Result<Self> {
        anyhow::ensure!(
            !output.is_dir(),
            "{} is a folder, expected the file of a recording",
            output.display()
        );
        format(output, &["mcap"]).context("recordings are MCAP files")?;
        refuse_existing(output, overwrite)?;
        let absolute = |path: &Path| -> anyhow::Result<toml::Value> {
            let path = std::path::absolute(path).with_context(|| format!("finding {}", path.display()))?;
            Ok(path.to_str().context("the name of the recording is not UTF-8")?.into())
        };
        let mut config = toml::Table::from_iter([("output".to_string(), absolute(output)?)]);
        if let Some(last) = last {
            config.insert("last".to_string(), last.to_string().into());
        }
        if let Some(calibration) = overheads::file().filter(|file| file.exists()) {
            config.insert("attach".to_string(), vec![absolute(&calibration)?].into());
        }
        // A failure of the recorder must not stop the robot.
        let text = format!(
            "[component.{RECORDER}]\nkind = \"log.record\"\nrate = \"10 Hz\"\nschedule = \"normal\"\n\
             on_failure = \"ignore\"\n\n[component.{RECORDER}.config]\n{config}"
        );
        Ok(Self(Temporary::write("toml", &text)?))
    }

    /// Returns the file.
    pub(super) fn path(&self) -> &Path {
        self.0.path()
    }
}
