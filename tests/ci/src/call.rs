//! Programs started by the steps: their command lines, output and processor time.

use core::fmt;
use std::ffi::{OsStr, OsString};
use std::io::{self, BufRead, BufReader, PipeReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

use crate::clock;
use crate::failure::Failure;
use crate::proc;

/// Period at which the end of a program is checked while it prints nothing.
const POLL: Duration = Duration::from_millis(20);
/// Time that output may take to arrive after the program has ended; a child may hold the pipe open.
const LAST_OUTPUT: Duration = Duration::from_secs(5);

/// A command line with its environment and working directory.
#[derive(Debug, Clone)]
pub(crate) struct Call {
    program: OsString,
    arguments: Vec<OsString>,
    variables: Vec<(OsString, OsString)>,
    folder: Option<PathBuf>,
}

impl Call {
    pub(crate) fn new(program: impl AsRef<OsStr>) -> Self {
        let program = program.as_ref().to_os_string();
        Self { program, arguments: Vec::new(), variables: Vec::new(), folder: None }
    }

    /// Adds arguments, separated by blanks.
    #[must_use]
    pub(crate) fn args(self, arguments: &str) -> Self {
        arguments.split_whitespace().fold(self, Self::arg)
    }

    /// Adds one argument, which may contain blanks.
    #[must_use]
    pub(crate) fn arg(mut self, argument: impl AsRef<OsStr>) -> Self {
        self.arguments.push(argument.as_ref().to_os_string());
        self
    }

    #[must_use]
    pub(crate) fn env(mut self, name: &str, value: impl AsRef<OsStr>) -> Self {
        self.variables.push((name.into(), value.as_ref().to_os_string()));
        self
    }

    #[must_use]
    pub(crate) fn folder(mut self, folder: &Path) -> Self {
        self.folder = Some(folder.to_path_buf());
        self
    }

    /// The same program at a lower priority.
    #[must_use]
    pub(crate) fn at_lower_priority(mut self) -> Self {
        let program = std::mem::replace(&mut self.program, "nice".into());
        self.arguments.splice(0..0, ["-n".into(), "10".into(), program]);
        self
    }

    fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments).stdin(Stdio::null());
        command.envs(self.variables.iter().map(|(name, value)| (name, value)));
        if let Some(folder) = &self.folder {
            command.current_dir(folder);
        }
        command
    }
}

impl fmt::Display for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.program.to_string_lossy())?;
        self.arguments.iter().try_for_each(|argument| write!(f, " {}", argument.to_string_lossy()))
    }
}

/// Source of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stream {
    /// Standard output, if separated.
    Output,
    /// Standard error, or both.
    Messages,
}

/// One line of output.
#[derive(Debug)]
pub(crate) struct Line {
    pub(crate) text: String,
    pub(crate) stream: Stream,
    /// Unix time [s].
    pub(crate) arrived: f64,
}

/// Separation of standard output from standard error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Streams {
    /// One pipe, in the order of writing.
    Merged,
    Separate,
}

/// End of a program.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ended {
    pub(crate) status: ExitStatus,
    /// Processor time of the program and its children, in ticks of [`proc::TICKS_PER_SECOND`].
    pub(crate) ticks: u64,
}

/// Runs a program to its end and passes every line of its output.
///
/// # Errors
/// [`Failure::Start`]. A program that fails is not an error here.
pub(crate) fn run(call: &Call, streams: Streams, on_line: &mut dyn FnMut(Line)) -> Result<Ended, Failure> {
    let failure = |source| Failure::Start { command: call.to_string(), source };
    let (sender, lines) = mpsc::channel();
    let mut child = spawn(call, streams, &sender).map_err(failure)?;
    drop(sender);
    let mut ended: Option<Instant> = None;
    loop {
        match lines.recv_timeout(POLL) {
            Ok(line) => on_line(line),
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => match ended {
                Some(time) if time.elapsed() > LAST_OUTPUT => break,
                Some(_) => {}
                None if is_zombie(&child) => ended = Some(Instant::now()),
                None => {}
            },
        }
    }
    while !is_zombie(&child) {
        thread::sleep(POLL);
    }
    // once the parent has waited, the times of the process are gone
    let ticks = process(&child).map_or(0, |process| process.ticks);
    Ok(Ended { status: child.wait().map_err(failure)?, ticks })
}

