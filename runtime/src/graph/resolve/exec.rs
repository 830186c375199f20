//! User programs: search, and queries of their declarations.
//!
//! The program is run once as `program motorium-describe`. It receives
//! `{"config": ..., "robot": ..., "placement": ...}` on standard input and answers on standard output with
//! `{"motorium": VERSION, "declaration": ...}`, or with
//! `{"motorium": VERSION, "error": {"key": ..., "message": ..., "advice": ...}}`.

use std::io::{Read as _, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, bounded};
use serde_json::Value as Json;

use super::draft::Draft;
use crate::declare::{ConfigError, Declaration};
use crate::graph::diagnostic::Report;
use crate::graph::source::Span;
use crate::region::layout_digest;
use crate::worker::{
    DESCRIBE, DescribeAnswer, DescribeError, DescribeRequest, KINDS, KindAnswer, KindsAnswer,
};

/// Timeout of the program's answer.
const DESCRIBE_TIMEOUT: Duration = Duration::from_secs(5);
/// Maximum length of the program's answer, bytes.
const LONGEST_ANSWER: u64 = 1 << 20;
/// Version of this crate. It must be equal on both sides, because they share memory layouts.
pub(super) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Error of querying a program.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExecProblem {
    /// The file of the program does not exist.
    #[error("program `{}` does not exist", .0.display())]
    Missing(PathBuf),
    /// The path does not name a program.
    #[error("`{}` is not an executable program", .0.display())]
    NotExecutable(PathBuf),
    /// The operating system cannot start the program.
    #[error("program `{}` cannot be started: {reason}", path.display())]
    Start {
        /// Path of the program.
        path: PathBuf,
        /// Reason why the start failed.
        reason: String,
    },
    /// The program does not answer in time.
    #[error("program `{}` did not answer within {} s", .0.display(), DESCRIBE_TIMEOUT.as_secs())]
    Silent(PathBuf),
    /// The answer of the program is not valid.
    #[error("program `{}` gave an invalid answer to `{request}`: {reason}", path.display())]
    NoComponent {
        /// Path of the program.
        path: PathBuf,
        /// The request, which is passed to the program as an argument.
        request: &'static str,
        /// Reason why the answer is not valid.
        reason: String,
        /// Last line that the program printed on standard error.
        stderr: String,
    },
    /// The program and the process that queries it were built with different versions of motorium.
    #[error("program `{}` was built with motorium {found}, expected motorium {VERSION}", path.display())]
    Version {
        /// Path of the program.
        path: PathBuf,
        /// Version with which the program was built.
        found: String,
    },
    /// The program and the process that queries it were built with the same version of motorium, but lay out
    /// shared memory differently.
    #[error("program `{}` lays out shared memory differently from this build of motorium {VERSION}", .0.display())]
    Memory(PathBuf),
}

impl ExecProblem {
    /// Reports the problem of a user's program.
    pub(super) fn report(&self, draft: &Draft<'_, '_>, span: &Span, report: &mut Report) {
        let diagnostic =
            report.error(format!("component `{}`: {self}", draft.name)).label(span, "this program");
        if let Self::NoComponent { stderr, .. } = self
            && !stderr.is_empty()
        {
            diagnostic.note(format!("standard error: {stderr}"));
        }
        diagnostic.advise(match self {
            Self::Missing(_) => format!("{}; the path is relative to the graph file", self.advice()),
            _ => self.advice(),
        });
    }

    /// Returns advice on how to fix the user's program.
    pub fn advice(&self) -> String {
        match self {
            Self::Missing(_) => "build it first: `cargo build --release`",
            Self::NotExecutable(path) if path.is_dir() => {
                "this is a folder; name the program itself, such as `target/release/my-component`"
            }
            Self::NotExecutable(path) => return format!("try `chmod +x {}`", path.display()),
            Self::Start { .. } => "was it built for this machine? try `cargo build --release`",
            Self::Silent(_) => {
                "`motorium::main!(...)` answers immediately; does the program work before calling it?"
            }
            Self::NoComponent { .. } => "its main function must be `motorium::main!(MyComponent);`",
            Self::Version { .. } | Self::Memory(_) => {
                "build it again with the same version: `cargo build --release`"
            }
        }
        .to_string()
    }
}

/// Finds the program at a path relative to the folder of the graph file.
///
/// # Errors
/// The program does not exist, or is not executable.
pub fn find(exec: &str, folder: &Path) -> Result<PathBuf, ExecProblem> {
    let path = folder.join(exec);
    let Ok(found) = path.canonicalize() else { return Err(ExecProblem::Missing(path)) };
    match found.metadata() {
        Ok(facts) if facts.is_file() && facts.permissions().mode() & 0o111 != 0 => Ok(found),
        _ => Err(ExecProblem::NotExecutable(found)),
    }
}

