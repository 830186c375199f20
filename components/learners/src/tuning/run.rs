//! A tuning in a folder.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use motorium_models::sha256::sha256_hex;
use serde::{Deserialize, Serialize};

use super::dialogue::Stage;
use super::{Parameter, ParameterError, Settings};
use crate::files::{self, FileError};
use crate::search::{
    Candidate, Evaluation, Outcome, RestoreError, Search, StartError, TellError, Workers, maximise,
};

const DESCRIPTION: &str = "tuning.json";
const CHECKPOINT: &str = "checkpoint.json";
const TABLE: &str = "evaluations.csv";
const BEST: &str = "best.toml";

/// A system whose parameters a [`Tuning`] evaluates, such as a graph or a robot.
pub trait Subject: Sync {
    /// Resources of a thread. A worker is built on the thread that uses it.
    type Worker;
    /// Error that ends a tuning, such as an interruption. A failed evaluation does not end the tuning; it is
    /// reported as an [`Evaluation`].
    type Error: Send;

    /// Creates the worker of a thread.
    ///
    /// # Errors
    ///
    /// Returns an error if the worker cannot be created.
    fn worker(&self, thread: usize) -> Result<Self::Worker, Self::Error>;

    /// Evaluates values of the parameters, with random numbers derived from a seed. The result must depend
    /// only on the values and the seed.
    ///
    /// # Errors
    ///
    /// Returns an error if the tuning cannot continue.
    fn evaluate(
        &self,
        worker: &mut Self::Worker,
        values: &[f64],
        seed: u64,
    ) -> Result<Evaluation, Self::Error>;

    /// Returns the content of `best.toml` for the best values of the parameters and their reward.
    ///
    /// # Errors
    ///
    /// Returns an error if the values cannot be written.
    fn best(&self, values: &[f64], reward: f64) -> Result<String, Self::Error>;
}

/// Error of a tuning.
#[derive(Debug, thiserror::Error)]
pub enum TuningError<E> {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder already contains a tuning.
    #[error(
        "{} contains a tuning, expected a folder without one\n\
         help: continue it with `motorium learn resume {}`, or choose another folder",
        folder.display(), folder.display()
    )]
    Exists {
        /// Path of the folder.
        folder: PathBuf,
    },
    /// The folder contains a file that a tuning would replace, but no tuning.
    #[error(
        "{} exists, but its folder contains no tuning\n\
         help: choose another folder",
        file.display()
    )]
    Occupied {
        /// Path of the file.
        file: PathBuf,
    },
    /// A parameter is invalid.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The search cannot start.
    #[error(transparent)]
    Start(#[from] StartError),
    /// A count is 0.
    #[error("found {found} {what}, expected at least 1")]
    Count {
        /// Name of the counted quantity.
        what: &'static str,
        /// Number found.
        found: u64,
    },
    /// A file of the folder does not parse.
    #[error("{}: {message}", file.display())]
    Parse {
        /// Path of the file.
        file: PathBuf,
        /// Reason why the file does not parse.
        message: String,
    },
    /// The checkpoint does not match the search of the settings.
    #[error("{}: {source}", file.display())]
    Restore {
        /// Path of the file.
        file: PathBuf,
        /// Reason why the checkpoint cannot be restored.
        source: RestoreError,
    },
    /// The table has fewer lines than the checkpoint has evaluations.
    #[error("{} has {found} evaluations, expected {expected}, as in the checkpoint", file.display())]
    Table {
        /// Path of the table.
        file: PathBuf,
        /// Number of lines found.
        found: u64,
        /// Number of evaluations in the checkpoint.
        expected: u64,
    },
    /// The search rejected a reward.
    #[error(transparent)]
    Tell(#[from] TellError),
    /// The first evaluation finished without a reward, so no evaluation would have a reward.
    #[error("the first evaluation has no reward: {reason}")]
    NoReward {
        /// Reason why the evaluation has no reward.
        reason: String,
    },
    /// The subject cannot be evaluated.
    #[error("{0}")]
    Subject(E),
}

/// Error of operations that do not evaluate a subject.
pub type FolderError = TuningError<core::convert::Infallible>;

/// Content of `tuning.json`.
#[derive(Serialize, Deserialize)]
struct Description {
    settings: Settings,
    subject: serde_json::Value,
}

/// Content of `checkpoint.json`.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Checkpoint {
    pub(super) evaluations: u64,
    outcomes: BTreeMap<Outcome, u64>,
    /// State of the search; none before the first candidate.
    pub(super) search: Option<String>,
    #[serde(default, skip_serializing_if = "Attended::is_new")]
    pub(super) attended: Attended,
}

