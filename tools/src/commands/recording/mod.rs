//! Recordings: making, repairing and replaying them.

mod export;
mod page;
mod plot;
mod recover;
mod replay;

use std::path::Path;

use anyhow::Context as _;
use motorium::graph::Override;

pub(super) use export::Export;
pub(super) use page::Report;
pub(super) use plot::Plot;
pub(super) use recover::Recover;
pub(super) use replay::Replay;

use crate::overheads;

/// Name of the component that `motorium run --record` adds.
const RECORDER: &str = "recorder";

/// The settings of a graph that add a recorder of all its topics.
pub(super) fn overrides(output: &Path, last: Option<&str>) -> anyhow::Result<Vec<Override>> {
    let absolute = |path: &Path| -> anyhow::Result<String> {
        let path = std::path::absolute(path).with_context(|| format!("finding {}", path.display()))?;
        Ok(toml::Value::from(path.to_str().context("the name of the recording is not UTF-8")?).to_string())
    };
    let mut settings = vec![
        ("kind", "\"log.record\"".to_string()),
        ("rate", "\"10 Hz\"".to_string()),
        ("schedule", "\"normal\"".to_string()),
        // What becomes of a recording is no concern of the robot.
        ("on_failure", "\"ignore\"".to_string()),
        ("config.output", absolute(output)?),
    ];
    if let Some(last) = last {
        settings.push(("config.last", toml::Value::from(last).to_string()));
    }
    if let Some(calibration) = overheads::file().filter(|file| file.exists()) {
        settings.push(("config.attach", format!("[{}]", absolute(&calibration)?)));
    }
    let with = |(key, value)| Override { path: format!("component.{RECORDER}.{key}"), value };
    Ok(settings.into_iter().map(with).collect())
}
