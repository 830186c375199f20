//! The motion library that a command writes or shows.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::out::outln;
use crate::output::make_folder;
use anyhow::Context as _;
use motorium_library::{MotionLibrary, file};

pub(super) fn write(library: &MotionLibrary, path: &Path) -> anyhow::Result<()> {
    make_folder(path)?;
    file::write(library, path).with_context(|| path.display().to_string())
}

/// Returns the summary of a library.
pub(super) fn summary(library: &MotionLibrary, path: Option<&PathBuf>) -> serde_json::Value {
    let explained = library.explained();
    let mut labels = std::collections::BTreeMap::<&str, usize>::new();
    for entry in library.entries() {
        *labels.entry(entry.label.as_deref().unwrap_or("")).or_default() += 1;
    }
    let left = (1.0 - explained.iter().sum::<f64>()).max(0.0).sqrt();
    serde_json::json!({
        "file": path.map(|path| path.display().to_string()),
        "names": library.layout().names(),
        "samples": library.spring().samples(),
        "damping": library.spring().damping(),
        "interpolation": library.spring().interpolation(),
        "metric": library.metric(),
        "eigenforces": library.rank(),
        "movements": library.entries().len(),
        "labels": labels,
        "left_out": left,
        "bytes": file::to_bytes(library).len(),
        "explained": explained,
        "singular": library.parts().singular,
    })
}

/// Prints a summary as JSON or as text.
pub(super) fn show(library: &MotionLibrary, path: Option<&PathBuf>, json: bool) -> anyhow::Result<ExitCode> {
    let summary = summary(library, path);
    if json {
        outln!("{}", serde_json::to_string_pretty(&summary)?);
        return Ok(ExitCode::SUCCESS);
    }
    let names = library.layout().names();
    if let Some(path) = path {
        outln!("{}", path.display());
    }
    outln!(
        "{} eigenforces of {} movements, metric of {}, {:.1} kB",
        library.rank(),
        library.entries().len(),
        summary["metric"].as_str().unwrap_or_default(),
        summary["bytes"].as_f64().unwrap_or(0.0) * 1e-3
    );
    outln!(
        "{} degrees of freedom ({}), {} samples",
        names.len(),
        names.join(", "),
        library.spring().samples()
    );
    let labels = summary["labels"].as_object().into_iter().flatten();
    let labels: Vec<String> = labels
        .filter(|(label, _)| !label.is_empty())
        .map(|(label, count)| format!("{label} {count}"))
        .collect();
    if !labels.is_empty() {
        outln!("labels: {}", labels.join(", "));
    }
    let mut table = crate::report::table(["n", "explained", "together", "left out"]);
    let (mut together, explained) = (0.0, library.explained());
    for (k, part) in explained.iter().enumerate() {
        together += part;
        let n = k + 1;
        if n <= 8 || n.is_power_of_two() || n == explained.len() {
            table.add_row([
                n.to_string(),
                format!("{part:.4}"),
                format!("{together:.4}"),
                format!("{:.4}", (1.0 - together).max(0.0).sqrt()),
            ]);
        }
    }
    outln!("{}", table.trim_fmt());
    Ok(ExitCode::SUCCESS)
}
