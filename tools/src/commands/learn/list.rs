//! `motorium learn list`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, anyhow, ensure};
use motorium_learners::imitation;
use motorium_learners::learner::Algorithm;
use motorium_learners::task::Task;
use serde_json::json;

use crate::out::outln;

/// Remedy for a folder without tasks.
const HELP: &str = "help: name a folder of task files: `motorium learn list FOLDER`";

/// List the tasks of a folder: title, robot, rate and range of the reward.
///
/// Example: motorium learn list
#[derive(Debug, clap::Args)]
pub(super) struct List {
    /// Folder of task files
    #[arg(default_value = "tasks")]
    folder: PathBuf,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl List {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let place = self.folder.display().to_string();
        let entries = std::fs::read_dir(&self.folder)
            .map_err(|error| anyhow!("{place}: {error}, expected a folder of task files (.toml)\n{HELP}"))?;
        let mut files: Vec<PathBuf> =
            entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
        files.retain(|file| file.extension().is_some_and(|extension| extension == "toml"));
        ensure!(!files.is_empty(), "{place}: found no task file, expected files that end in .toml\n{HELP}");
        files.sort();
        let mut tasks = Vec::new();
        for file in files {
            let place = file.display().to_string();
            let text = std::fs::read_to_string(&file).with_context(|| place.clone())?;
            let task = Task::parse(&text).with_context(|| place.clone())?;
            let range = task.reward_range().with_context(|| place.clone())?;
            tasks.push((place, task, range));
        }
        if self.json {
            let one = |(file, task, range): &(String, Task, [f64; 2])| {
                json!({
                    "file": file,
                    "title": task.title,
                    "robot": task.robot,
                    "rate_hz": task.rate(),
                    "steps": task.steps(),
                    "reward": range,
                })
            };
            outln!(
                "{}",
                json!({
                    "tasks": tasks.iter().map(one).collect::<Vec<_>>(),
                    "algorithms": Algorithm::ALL.map(Algorithm::name),
                    "imitation": imitation::Algorithm::ALL.map(imitation::Algorithm::name),
                })
            );
            return Ok(ExitCode::SUCCESS);
        }
        for (file, task, [low, high]) in &tasks {
            outln!("{file}: {}", task.title);
            outln!("  {} at {:.0} Hz, at most {} steps", task.robot, task.rate(), task.steps());
            outln!("  reward of a step {low} to {high}");
        }
        Ok(ExitCode::SUCCESS)
    }
}
