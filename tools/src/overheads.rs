//! Overheads of this machine: measured by `motorium calibrate --save`, used by `check` and `run`.

use std::path::PathBuf;

use anyhow::Context as _;
use motorium::os::machine;
use motorium::schedule::Overheads;
use serde::{Deserialize, Serialize};

/// The machine and the kernel of a measurement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Machine {
    /// Release and version of the kernel.
    pub(crate) kernel: String,
    /// Model of the processor.
    pub(crate) processor: String,
    /// Number of cores.
    pub(crate) cores: usize,
}

impl Machine {
    /// Describes this machine.
    pub(crate) fn this() -> Self {
        let kernel = machine::Kernel::detect();
        Self {
            kernel: format!("{} {}", kernel.release, kernel.version),
            processor: machine::processor(),
            cores: machine::online_cores().len(),
        }
    }
}

/// Content of the file.
#[derive(Debug, Serialize, Deserialize)]
struct Saved {
    machine: Machine,
    overheads: Overheads,
}

/// Overheads and their origin.
#[derive(Debug, Clone)]
pub(crate) struct KnownOverheads {
    pub(crate) overheads: Overheads,
    /// Origin as text, for output lines.
    pub(crate) origin: &'static str,
}

/// Loads the overheads saved for this machine, or else motorium's cautious defaults.
pub(crate) fn load() -> KnownOverheads {
    let saved = file().and_then(|path| std::fs::read(path).ok()).map(|text| serde_json::from_slice(&text));
    let (overheads, origin) = match saved {
        Some(Ok(Saved { machine, overheads })) if machine == Machine::this() => {
            (overheads, "as measured on this machine by `motorium calibrate`")
        }
        Some(Ok(_)) => {
            (Overheads::default(), "cautious values: the saved values are from a different machine or kernel")
        }
        Some(Err(_)) => (Overheads::default(), "cautious values: the saved values cannot be read"),
        None => {
            (Overheads::default(), "cautious values; `motorium calibrate --save` measures this machine's own")
        }
    };
    KnownOverheads { overheads, origin }
}

/// Saves overheads for this machine. Returns the file.
pub(crate) fn save(overheads: Overheads) -> anyhow::Result<PathBuf> {
    let path =
        file().context("neither XDG_CONFIG_HOME nor HOME is set, so there is no folder to save them")?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    }
    let text = serde_json::to_string_pretty(&Saved { machine: Machine::this(), overheads })?;
    // written to another file and moved into place, so that a full disk leaves the older file intact
    let beside = path.with_extension("new");
    std::fs::write(&beside, text).with_context(|| format!("writing {}", beside.display()))?;
    std::fs::rename(&beside, &path).with_context(|| format!("writing {}", path.display()))?;
    Ok(path)
}

/// Returns the file with the overheads of this machine.
pub(crate) fn file() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let config = folder("XDG_CONFIG_HOME").or_else(|| Some(folder("HOME")?.join(".config")))?;
    Some(config.join("motorium").join("overheads.json"))
}