/// State of the dialogue with an operator.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Attended {
    /// Stage of the candidate that waits for its reward.
    pub(super) stage: Stage,
    /// Values of the previous evaluation.
    pub(super) last: Option<Vec<f64>>,
}

impl Attended {
    fn is_new(&self) -> bool {
        matches!(self, Self { stage: Stage::Proposed, last: None })
    }
}

/// Progress of a tuning after an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress<'a> {
    /// Number of the evaluation, counted from 1.
    pub evaluation: u64,
    /// Total number of evaluations of the tuning.
    pub evaluations: u64,
    /// Values of the parameters.
    pub values: &'a [f64],
    /// Result of the evaluation.
    pub result: &'a Evaluation,
    /// Best reward so far; `None` while all evaluations failed.
    pub best: Option<f64>,
}

/// Summary of a tuning.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Number of evaluations so far.
    pub evaluations: u64,
    /// Number of evaluations by outcome; the sum is `evaluations`.
    pub outcomes: BTreeMap<Outcome, u64>,
    /// Best values of the parameters and their reward; `None` if every evaluation failed.
    pub best: Option<(Vec<f64>, f64)>,
    /// SHA-256 digest of the table of evaluations as hexadecimal digits. Tables with equal parameters,
    /// rewards and outcomes have equal digests.
    pub table_sha256: String,
}

/// A search for good parameters of a [`Subject`], stored in a folder; see [the module](super).
pub struct Tuning {
    pub(super) folder: PathBuf,
    pub(super) settings: Settings,
    pub(super) search: Box<dyn Search>,
    pub(super) checkpoint: Checkpoint,
}

impl Tuning {
    /// Returns `true` if a folder contains a tuning.
    pub fn exists(folder: &Path) -> bool {
        folder.join(DESCRIPTION).exists()
    }

    /// Starts a tuning in a folder. `subject` describes the subject and is returned by
    /// [`resume`](Self::resume).
    ///
    /// # Errors
    ///
    /// [`TuningError`] if a setting is invalid or the folder cannot be used; [`TuningError::Exists`] if the
    /// folder already contains a tuning.
    pub fn create(
        folder: &Path,
        settings: Settings,
        subject: serde_json::Value,
    ) -> Result<Self, FolderError> {
        Parameter::check_all(&settings.parameters)?;
        let counts = [("evaluations", settings.evaluations), ("together", settings.together as u64)];
        if let Some((what, found)) = counts.into_iter().find(|(_, count)| *count == 0) {
            return Err(TuningError::Count { what, found });
        }
        let search = settings.search()?;
        if Self::exists(folder) {
            return Err(TuningError::Exists { folder: folder.to_path_buf() });
        }
        let mut parts = [TABLE, CHECKPOINT, BEST].map(|name| folder.join(name)).into_iter();
        if let Some(file) = parts.find(|file| file.exists()) {
            return Err(TuningError::Occupied { file });
        }
        files::create_folder(folder)?;
        let mut header = "evaluation,outcome,reward".to_owned();
        for parameter in &settings.parameters {
            let _ = write!(header, ",{}", quoted(&parameter.name()));
        }
        header += ",reason\n";
        files::write(&folder.join(TABLE), header.as_bytes())?;
        let made = Self { folder: folder.to_path_buf(), settings, search, checkpoint: Checkpoint::default() };
        made.save()?;
        // written last, so that a folder with a description is complete
        let description = Description { settings: made.settings.clone(), subject };
        files::write(&folder.join(DESCRIPTION), to_json(&description).as_bytes())?;
        Ok(made)
    }

