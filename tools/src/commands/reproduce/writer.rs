//! Writer of figures and claims, with the progress of interrupted runs.

use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use motorium_pictures::chart::Chart;
use serde::{Deserialize, Serialize};

use crate::out::{errln, outln};

/// A claim, and the verdict of this run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Claim {
    pub(super) figure: String,
    pub(super) claim: String,
    pub(super) holds: bool,
    pub(super) evidence: String,
}

/// A completed part of the work.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Part {
    files: Vec<PathBuf>,
    claims: Vec<Claim>,
    /// Steps of the progress bar.
    steps: u64,
}

/// Progress of a run, from which it can resume.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Progress {
    /// Options and data on which the figures depend.
    of: serde_json::Value,
    parts: BTreeMap<String, Part>,
}

/// Writer of the figures, and collector of the claims.
pub(super) struct FigureWriter {
    folder: PathBuf,
    pub(super) bar: ProgressBar,
    pub(super) files: Vec<PathBuf>,
    pub(super) claims: Vec<Claim>,
    progress: Option<Progress>,
}

/// File in the folder of the figures that records the progress.
const PROGRESS: &str = "progress.json";

impl FigureWriter {
    pub(super) fn new(folder: PathBuf, steps: u64) -> anyhow::Result<Self> {
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        let bar = ProgressBar::new(steps);
        if let Ok(style) =
            ProgressStyle::with_template("{msg:24} {bar:40} {percent:>3} %, {elapsed} of {duration}")
        {
            bar.set_style(style);
        }
        Ok(Self { folder, bar, files: Vec::new(), claims: Vec::new(), progress: None })
    }

    /// Creates a writer for work in parts. Skips parts that an earlier run with equal options, `of`, finished
    /// in this folder.
    pub(super) fn resuming(
        folder: PathBuf,
        steps: u64,
        of: serde_json::Value,
        restart: bool,
    ) -> anyhow::Result<Self> {
        let mut writer = Self::new(folder, steps)?;
        let known = std::fs::read_to_string(writer.folder.join(PROGRESS)).ok().filter(|_| !restart);
        let known = known.and_then(|text| serde_json::from_str::<Progress>(&text).ok());
        let known = known.filter(|progress| progress.of == of);
        writer.progress = Some(known.unwrap_or(Progress { of, parts: BTreeMap::new() }));
        Ok(writer)
    }

    /// Executes a part of the work, unless it is already complete.
    pub(super) fn part(
        &mut self,
        name: &str,
        work: impl FnOnce(&mut Self) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        self.bar.set_message(name.to_string());
        let known = self.progress.as_ref().and_then(|progress| progress.parts.get(name).cloned());
        if let Some(part) = known.filter(|part| part.files.iter().all(|file| file.is_file())) {
            self.say(&format!("{name}: done by an earlier run; --restart does it again"));
            self.bar.inc(part.steps);
            self.files.extend(part.files);
            self.claims.extend(part.claims);
            return Ok(());
        }
        let (began, steps) = (Instant::now(), self.bar.position());
        let (files, claims) = (self.files.len(), self.claims.len());
        work(self)?;
        self.say(&format!(
            "{name}: {} files in {:.0} s",
            self.files.len() - files,
            began.elapsed().as_secs_f64()
        ));
        let part = Part {
            files: self.files[files..].to_vec(),
            claims: self.claims[claims..].to_vec(),
            steps: self.bar.position() - steps,
        };
        if let Some(progress) = &mut self.progress {
            progress.parts.insert(name.to_string(), part);
            let path = self.folder.join(PROGRESS);
            let text = serde_json::to_string_pretty(progress)?;
            std::fs::write(&path, text).with_context(|| path.display().to_string())?;
        }
        Ok(())
    }

    /// Prints a line if there is no progress bar.
    fn say(&self, words: &str) {
        match std::io::stderr().is_terminal() {
            true => self.bar.println(words),
            false => errln!("{words}"),
        }
    }

    /// Writes a file.
    pub(super) fn write(&mut self, name: &str, content: &str) -> anyhow::Result<()> {
        let path = self.folder.join(name);
        std::fs::write(&path, content).with_context(|| path.display().to_string())?;
        self.files.push(path);
        Ok(())
    }

    /// Writes a chart and its numbers.
    pub(super) fn chart(&mut self, name: &str, chart: &Chart) -> anyhow::Result<()> {
        self.write(&format!("{name}.svg"), &chart.svg())?;
        self.write(&format!("{name}.csv"), &chart.csv())
    }

    /// Writes the claims, and prints them.
    pub(super) fn finish(mut self, json: bool) -> anyhow::Result<ExitCode> {
        let claims = serde_json::to_string_pretty(&self.claims)?;
        self.write("claims.json", &claims)?;
        self.bar.finish_and_clear();
        if json {
            let report = serde_json::json!({ "claims": self.claims, "files": self.files });
            outln!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(ExitCode::SUCCESS);
        }
        for claim in &self.claims {
            let word = if claim.holds { "holds" } else { "does not hold" };
            outln!("{}: {}\n    {word}: {}", claim.figure, claim.claim, claim.evidence);
        }
        outln!("{} files in {}", self.files.len(), self.folder.display());
        Ok(ExitCode::SUCCESS)
    }

    pub(super) fn claim(&mut self, figure: &str, claim: &str, holds: bool, evidence: String) {
        let (figure, claim) = (figure.to_string(), claim.to_string());
        self.claims.push(Claim { figure, claim, holds, evidence });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finished_parts_are_reused_with_equal_options() {
        let folder = tempfile::tempdir().unwrap();
        let run = |of: i32, restart: bool| {
            let path = folder.path().to_path_buf();
            let mut writer = FigureWriter::resuming(path, 4, serde_json::json!(of), restart).unwrap();
            let mut done = 0;
            for name in ["one", "two"] {
                let work = |writer: &mut FigureWriter| {
                    done += 1;
                    writer.bar.inc(2);
                    writer.claim("1", name, true, "seen".into());
                    writer.write(&format!("{name}.txt"), name)
                };
                writer.part(name, work).unwrap();
            }
            assert_eq!((writer.claims.len(), writer.files.len(), writer.bar.position()), (2, 2, 4));
            done
        };
        assert_eq!([run(1, false), run(1, false), run(1, true), run(2, false)], [2, 0, 2, 2]);
        std::fs::remove_file(folder.path().join("two.txt")).unwrap();
        assert_eq!(run(2, false), 1);
    }

    #[test]
    fn failed_part_is_repeated() {
        let folder = tempfile::tempdir().unwrap();
        let writer = || {
            let path = folder.path().to_path_buf();
            FigureWriter::resuming(path, 1, serde_json::json!(1), false).unwrap()
        };
        assert!(writer().part("one", |_| anyhow::bail!("no data")).is_err());
        let mut again = false;
        let work = |_: &mut FigureWriter| {
            again = true;
            Ok(())
        };
        writer().part("one", work).unwrap();
        assert!(again);
    }
}
