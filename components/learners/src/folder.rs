//! The folder of a training run.

use std::path::{Path, PathBuf};

use motorium_models::policy::RobotDigest;

use crate::files::{self, FileError};
use crate::learner::TrainedNetwork;
use crate::task::{NETWORK, Task, TaskError};

/// File of the task in the folder of a run.
pub(crate) const TASK: &str = "task.toml";
/// File of the policy in the folder of a run.
pub(crate) const POLICY: &str = "policy.toml";
/// File that describes a run.
pub(crate) const RUN: &str = "run.json";
/// File from which a run continues.
pub(crate) const CHECKPOINT: &str = "checkpoint.safetensors";
/// File with one line per update or iteration.
pub(crate) const PROGRESS: &str = "progress.csv";

/// Error of reading or writing a task or a policy.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The task is invalid.
    #[error("{}: {source}", file.display())]
    Task {
        /// Path of the task file.
        file: PathBuf,
        /// Reason why it is invalid.
        source: TaskError,
    },
    /// The folder already contains a run.
    #[error(
        "{} contains a training run, expected a folder without one\n\
         help: {}choose another folder",
        folder.display(),
        if *has_checkpoint { format!("continue it with `motorium learn resume {}`, or ", folder.display()) } else { String::new() }
    )]
    Exists {
        /// Path of the folder.
        folder: PathBuf,
        /// `true` if the run can be continued.
        has_checkpoint: bool,
    },
    /// The folder contains a file that a training run would replace, but no run.
    #[error(
        "{} exists, but its folder contains no training run\n\
         help: choose another folder",
        file.display()
    )]
    Occupied {
        /// Path of the file.
        file: PathBuf,
    },
    /// The folder of a training run or policy does not exist, or lacks the file of a run or policy.
    #[error(
        "{}: {}, expected the folder of a {what} with the file {file}\n\
         help: {help}",
        folder.display(),
        if folder.is_dir() { format!("the folder has no {file}") } else { "no such folder".to_owned() }
    )]
    Absent {
        /// Path of the folder.
        folder: PathBuf,
        /// Description of the expected content: `training run` or `trained policy`.
        what: &'static str,
        /// Name of the missing file.
        file: &'static str,
        /// Action that fixes the error.
        help: &'static str,
    },
    /// The path of the task cannot be stored in the description of a run, because the path is not UTF-8.
    #[error(
        "{}: the path is not UTF-8\n\
         help: move the task to a folder whose path is UTF-8",
        folder.display()
    )]
    NotText {
        /// Folder of the task.
        folder: PathBuf,
    },
}

/// Reads a task file. Returns the task and its text.
pub(crate) fn read_task(file: &Path) -> Result<(Task, String), FolderError> {
    let text = files::read_text(file)?;
    let task = Task::parse(&text).map_err(|source| FolderError::Task { file: file.to_path_buf(), source })?;
    Ok((task, text))
}

/// Checks that a folder holds a run.
pub(crate) fn check_run(folder: &Path) -> Result<(), FolderError> {
    let help = "pass the folder that was the --output of `motorium learn train` or `motorium learn tune`";
    check_file(folder, ("training run", RUN), help)
}

/// Checks that a folder holds a policy; the description itself is accepted, too.
pub(crate) fn check_policy(folder: &Path) -> Result<(), FolderError> {
    let help = "pass the folder that was the --output of `motorium learn train`";
    match folder.is_file() {
        true => Ok(()),
        false => check_file(folder, ("trained policy", POLICY), help),
    }
}

fn check_file(
    folder: &Path,
    (what, file): (&'static str, &'static str),
    help: &'static str,
) -> Result<(), FolderError> {
    match folder.join(file).is_file() {
        true => Ok(()),
        false => Err(FolderError::Absent { folder: folder.to_path_buf(), what, file, help }),
    }
}

/// Checks that a folder holds no run, and no file that a run on the task in `task` would replace.
pub(crate) fn check_empty(folder: &Path, task: &Path) -> Result<(), FolderError> {
    if folder.join(RUN).exists() {
        let has_checkpoint = folder.join(CHECKPOINT).exists();
        return Err(FolderError::Exists { folder: folder.to_path_buf(), has_checkpoint });
    }
    let is_task = |file: &PathBuf| file.canonicalize().ok() == task.canonicalize().ok();
    let mut files = [TASK, POLICY, NETWORK, CHECKPOINT, PROGRESS].map(|name| folder.join(name)).into_iter();
    match files.find(|file| file.exists() && !is_task(file)) {
        Some(file) => Err(FolderError::Occupied { file }),
        None => Ok(()),
    }
}

/// Returns the folder to which a task's robot is relative: the folder of the task file. For the copy in a run
/// folder it is the folder of the original file.
pub(crate) fn base(file: &Path) -> PathBuf {
    #[derive(serde::Deserialize)]
    struct Description {
        base: PathBuf,
    }
    let description = files::read(&file.with_file_name(RUN)).ok().filter(|_| file.ends_with(TASK));
    if let Some(found) = description.and_then(|bytes| serde_json::from_slice::<Description>(&bytes).ok()) {
        return found.base;
    }
    let base = file.parent().unwrap_or(Path::new(""));
    std::path::absolute(base).unwrap_or_else(|_| base.to_path_buf())
}

/// Returns [`base`] as text, for the description of a run.
pub(crate) fn described_base(file: &Path) -> Result<PathBuf, FolderError> {
    let folder = base(file);
    if folder.to_str().is_none() {
        return Err(FolderError::NotText { folder });
    }
    Ok(folder)
}

/// Writes the policy of a run on a task, with the digest of its robot.
pub(crate) fn write_policy(
    folder: &Path,
    (task, robot): (&Task, Option<RobotDigest>),
    policy: &TrainedNetwork,
    algorithm: &str,
) -> Result<(), FolderError> {
    let text =
        task.policy_text(robot).map_err(|source| FolderError::Task { file: folder.join(TASK), source })?;
    let metadata = [("task", &task.title[..]), ("algorithm", algorithm)];
    files::write(&folder.join(POLICY), text.as_bytes())?;
    files::write(&folder.join(NETWORK), &policy.to_onnx(&metadata))?;
    Ok(())
}