/// Starts the program, and threads that send its output.
fn spawn(call: &Call, streams: Streams, sender: &Sender<Line>) -> io::Result<Child> {
    let mut command = call.command();
    let (messages, writer) = io::pipe()?;
    let output = match streams {
        Streams::Merged => {
            command.stdout(writer.try_clone()?);
            None
        }
        Streams::Separate => {
            let (output, writer) = io::pipe()?;
            command.stdout(writer);
            Some(output)
        }
    };
    command.stderr(writer);
    let child = command.spawn()?;
    // the command holds the ends for writing
    drop(command);
    read(messages, Stream::Messages, sender.clone());
    if let Some(output) = output {
        read(output, Stream::Output, sender.clone());
    }
    Ok(child)
}

/// Sends the lines of a pipe from a thread until all writers have closed it.
fn read(pipe: PipeReader, stream: Stream, sender: Sender<Line>) {
    thread::spawn(move || {
        let mut reader = BufReader::new(pipe);
        let mut bytes = Vec::new();
        while reader.read_until(b'\n', &mut bytes).is_ok_and(|length| length > 0) {
            let arrived = clock::now();
            let text = String::from_utf8_lossy(&bytes);
            let text = text.trim_end_matches(['\n', '\r']).to_string();
            if sender.send(Line { text, stream, arrived }).is_err() {
                // the receiver is gone; a writer must not block
                let _ = io::copy(&mut reader.by_ref(), &mut io::sink());
                return;
            }
            bytes.clear();
        }
    });
}

fn process(child: &Child) -> Option<proc::Process> {
    proc::process(&std::fs::read_to_string(format!("/proc/{}/stat", child.id())).ok()?)
}

/// Returns `true` if the program has ended, or cannot be observed: then only waiting is left.
fn is_zombie(child: &Child) -> bool {
    process(child).is_none_or(|process| process.is_zombie)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(call: &Call, streams: Streams) -> (Vec<(String, Stream)>, Ended) {
        let mut lines = Vec::new();
        let ended = run(call, streams, &mut |line| lines.push((line.text, line.stream))).expect("it starts");
        (lines, ended)
    }

    fn shell(script: &str) -> Call {
        Call::new("sh").arg("-c").arg(script)
    }

    #[test]
    fn output_arrives_line_by_line() {
        let script = shell("echo one; echo two >&2; printf three; exit 7");
        let (merged, ended) = lines(&script, Streams::Merged);
        let texts: Vec<&str> = merged.iter().map(|(text, _)| text.as_str()).collect();
        assert_eq!((texts, ended.status.code()), (vec!["one", "two", "three"], Some(7)));
        let (mut separate, _) = lines(&script, Streams::Separate);
        separate.sort();
        let expected = [("one", Stream::Output), ("three", Stream::Output), ("two", Stream::Messages)];
        assert_eq!(separate, expected.map(|(text, stream)| (text.to_string(), stream)));
    }

    #[test]
    fn processor_time_includes_children() {
        let busy = "i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done";
        let (_, ended) = lines(&shell(&format!("sh -c '{busy}'; true")), Streams::Merged);
        assert!(ended.status.success() && ended.ticks > 0, "{ended:?}");
    }

    #[test]
    fn child_that_keeps_the_pipe_does_not_block() {
        let (texts, ended) = lines(&shell("echo kept; sleep 60 & exit 3"), Streams::Merged);
        assert_eq!((texts.len(), ended.status.code()), (1, Some(3)));
    }

    #[test]
    fn environment_folder_and_priority_apply() {
        let call = shell("echo $MOTORIUM_CI_TEST; pwd; nice").env("MOTORIUM_CI_TEST", "a b");
        let (texts, _) = lines(&call.folder(Path::new("/")).at_lower_priority(), Streams::Merged);
        assert_eq!((texts[0].0.as_str(), texts[1].0.as_str()), ("a b", "/"));
        let (own, _) = lines(&Call::new("nice"), Streams::Merged);
        let [own, lower] = [&own[0].0, &texts[2].0].map(|text| text.parse::<i32>().expect("a number"));
        assert_eq!(lower, (own + 10).min(19));
    }

    #[test]
    fn missing_program_is_named() {
        let failure = run(&Call::new("/no/such/program").args("a b"), Streams::Merged, &mut |_| {});
        let Err(Failure::Start { command, .. }) = failure else { panic!("{failure:?}") };
        assert_eq!(command, "/no/such/program a b");
    }
}