    /// Opens the tuning in a folder at its last checkpoint. Also returns the description of its subject.
    ///
    /// # Errors
    ///
    /// [`TuningError`] if the folder contains no valid tuning.
    pub fn resume(folder: &Path) -> Result<(Self, serde_json::Value), FolderError> {
        let Description { settings, subject } = from_json(&folder.join(DESCRIPTION))?;
        Parameter::check_all(&settings.parameters)?;
        let file = folder.join(CHECKPOINT);
        let checkpoint: Checkpoint = from_json(&file)?;
        let mut search = settings.search()?;
        if let Some(state) = &checkpoint.search {
            search.restore(state).map_err(|source| TuningError::Restore { file, source })?;
        }
        // drop the lines after the checkpoint, which are repeated
        let file = folder.join(TABLE);
        let table = files::read_text(&file)?;
        let expected = checkpoint.evaluations;
        let kept: Vec<&str> =
            table.lines().take(1 + usize::try_from(expected).unwrap_or(usize::MAX)).collect();
        let found = kept.len().saturating_sub(1) as u64;
        if found < expected {
            return Err(TuningError::Table { file, found, expected });
        }
        files::write(&file, (kept.join("\n") + "\n").as_bytes())?;
        Ok((Self { folder: folder.to_path_buf(), settings, search, checkpoint }, subject))
    }

    /// Returns the settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns the number of evaluations so far.
    pub fn evaluations(&self) -> u64 {
        self.checkpoint.evaluations
    }

    /// Returns the path of the file with the best parameters. The file exists once an evaluation has a
    /// reward.
    pub fn best_file(&self) -> PathBuf {
        self.folder.join(BEST)
    }

    /// Evaluates the remaining candidates on `threads` threads. Calls `observe` after each evaluation, in the
    /// order of the candidates.
    ///
    /// # Errors
    ///
    /// [`TuningError`] if the tuning cannot continue. The folder then contains all evaluations so far.
    pub fn run<T: Subject>(
        &mut self,
        subject: &T,
        threads: usize,
        mut observe: impl FnMut(Progress<'_>),
    ) -> Result<(), TuningError<T::Error>> {
        let Self { folder, settings, search, checkpoint } = self;
        let workers = Workers {
            threads,
            ahead: settings.ahead(),
            evaluations: settings.evaluations.saturating_sub(checkpoint.evaluations),
        };
        let mut recorder = Recorder::open(folder, settings, checkpoint, search.as_ref())?;
        maximise(
            search.as_mut(),
            workers,
            |thread| subject.worker(thread).map_err(TuningError::Subject),
            |worker, candidate| {
                let values = settings.values(&candidate.parameters);
                subject.evaluate(worker, &values, candidate.seed).map_err(TuningError::Subject)
            },
            |search, candidate, result| {
                if candidate.id == 0 && result.outcome == Outcome::NoValue {
                    let reason = result.reason.clone().unwrap_or_default();
                    return Err(TuningError::NoReward { reason });
                }
                recorder.record((subject, search), candidate, result, &mut observe)
            },
        )
    }

    /// Returns a summary of the evaluations so far.
    ///
    /// # Errors
    ///
    /// [`TuningError::File`] if the table cannot be read.
    pub fn summary(&self) -> Result<Summary, FolderError> {
        let best = self.search.best().map(|(point, reward)| (self.settings.values(point), reward));
        Ok(Summary {
            evaluations: self.checkpoint.evaluations,
            outcomes: self.checkpoint.outcomes.clone(),
            best,
            table_sha256: sha256_hex(&files::read(&self.folder.join(TABLE))?),
        })
    }

    pub(super) fn save(&self) -> Result<(), FileError> {
        files::write(&self.folder.join(CHECKPOINT), to_json(&self.checkpoint).as_bytes())
    }
}

/// Writes evaluations to the folder of a tuning.
pub(super) struct Recorder<'t> {
    folder: &'t Path,
    settings: &'t Settings,
    checkpoint: &'t mut Checkpoint,
    file: PathBuf,
    table: File,
    best: Option<f64>,
}