/// Queries a program for the declaration of its component with this configuration. If the component rejects
/// the configuration, the inner result holds its error.
///
/// # Errors
/// The program does not answer according to this version's protocol.
pub fn describe(
    path: &Path,
    request: &DescribeRequest,
) -> Result<Result<Declaration, ConfigError>, ExecProblem> {
    let request = serde_json::to_string(request)
        .map_err(|error| ExecProblem::Start { path: path.to_path_buf(), reason: error.to_string() })?;
    let reply: DescribeAnswer = answer(path, DESCRIBE, request)?;
    same_memory(path, &reply.memory)?;
    match (reply.declaration, reply.error) {
        (_, Some(DescribeError { key, message, advice })) => Ok(Err(ConfigError { key, message, advice })),
        (Some(declaration), None) => Ok(Ok(declaration)),
        (None, None) => Err(ExecProblem::NoComponent {
            path: path.to_path_buf(),
            request: DESCRIBE,
            reason: "its answer has no declaration".into(),
            stderr: String::new(),
        }),
    }
}

/// Queries a program for the kinds of components that it contains.
///
/// # Errors
/// The program does not answer according to this version's protocol.
pub fn kinds(path: &Path) -> Result<Vec<KindAnswer>, ExecProblem> {
    let reply: KindsAnswer = answer(path, KINDS, String::new())?;
    same_memory(path, &reply.memory)?;
    Ok(reply.kinds)
}

/// Checks that two builds of one version have the same layout of shared memory, because otherwise they could
/// not share a control block.
fn same_memory(path: &Path, digest: &str) -> Result<(), ExecProblem> {
    if digest == layout_digest() { Ok(()) } else { Err(ExecProblem::Memory(path.to_path_buf())) }
}

/// Returns the answer of the program, which must be of this version, to a request.
fn answer<T: serde::de::DeserializeOwned>(
    path: &Path,
    argument: &'static str,
    request: String,
) -> Result<T, ExecProblem> {
    let answer = ask(path, argument, request)?;
    let no_component = |reason: String| ExecProblem::NoComponent {
        path: path.to_path_buf(),
        request: argument,
        reason,
        stderr: answer.stderr.clone(),
    };
    let reply: Json = serde_json::from_str(&answer.stdout).map_err(|error| {
        no_component(match (answer.status.success(), answer.stdout.trim()) {
            (false, _) => format!("it ended with {}", answer.status),
            (true, "") => "its standard output is empty".to_string(),
            _ => format!("it did not answer in JSON ({error})"),
        })
    })?;
    let version = reply.get("motorium").and_then(Json::as_str).unwrap_or_default();
    if version.is_empty() {
        return Err(no_component("its answer has no version of motorium".into()));
    }
    if version != VERSION {
        return Err(ExecProblem::Version { path: path.to_path_buf(), found: version.to_string() });
    }
    serde_json::from_value(reply)
        .map_err(|error| no_component(format!("its answer cannot be read ({error})")))
}

struct Answer {
    status: ExitStatus,
    stdout: String,
    /// Last line of its standard error.
    stderr: String,
}

fn ask(path: &Path, argument: &str, request: String) -> Result<Answer, ExecProblem> {
    let spawn = || {
        Command::new(path)
            .arg(argument)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
    };
    let start = |error: std::io::Error| ExecProblem::Start {
        path: path.to_path_buf(),
        reason: crate::os::named(&error),
    };
    let mut child = spawn().map_err(start)?;
    let silent = || ExecProblem::Silent(path.to_path_buf());
    let deadline = Instant::now() + DESCRIBE_TIMEOUT;
    if let Some(mut stdin) = child.stdin.take() {
        // a program that never reads must not block this one; its answer shows whether it read the request
        let spawned = thread().spawn(move || stdin.write_all(request.as_bytes()));
        spawned.map(drop).or_else(|error| ended(&mut child, error)).map_err(start)?;
    }
    let stdout = read_all(child.stdout.take()).or_else(|error| ended(&mut child, error)).map_err(start)?;
    let stderr = read_all(child.stderr.take()).or_else(|error| ended(&mut child, error)).map_err(start)?;
    let finished = wait_until(&mut child, deadline);
    let Some(status) = finished.map_err(start)? else {
        // it may have just ended
        let _ = child.kill();
        let _ = child.wait();
        return Err(silent());
    };
    let collect = |channel: Receiver<String>| {
        channel
            .recv_timeout(deadline.saturating_duration_since(Instant::now()).max(Duration::from_millis(50)))
    };
    let stdout = collect(stdout).map_err(|_| silent())?;
    let stderr = collect(stderr).unwrap_or_default();
    let last = stderr.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default();
    Ok(Answer { status, stdout, stderr: last.trim().to_string() })
}

fn thread() -> std::thread::Builder {
    std::thread::Builder::new().name("describe".to_string())
}

/// Kills a program that cannot be queried because there is no thread left.
fn ended<T>(child: &mut Child, error: std::io::Error) -> std::io::Result<T> {
    let _ = child.kill();
    let _ = child.wait();
    Err(error)
}

/// Reads a stream to its end on a separate thread; a child of the program may keep it open forever.
fn read_all(stream: Option<impl std::io::Read + Send + 'static>) -> std::io::Result<Receiver<String>> {
    let (send, receive) = bounded(1);
    thread().spawn(move || {
        let mut bytes = Vec::new();
        if let Some(stream) = stream {
            // data read before an error are still worth showing
            let _ = stream.take(LONGEST_ANSWER).read_to_end(&mut bytes);
        }
        let _ = send.send(String::from_utf8_lossy(&bytes).into_owned());
    })?;
    Ok(receive)
}

fn wait_until(child: &mut Child, deadline: Instant) -> std::io::Result<Option<ExitStatus>> {
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if Instant::now() >= deadline {
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
