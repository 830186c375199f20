//! The `motorium` commands that the viewer starts: the run of a graph, its times, a stop.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use rustix::process::{Pid, Signal, kill_process};

/// Time allowed for a run to end before it is left to its guard.
const END_WITHIN: Duration = Duration::from_secs(15);

/// A graph whose run ended before the viewer saw it.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NeverSeen {
    /// The run failed with an exit code; `motorium run` has printed the reason.
    #[error("`motorium run` ended with exit code {0} before the viewer saw its graph")]
    Failed(u8),
    /// A signal ended the run.
    #[error("`motorium run` was ended ({0}) before the viewer saw its graph")]
    Killed(ExitStatus),
    /// It ended in good order.
    #[error(
        "the run was over before the viewer saw it, so nothing was shown: let it run for longer, such as `-- --for 1min`, \
         or record it and play the recording"
    )]
    Over,
}

impl NeverSeen {
    pub(crate) fn from_status(status: ExitStatus) -> Self {
        match status.code().map(u8::try_from) {
            Some(Ok(0)) => Self::Over,
            Some(Ok(code)) => Self::Failed(code),
            Some(Err(_)) | None => Self::Killed(status),
        }
    }
}

/// A graph that the viewer has started.
#[derive(Debug)]
pub(crate) struct Started(Child);

impl Started {
    /// Starts `motorium run GRAPH ARGUMENTS`. Its report goes to standard output unless `quiet`.
    pub(crate) fn run(
        motorium: &Path,
        graph: &Path,
        arguments: &[String],
        quiet: bool,
    ) -> anyhow::Result<Self> {
        let mut command = Command::new(motorium);
        command.arg("run").arg(graph).args(arguments).stdin(Stdio::null());
        if quiet {
            command.stdout(Stdio::null());
        }
        Ok(Self(command.spawn().with_context(|| format!("starting {}", motorium.display()))?))
    }

    /// Returns the launcher of its run.
    pub(crate) fn pid(&self) -> u32 {
        self.0.id()
    }

    /// Returns the exit status, once the process has ended.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().ok().flatten()
    }

    /// Ends the run gracefully: the robot enters its safe state first. `asked` is `true` if the run has
    /// already received the request, such as `Ctrl-C` in a shared terminal.
    pub(crate) fn end(&mut self, asked: bool) {
        if !asked {
            interrupt(self.pid());
        }
        let began = Instant::now();
        while self.ended().is_none() && began.elapsed() < END_WITHIN {
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        if self.ended().is_none() {
            self.end(false);
        }
    }
}

/// Requests the orderly end of a process.
fn interrupt(pid: u32) {
    if let Some(pid) = i32::try_from(pid).ok().and_then(Pid::from_raw) {
        // The process may just have ended.
        let _ = kill_process(pid, Signal::INT);
    }
}

/// Times of a run from `motorium top --json`, one line every half second.
#[derive(Debug)]
pub(crate) struct Times {
    child: Child,
    lines: Receiver<String>,
}

impl Times {
    pub(crate) fn follow(motorium: &Path, run: &str) -> anyhow::Result<Self> {
        let mut child = Command::new(motorium)
            .args(["top", "--json", "--interval", "500ms", "--run", run])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .with_context(|| format!("starting {}", motorium.display()))?;
        let output = child.stdout.take().context("it has a standard output")?;
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || {
            let read = BufReader::new(output).lines().map_while(Result::ok);
            // The receiver is dropped once its output is no longer read.
            let _ = read.into_iter().try_for_each(|line| sender.send(line));
        });
        Ok(Self { child, lines })
    }

    /// Returns the newest line since the last call.
    pub(crate) fn newest(&self) -> Option<String> {
        self.lines.try_iter().last()
    }
}

impl Drop for Times {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs a `motorium` command on a run and returns its standard output.
pub(crate) fn command(motorium: &Path, arguments: &[&str]) -> Result<String, String> {
    let output = Command::new(motorium).args(arguments).stdin(Stdio::null()).output();
    let output = output.map_err(|error| format!("{} does not start: {error}", motorium.display()))?;
    let words = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_string();
    if output.status.success() { Ok(words(&output.stdout)) } else { Err(words(&output.stderr)) }
}