impl<'t> Recorder<'t> {
    /// Appends to the table from now on.
    pub(super) fn open(
        folder: &'t Path,
        settings: &'t Settings,
        checkpoint: &'t mut Checkpoint,
        search: &dyn Search,
    ) -> Result<Self, FileError> {
        let file = folder.join(TABLE);
        let table = File::options().append(true).open(&file);
        let table = table.map_err(|source| FileError { file: file.clone(), source })?;
        let best = search.best().map(|(_, reward)| reward);
        Ok(Self { folder, settings, checkpoint, file, table, best })
    }

    /// Notes for the next question the values whose evaluation is recorded next.
    pub(super) fn attended(&mut self, values: &[f64]) {
        self.checkpoint.attended = Attended { stage: Stage::Proposed, last: Some(values.to_vec()) };
    }

    /// Writes the evaluation of a candidate whose reward the search has accepted: a line of the table, better
    /// parameters, and the checkpoint.
    pub(super) fn record<T: Subject>(
        &mut self,
        (subject, search): (&T, &dyn Search),
        candidate: &Candidate,
        result: &Evaluation,
        observe: &mut impl FnMut(Progress<'_>),
    ) -> Result<(), TuningError<T::Error>> {
        let Self { folder, settings, checkpoint, .. } = self;
        let values = settings.values(&candidate.parameters);
        let line = line(candidate.id, &values, result);
        let failed = |source| FileError { file: self.file.clone(), source };
        self.table.write_all(line.as_bytes()).map_err(failed)?;
        let best = search.best().map(|(_, reward)| reward);
        if let Some(reward) = best.filter(|_| best != self.best) {
            let text = subject.best(&values, reward).map_err(TuningError::Subject)?;
            files::write(&folder.join(BEST), text.as_bytes())?;
        }
        self.best = best;
        checkpoint.evaluations += 1;
        *checkpoint.outcomes.entry(result.outcome).or_default() += 1;
        checkpoint.search = Some(search.save());
        files::write(&folder.join(CHECKPOINT), to_json(checkpoint).as_bytes())?;
        let (evaluation, evaluations) = (checkpoint.evaluations, settings.evaluations);
        observe(Progress { evaluation, evaluations, values: &values, result, best });
        Ok(())
    }
}

/// Returns a line of the table.
fn line(id: u64, values: &[f64], result: &Evaluation) -> String {
    let mut line = format!("{id},{}", result.outcome.name());
    line.push(',');
    if result.outcome == Outcome::Finished {
        let _ = write!(line, "{:?}", result.reward);
    }
    for value in values {
        let _ = write!(line, ",{value:?}");
    }
    let _ = writeln!(line, ",{}", quoted(result.reason.as_deref().unwrap_or_default()));
    line
}

/// Returns the text as a table cell in one line.
fn quoted(text: &str) -> String {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if text.contains([',', '"']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).expect("numbers, lists and texts serialise")
}

fn from_json<T: serde::de::DeserializeOwned>(file: &Path) -> Result<T, FolderError> {
    let bytes = files::read(file)?;
    serde_json::from_slice(&bytes)
        .map_err(|error| TuningError::Parse { file: file.to_path_buf(), message: error.to_string() })
}
