//! Writer of figures and claims, with the progress of interrupted runs.

use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use motorium_pictures::chart::Chart;
use serde::{Deserialize, Serialize};

use crate::out::{errln, outln};
use crate::output::{Overwrite, check_folder};

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
    /// Name of the experiment, such as `locomotion`.
    experiment: &'static str,
    pub(super) bar: ProgressBar,
    pub(super) files: Vec<PathBuf>,
    pub(super) claims: Vec<Claim>,
    progress: Option<Progress>,
    /// The option that permits replacing existing files.
    option: &'static str,
    /// `true` if existing files are replaced: by request, or because an earlier run with equal options
    /// continues.
    replaces: bool,
}

impl FigureWriter {
    /// Creates a writer. Figures and claims of an earlier run are replaced on request only. The names of the
    /// claims and of the progress begin with the experiment, so several experiments can share a folder.
    pub(super) fn new(
        folder: PathBuf,
        experiment: &'static str,
        steps: u64,
        overwrite: Overwrite,
    ) -> anyhow::Result<Self> {
        let writer = Self::open(folder, experiment, steps, ("--overwrite", overwrite.is_given()))?;
        writer.refuse_existing(&writer.claims_file())?;
        Ok(writer)
    }

    fn open(
        folder: PathBuf,
        experiment: &'static str,
        steps: u64,
        (option, replaces): (&'static str, bool),
    ) -> anyhow::Result<Self> {
        check_folder(&folder)?;
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        let bar = ProgressBar::new(steps);
        if let Ok(style) =
            ProgressStyle::with_template("{msg:24} {bar:40} {percent:>3} %, {elapsed} of {duration}")
        {
            bar.set_style(style);
        }
        let (files, claims) = (Vec::new(), Vec::new());
        Ok(Self { folder, experiment, bar, files, claims, progress: None, option, replaces })
    }

    /// Returns the path of the file with the claims, which is written last.
    fn claims_file(&self) -> PathBuf {
        self.folder.join(self.claims_name())
    }

    fn claims_name(&self) -> String {
        format!("{}-claims.json", self.experiment)
    }

    /// Returns the path of the file that records the progress of work in parts.
    fn progress_file(&self) -> PathBuf {
        self.folder.join(format!("{}-progress.json", self.experiment))
    }

    /// Refuses to replace a file that this run did not write.
    fn refuse_existing(&self, path: &Path) -> anyhow::Result<()> {
        anyhow::ensure!(
            self.replaces || self.files.iter().any(|file| file == path) || !path.exists(),
            "{} exists: name another folder, or replace its figures with `{}`",
            path.display(),
            self.option
        );
        Ok(())
    }

    /// Creates a writer for work in parts. Skips parts that an earlier run with equal options, `of`, finished
    /// in this folder.
    pub(super) fn resuming(
        folder: PathBuf,
        experiment: &'static str,
        steps: u64,
        of: serde_json::Value,
        restart: bool,
    ) -> anyhow::Result<Self> {
        let mut writer = Self::open(folder, experiment, steps, ("--restart", restart))?;
        let file = writer.progress_file();
        let known = std::fs::read_to_string(&file).ok().filter(|_| !restart);
        let known = known.and_then(|text| serde_json::from_str::<Progress>(&text).ok());
        let known = known.filter(|progress| progress.of == of);
        writer.replaces |= known.is_some();
        writer.refuse_existing(&file)?;
        writer.refuse_existing(&writer.claims_file())?;
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
        let path = self.progress_file();
        if let Some(progress) = &mut self.progress {
            progress.parts.insert(name.to_string(), part);
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
        self.refuse_existing(&path)?;
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
        self.write(&self.claims_name(), &claims)?;
        self.bar.finish_and_clear();
        if json {
            let report = serde_json::json!({ "claims": self.claims, "files": self.shown_files() });
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

    /// Returns the written files as text.
    pub(super) fn shown_files(&self) -> Vec<String> {
        self.files.iter().map(|file| file.display().to_string()).collect()
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
            let mut writer = FigureWriter::resuming(path, "one", 4, serde_json::json!(of), restart).unwrap();
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
        assert_eq!([run(1, false), run(1, false), run(1, true), run(2, true)], [2, 0, 2, 2]);
        std::fs::remove_file(folder.path().join("two.txt")).unwrap();
        assert_eq!(run(2, false), 1);
    }

    #[test]
    fn figures_of_another_run_are_replaced_on_request_only() {
        let folder = tempfile::tempdir().unwrap();
        let path = || folder.path().to_path_buf();
        let resumed = |of: i32, restart: bool| {
            FigureWriter::resuming(path(), "one", 1, serde_json::json!(of), restart)
                .map_err(|error| error.to_string())
        };
        let mut writer = resumed(1, false).unwrap();
        writer.part("one", |writer| writer.write("one.txt", "mine")).unwrap();
        let refused = resumed(2, false).err().unwrap();
        assert!(
            refused.ends_with(
                "one-progress.json exists: name another folder, or replace its figures with `--restart`"
            ),
            "{refused}"
        );
        assert!(resumed(1, false).is_ok() && resumed(2, true).is_ok());
        let mut other = FigureWriter::new(path(), "other", 1, Overwrite::default()).unwrap();
        let refused = other.write("one.txt", "").unwrap_err().to_string();
        assert!(refused.contains("one.txt exists") && refused.ends_with("with `--overwrite`"), "{refused}");
        assert_eq!(std::fs::read_to_string(path().join("one.txt")).unwrap(), "mine");
        other.write("two.txt", "a").unwrap();
        other.write("two.txt", "b").unwrap();
        other.finish(true).unwrap();
        let refused = FigureWriter::new(path(), "other", 1, Overwrite::default()).err().unwrap().to_string();
        assert!(refused.contains("other-claims.json exists"), "{refused}");
    }

    #[test]
    fn failed_part_is_repeated() {
        let folder = tempfile::tempdir().unwrap();
        let writer = || {
            let path = folder.path().to_path_buf();
            FigureWriter::resuming(path, "one", 1, serde_json::json!(1), false).unwrap()
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
