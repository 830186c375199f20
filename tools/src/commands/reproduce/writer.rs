//! Figures and claims as they are collected.

use std::path::PathBuf;

use anyhow::Context as _;
use indicatif::ProgressBar;
use serde::Serialize;

use crate::chart::Chart;

/// A claim, and the verdict of this run.
#[derive(Debug, Serialize)]
pub(super) struct Claim {
    pub(super) figure: &'static str,
    pub(super) claim: String,
    pub(super) holds: bool,
    pub(super) evidence: String,
}

/// Writer of the figures, and collector of the claims.
pub(super) struct FigureWriter {
    folder: PathBuf,
    pub(super) bar: ProgressBar,
    pub(super) files: Vec<PathBuf>,
    pub(super) claims: Vec<Claim>,
}

impl FigureWriter {
    pub(super) fn new(folder: PathBuf, steps: u64) -> anyhow::Result<Self> {
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        Ok(Self { folder, bar: ProgressBar::new(steps), files: Vec::new(), claims: Vec::new() })
    }

    /// Writes a file.
    pub(super) fn write(&mut self, name: &str, content: &str) -> anyhow::Result<()> {
        let path = self.folder.join(name);
        std::fs::write(&path, content).with_context(|| path.display().to_string())?;
        self.files.push(path);
        Ok(())
    }

    /// Writes a chart, and its numbers beside it.
    pub(super) fn chart(&mut self, name: &str, chart: &Chart) -> anyhow::Result<()> {
        self.write(&format!("{name}.svg"), &chart.svg())?;
        self.write(&format!("{name}.csv"), &chart.csv())
    }

    pub(super) fn claim(&mut self, figure: &'static str, claim: &str, holds: bool, evidence: String) {
        self.claims.push(Claim { figure, claim: claim.to_string(), holds, evidence });
    }
}
