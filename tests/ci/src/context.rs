//! Resources of a running step: the folders, the environment of its programs, and the printed lines.

use std::fs;
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::call::{self, Call, Ended, Line, Stream, Streams};
use crate::failure::Failure;

/// Environment of all programs. Each crate is built once, so incremental data and line tables are wasted.
/// One codegen unit per crate saves a fifth of the work.
const ENVIRONMENT: [(&str, &str); 3] =
    [("CARGO_INCREMENTAL", "0"), ("CARGO_PROFILE_DEV_DEBUG", "0"), ("CARGO_PROFILE_DEV_CODEGEN_UNITS", "1")];

/// Arguments of clippy as `cargo clippy -- -D warnings` passes them to its driver.
const CLIPPY_ARGS: &str = "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__";

/// Shared by all steps.
pub(crate) struct Shared {
    /// Root of the repository.
    pub(crate) root: PathBuf,
    /// Folder of temporary files, outside the repository.
    pub(crate) scratch: PathBuf,
    /// Runtime folder of graphs that are invisible to the real-time tests.
    pub(crate) aside: PathBuf,
    /// Prints one line.
    pub(crate) print: fn(&str),
    /// The Python with the optional packages, once they are installed.
    python: Mutex<Option<PathBuf>>,
}

impl Shared {
    /// Creates the temporary folders, and removes folders left by interrupted programs.
    ///
    /// # Errors
    /// [`Failure::File`].
    pub(crate) fn new(root: PathBuf, print: fn(&str)) -> Result<Self, Failure> {
        let scratch = private_folder(&std::env::temp_dir(), "motorium-ci")?;
        let aside = private_folder(Path::new("/dev/shm"), "aside")?;
        Ok(Self { root, scratch, aside, print, python: Mutex::new(None) })
    }

    /// Sets the Python with the optional packages.
    pub(crate) fn set_python(&self, python: Option<PathBuf>) {
        *self.python.lock().unwrap_or_else(PoisonError::into_inner) = python;
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        for folder in [&self.scratch, &self.aside] {
            let _ = fs::remove_dir_all(folder);
        }
    }
}

/// Creates the folder `NAME.PID` for this user only. Removes folders of processes that no longer exist.
fn private_folder(parent: &Path, name: &str) -> Result<PathBuf, Failure> {
    for entry in fs::read_dir(parent).map_err(Failure::file(parent))?.flatten() {
        let file = entry.file_name();
        let process =
            file.to_str().and_then(|file| file.strip_prefix(name)?.strip_prefix('.')?.parse::<u32>().ok());
        if process.is_some_and(|process| !Path::new(&format!("/proc/{process}")).exists()) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
    let folder = parent.join(format!("{name}.{}", std::process::id()));
    let created = fs::DirBuilder::new().mode(0o700).create(&folder);
    created.map_err(Failure::file(&folder))?;
    Ok(folder)
}

/// One running step.
pub(crate) struct Context<'a> {
    shared: &'a Shared,
    /// Printed before each line.
    prefix: String,
    /// The programs run at lower priority and are invisible to the real-time tests.
    is_aside: bool,
    ticks: AtomicU64,
}

impl<'a> Context<'a> {
    pub(crate) fn new(shared: &'a Shared, prefix: String, is_aside: bool) -> Self {
        Self { shared, prefix, is_aside, ticks: AtomicU64::new(0) }
    }

