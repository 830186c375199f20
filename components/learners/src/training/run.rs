//! A training run in a folder.
//!
//! | file | content |
//! |---|---|
//! | `task.toml` | the task |
//! | `run.json` | algorithm, seed, steps, and the folder to which the path of the task's robot is relative |
//! | `checkpoint.safetensors` | networks, optimiser, statistics, counters and running episodes |
//! | `progress.csv` | one line per update |
//! | `policy.toml`, `policy.onnx` | the policy, at every checkpoint |

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use motorium_models::policy::RobotDigest;
use motorium_robots::ModelWarning;
use serde::{Deserialize, Serialize};

use crate::environment::{EnvironmentError, Scene, SceneError};
use crate::files::{self, FileError};
use crate::folder::{self, CHECKPOINT, FolderError, PROGRESS, RUN, TASK};
use crate::learner::{Algorithm, CheckpointError, Costs, Learner, LearnerError, Phase, Progress, Stopwatch};
use crate::task::Task;

const HEADER: &str = "update,steps,episodes,mean_return,mean_length";

/// Error of a training run in a folder.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder or the task is invalid.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The description of the run does not parse.
    #[error("{}: {message}", file.display())]
    Description {
        /// Path of the file.
        file: PathBuf,
        /// Reason why the description does not parse.
        message: String,
    },
    /// The run cannot be continued, because it has no checkpoint.
    #[error(
        "{} has no {CHECKPOINT}: a run of imitation learning cannot be continued\n\
         help: start a new run in another folder",
        folder.display()
    )]
    NoCheckpoint {
        /// Path of the folder.
        folder: PathBuf,
    },
    /// The robot cannot be loaded.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// The checkpoint does not fit the run.
    #[error("{}: {source}", file.display())]
    Checkpoint {
        /// Path of the checkpoint file.
        file: PathBuf,
        /// Reason why the checkpoint does not fit.
        source: Box<CheckpointError>,
    },
    /// Training failed.
    #[error(transparent)]
    Training(#[from] LearnerError),
}

#[derive(Debug, Serialize, Deserialize)]
struct Description {
    algorithm: Algorithm,
    seed: u64,
    steps: u64,
    base: PathBuf,
}

/// Summary of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Algorithm of the run.
    pub algorithm: Algorithm,
    /// Number of steps in all worlds together.
    pub steps: u64,
    /// Number of updates.
    pub updates: u64,
    /// Progress of the last update; `None` if the run had already finished.
    pub last: Option<Progress>,
    /// SHA-256 digest of all weights as hexadecimal digits.
    pub weights_sha256: String,
}

/// A training run in a folder.
pub struct Run {
    folder: PathBuf,
    task: Task,
    robot: Option<RobotDigest>,
    warnings: Vec<ModelWarning>,
    learner: Box<dyn Learner>,
    last: Option<Progress>,
    /// Time spent on files.
    watch: Stopwatch,
}

/// Creates a learner for the task in a file and its scene. The path of the robot is relative to `base`.
fn build(
    algorithm: Algorithm,
    (task, file): (&Task, &Path),
    base: &Path,
    steps: Option<u64>,
    run: (u64, usize),
) -> Result<(Box<dyn Learner>, Scene), RunError> {
    let scene = Scene::load(task, base)?;
    let learner = super::start(algorithm, task, &scene, steps, run).map_err(|error| match error {
        EnvironmentError::Task(source) => FolderError::Task { file: file.to_path_buf(), source }.into(),
        other => RunError::Environment(other),
    })?;
    Ok((learner, scene))
}

impl Run {
    fn new(folder: &Path, task: Task, scene: &Scene, learner: Box<dyn Learner>) -> Self {
        let (robot, warnings) = (scene.robot_digest(), scene.warnings().to_vec());
        let watch = Stopwatch::start();
        Self { folder: folder.to_path_buf(), task, robot, warnings, learner, last: None, watch }
    }

    /// Starts a run of an algorithm on the task in a file. The settings come from the table `[algorithms]` of
    /// the task. `steps` overrides the total number of steps.
    ///
    /// # Errors
    ///
    /// [`RunError`] if the task is invalid, training cannot start, or the folder cannot be used;
    /// [`FolderError::Exists`] if the folder already contains a run.
    pub fn create(
        algorithm: Algorithm,
        file: &Path,
        folder: &Path,
        (seed, threads): (u64, usize),
        steps: Option<u64>,
    ) -> Result<Self, RunError> {
        let (task, text) = folder::read_task(file)?;
        folder::check_empty(folder, file)?;
        let base = folder::described_base(file)?;
        let (learner, scene) = build(algorithm, (&task, file), &base, steps, (seed, threads))?;
        let description = Description { algorithm, seed, steps: learner.total_steps(), base };
        let run = Self::new(folder, task, &scene, learner);
        files::create_folder(folder)?;
        files::write(&folder.join(TASK), text.as_bytes())?;
        let mut header = HEADER.to_owned();
        for name in run.learner.measures() {
            header.extend([",", *name]);
        }
        header.push('\n');
        files::write(&folder.join(PROGRESS), header.as_bytes())?;
        let json = serde_json::to_string_pretty(&description).expect("numbers and UTF-8 paths serialise");
        files::write(&folder.join(RUN), json.as_bytes())?;
        run.save()?;
        Ok(run)
    }

