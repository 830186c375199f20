//! Imitation in a folder: `task.toml`, `run.json`, `progress.csv`, and the policy after every iteration.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use motorium_models::policy::RobotDigest;
use motorium_physics::Articulated;
use motorium_robots::ModelWarning;
use serde::Serialize;

use super::{Algorithm, Imitation, ImitationError, ImitationSettings, Progress, Recorded, RecordedError};
use crate::environment::{EnvironmentError, Scene, SceneError};
use crate::files::{self, FileError};
use crate::folder::{self, FolderError, PROGRESS, RUN, TASK};
use crate::task::Task;
use crate::trained::{self, TrainedPolicyError};

/// Error of a run of imitation learning in a folder.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder or the task is invalid.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The expert does not fit the task.
    #[error("invalid expert: {0}")]
    Expert(#[from] TrainedPolicyError),
    /// The algorithm does not support the given sources of actions.
    #[error("{} learns from {expected}", algorithm.name())]
    Sources {
        /// Algorithm of the run.
        algorithm: Algorithm,
        /// Description of the supported sources.
        expected: &'static str,
    },
    /// A recording does not fit the task.
    #[error(transparent)]
    Recorded(#[from] RecordedError),
    /// The robot cannot be loaded.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// Training failed.
    #[error(transparent)]
    Training(#[from] ImitationError),
}

/// Summary of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Progress of the last iteration; `None` before the first iteration.
    pub last: Option<Progress>,
    /// SHA-256 digest of all weights as hexadecimal digits.
    pub weights_sha256: String,
}

/// Sources of the actions to imitate.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sources<'a> {
    /// Folder of the expert's policy, which acts in simulated worlds.
    pub expert: Option<&'a Path>,
    /// Recorded actions, which replace the steps of the first iteration.
    pub recorded: &'a [Recorded],
}

/// A run of imitation learning in a folder.
pub struct Run {
    folder: PathBuf,
    algorithm: Algorithm,
    task: Task,
    robot: Option<RobotDigest>,
    warnings: Vec<ModelWarning>,
    imitation: Imitation<Articulated>,
    progress: String,
    last: Option<Progress>,
}

impl Run {
    /// Starts a run on the task in a file, with the settings in `[algorithms.dagger]`. Behaviour cloning runs
    /// one iteration, with an acting expert or with recorded actions. DAgger requires an expert. `steps`
    /// overrides the total number of steps of all iterations.
    ///
    /// # Errors
    ///
    /// [`RunError`] if the task, the expert or a recording is invalid, or the folder cannot be used.
    pub fn create(
        (file, sources): (&Path, Sources<'_>),
        folder: &Path,
        (seed, threads): (u64, usize),
        (algorithm, steps): (Algorithm, Option<u64>),
    ) -> Result<Self, RunError> {
        let (task, text) = folder::read_task(file)?;
        folder::check_empty(folder, file)?;
        let invalid = |source| FolderError::Task { file: file.to_path_buf(), source };
        let mut settings = ImitationSettings::from_table(&task.algorithms).map_err(invalid)?;
        if algorithm == Algorithm::Clone {
            // one iteration with the labels of all iterations
            settings.steps = settings.steps.saturating_mul(settings.iterations);
            (settings.iterations, settings.beta) = (1, 1.0);
        }
        if let Some(steps) = steps {
            settings.steps = steps.div_ceil(settings.iterations);
        }
        let base = folder::described_base(file)?;
        let scene = Scene::load(&task, &base)?;
        let imitation = match (sources.expert, sources.recorded) {
            (None, recorded @ [_, ..]) if algorithm == Algorithm::Clone => {
                Imitation::from_recorded(&task, settings, recorded, (seed, threads), || scene.simulation())?
            }
            (Some(expert), recorded) if recorded.is_empty() || algorithm == Algorithm::Dagger => {
                let expert = trained::load(expert, &task)?;
                let mut imitation =
                    Imitation::new(&task, settings, &expert, (seed, threads), || scene.simulation())?;
                imitation.add(recorded)?;
                imitation
            }
            _ => {
                let expected = match algorithm {
                    Algorithm::Clone => "an expert or recordings, not from both",
                    Algorithm::Dagger => "an expert, and from recordings in its first iteration",
                };
                return Err(RunError::Sources { algorithm, expected });
            }
        };
        files::create_folder(folder)?;
        files::write(&folder.join(TASK), text.as_bytes())?;
        let description = serde_json::json!({ "algorithm": algorithm.name(), "seed": seed, "base": base });
        files::write(&folder.join(RUN), description.to_string().as_bytes())?;
        let progress = "iteration,labels,beta,episodes,mean_return,loss\n".to_owned();
        let folder = folder.to_path_buf();
        let (robot, warnings) = (scene.robot_digest(), scene.warnings().to_vec());
        Ok(Self { folder, algorithm, task, robot, warnings, imitation, progress, last: None })
    }

    /// Returns the task.
    pub fn task(&self) -> &Task {
        &self.task
    }

    /// Returns warnings about ignored elements of the world's file.
    pub fn warnings(&self) -> &[ModelWarning] {
        &self.warnings
    }

    /// Runs one iteration and writes the policy to the folder. Returns `None` once all iterations are
    /// complete.
    ///
    /// # Errors
    ///
    /// [`RunError`] if training fails or the policy cannot be written.
    pub fn advance(&mut self) -> Result<Option<Progress>, RunError> {
        if self.imitation.is_finished() {
            return Ok(None);
        }
        let found = self.imitation.advance()?;
        let Progress { iteration, labels, beta, episodes, mean_return, loss } = found;
        let mean = mean_return.map_or_else(String::new, |mean| mean.to_string());
        let _ = writeln!(self.progress, "{iteration},{labels},{beta},{episodes},{mean},{loss}");
        files::write(&self.folder.join(PROGRESS), self.progress.as_bytes())?;
        let policy = self.imitation.policy();
        folder::write_policy(&self.folder, (&self.task, self.robot), &policy, self.algorithm.name())?;
        self.last = Some(found);
        Ok(self.last)
    }

    /// Returns a summary of the run so far.
    pub fn summary(&self) -> Summary {
        Summary { last: self.last, weights_sha256: self.imitation.weights_sha256() }
    }
}