    pub(crate) fn shared(&self) -> &'a Shared {
        self.shared
    }

    /// Processor time of all programs so far, in ticks.
    pub(crate) fn ticks(&self) -> u64 {
        self.ticks.load(Ordering::Relaxed)
    }

    /// Prints a line with the step's prefix.
    pub(crate) fn say(&self, line: &str) {
        (self.shared.print)(&format!("{}{line}", self.prefix));
    }

    /// Path of a temporary file or folder.
    pub(crate) fn scratch(&self, name: &str) -> PathBuf {
        self.shared.scratch.join(name)
    }

    /// Text of a file of the repository.
    pub(crate) fn source(&self, path: &str) -> Result<String, Failure> {
        let path = self.shared.root.join(path);
        fs::read_to_string(&path).map_err(Failure::file(&path))
    }

    /// A call with the environment of this step. Relative programs start in the root of the repository.
    pub(crate) fn call(&self, program: impl AsRef<std::ffi::OsStr>) -> Call {
        let mut call = Call::new(program).folder(&self.shared.root);
        for (name, value) in ENVIRONMENT {
            call = call.env(name, value);
        }
        if let Some(python) = &*self.shared.python.lock().unwrap_or_else(PoisonError::into_inner) {
            call = call.env("MOTORIUM_PYTHON", python);
        }
        if self.is_aside {
            call = call.at_lower_priority().env("XDG_RUNTIME_DIR", &self.shared.aside);
        }
        call
    }

    /// A call of cargo.
    pub(crate) fn cargo(&self, arguments: &str) -> Call {
        self.call("cargo").args(arguments)
    }

    /// A call of cargo that lints the crates of the workspace while it compiles them: a separate
    /// `cargo lint` would read all crates again. This is how `cargo clippy` calls its driver.
    ///
    /// # Errors
    /// Clippy is not installed.
    pub(crate) fn linted_cargo(&self, arguments: &str) -> Result<Call, Failure> {
        let driver = clippy_driver().ok_or_else(|| {
            Failure::Check(
                "there is no clippy, which the lints need: rustup component add clippy".to_string(),
            )
        })?;
        Ok(self.cargo(arguments).env("RUSTC_WORKSPACE_WRAPPER", driver).env("CLIPPY_ARGS", CLIPPY_ARGS))
    }

    /// A call of the optimised command.
    pub(crate) fn motorium(&self, arguments: &str) -> Call {
        self.call(self.command_path()).args(arguments)
    }

    /// Path of the optimised command.
    pub(crate) fn command_path(&self) -> PathBuf {
        self.shared.root.join("target/release/motorium")
    }

    /// Runs a program and prints its output.
    ///
    /// # Errors
    /// The program does not start, or fails.
    pub(crate) fn run(&self, call: &Call) -> Result<Ended, Failure> {
        let mut last = String::new();
        let ended = self.lines(call, &mut |line| {
            self.say(&line.text);
            last = line.text;
        })?;
        succeeded(call, ended.status, last)?;
        Ok(ended)
    }

    /// Runs a program and passes the lines of both its streams.
    ///
    /// # Errors
    /// The program does not start.
    pub(crate) fn lines(&self, call: &Call, on_line: &mut dyn FnMut(Line)) -> Result<Ended, Failure> {
        let ended = call::run(call, Streams::Merged, on_line)?;
        self.ticks.fetch_add(ended.ticks, Ordering::Relaxed);
        Ok(ended)
    }

    /// Returns the standard output of a program and prints its standard error.
    ///
    /// # Errors
    /// The program does not start, or fails.
    pub(crate) fn output(&self, call: &Call) -> Result<String, Failure> {
        let (mut output, mut last) = (String::new(), String::new());
        let ended = call::run(call, Streams::Separate, &mut |line| match line.stream {
            Stream::Output => {
                output += &line.text;
                output.push('\n');
            }
            Stream::Messages => {
                self.say(&line.text);
                last = line.text;
            }
        })?;
        self.ticks.fetch_add(ended.ticks, Ordering::Relaxed);
        succeeded(call, ended.status, last)?;
        Ok(output)
    }

    /// Returns the status of a program and its output.
    ///
    /// # Errors
    /// The program does not start.
    pub(crate) fn quietly(&self, call: &Call) -> Result<(ExitStatus, String), Failure> {
        let mut output = String::new();
        let ended = self.lines(call, &mut |line| {
            output += &line.text;
            output.push('\n');
        })?;
        Ok((ended.status, output))
    }
}

fn succeeded(call: &Call, status: ExitStatus, message: String) -> Result<(), Failure> {
    match status.success() {
        true => Ok(()),
        false => Err(Failure::Ended { command: call.to_string(), status, message }),
    }
}

/// Returns the path of a program in one of the folders of `PATH`.
pub(crate) fn program(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|folder| folder.join(name)).find(|file| file.is_file())
}

fn clippy_driver() -> Option<PathBuf> {
    let mut rustup = Command::new("rustup");
    let output = rustup.args(["which", "clippy-driver"]).stdin(Stdio::null()).output();
    let printed = output.and_then(|output| match output.status.success() {
        true => Ok(PathBuf::from(String::from_utf8_lossy(&output.stdout).trim_end())),
        false => Err(io::Error::other("rustup has no clippy")),
    });
    printed.ok().or_else(|| program("clippy-driver"))
}