    /// Continues a run from its last checkpoint.
    ///
    /// # Errors
    ///
    /// [`RunError`] if the folder contains no run that can be continued.
    pub fn resume(folder: &Path, threads: usize) -> Result<Self, RunError> {
        folder::check_run(folder)?;
        let file = folder.join(RUN);
        let bytes = files::read(&file)?;
        if !folder.join(CHECKPOINT).exists() {
            return Err(RunError::NoCheckpoint { folder: folder.to_path_buf() });
        }
        let description: Description = serde_json::from_slice(&bytes)
            .map_err(|error| RunError::Description { file: file.clone(), message: error.to_string() })?;
        let (task, _) = folder::read_task(&folder.join(TASK))?;
        let Description { algorithm, seed, steps, base } = description;
        let (mut learner, scene) =
            build(algorithm, (&task, &folder.join(TASK)), &base, Some(steps), (seed, threads))?;
        let file = folder.join(CHECKPOINT);
        let bytes = files::read(&file)?;
        learner.restore(&bytes).map_err(|source| RunError::Checkpoint { file, source: Box::new(source) })?;
        // drop the lines of updates after the checkpoint, which are repeated
        let progress = files::read_text(&folder.join(PROGRESS))?;
        let is_kept = |line: &&str| {
            let update = line.split(',').next().and_then(|update| update.parse().ok());
            update.is_none_or(|update: u64| update <= learner.updates())
        };
        let kept: String = progress.lines().filter(is_kept).flat_map(|line| [line, "\n"]).collect();
        files::write(&folder.join(PROGRESS), kept.as_bytes())?;
        Ok(Self::new(folder, task, &scene, learner))
    }

    /// Returns the task.
    pub fn task(&self) -> &Task {
        &self.task
    }

    /// Returns warnings about ignored elements of the world's file.
    pub fn warnings(&self) -> &[ModelWarning] {
        &self.warnings
    }

    /// Returns the time of all updates by phase, since the run was created or resumed.
    pub fn costs(&self) -> Costs {
        let mut costs = self.learner.costs();
        costs.add(Phase::Files, self.watch.costs().seconds(Phase::Files));
        costs
    }

    /// Returns the names of [`Progress::values`].
    pub fn measures(&self) -> &'static [&'static str] {
        self.learner.measures()
    }

    /// Returns the number of steps so far, and the total number of steps of the run.
    pub fn steps(&self) -> (u64, u64) {
        (self.learner.steps(), self.learner.total_steps())
    }

    /// Performs one update, appends a line to the progress file, and writes a checkpoint if one is due.
    /// Returns `None` once all steps have been performed.
    ///
    /// # Errors
    ///
    /// [`RunError`] if training fails or a file cannot be written.
    pub fn advance(&mut self) -> Result<Option<Progress>, RunError> {
        if self.learner.is_finished() {
            return Ok(None);
        }
        let progress = self.learner.advance()?;
        self.watch.skip();
        self.append(&progress)?;
        if self.learner.is_finished() || progress.update.is_multiple_of(self.learner.checkpoint_interval()) {
            self.save()?;
        }
        self.watch.lap(Phase::Files);
        self.last = Some(progress.clone());
        Ok(Some(progress))
    }

    /// Appends the line of an update to the progress.
    fn append(&self, progress: &Progress) -> Result<(), RunError> {
        use std::io::Write as _;
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let mut line = format!("{},{},{},", progress.update, progress.steps, progress.episodes);
        let _ = write!(line, "{},{}", number(progress.mean_return), number(progress.mean_length));
        for value in &progress.values {
            // the cell of a value without a measurement stays empty
            let _ = write!(line, ",{}", number(value.is_finite().then_some(*value)));
        }
        line.push('\n');
        let file = self.folder.join(PROGRESS);
        let written = std::fs::OpenOptions::new()
            .append(true)
            .open(&file)
            .and_then(|mut opened| opened.write_all(line.as_bytes()));
        written.map_err(|source| FileError { file, source }.into())
    }

    /// Writes a checkpoint and the policy, as [`advance`](Self::advance) does at regular intervals.
    ///
    /// # Errors
    ///
    /// [`RunError`] if a file cannot be written.
    pub fn save(&self) -> Result<(), RunError> {
        let file = self.folder.join(CHECKPOINT);
        let bytes = self
            .learner
            .checkpoint()
            .map_err(|source| RunError::Checkpoint { file: file.clone(), source: Box::new(source) })?;
        let algorithm = self.learner.algorithm().name();
        folder::write_policy(&self.folder, (&self.task, self.robot), &self.learner.policy(), algorithm)?;
        files::write(&file, &bytes)?;
        Ok(())
    }

    /// Returns a summary of the run so far.
    pub fn summary(&self) -> Summary {
        Summary {
            algorithm: self.learner.algorithm(),
            steps: self.learner.steps(),
            updates: self.learner.updates(),
            last: self.last.clone(),
            weights_sha256: self.learner.weights_sha256(),
        }
    }
}
