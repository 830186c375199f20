//! A component under the launcher: a process, a thread of this process, or a component stepped by the
//! launching thread.

use std::io::{BufRead as _, BufReader, Read as _};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{self, Command, Stdio};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, bounded};
use rustix::process::Signal;

use super::LaunchError;
use super::ending::Ending;
use crate::os::{Watch, held_word, interrupt_thread, named, with_shortage};
use crate::region::{ComponentBlock, End, PanicOrigin, Phase, Region};
use crate::run_folder::RunFolder;
use crate::worker::{Failure, GUARD, Host, Hosted, Kind, Outcome, WORKER, Worker};

/// Default time for a component to end after the command to stop.
const STOP_WITHIN: Duration = Duration::from_nanos(crate::plan::STOP_WITHIN_NS);

/// A running component, or the guard.
pub(super) struct Child {
    name: String,
    body: Body,
    lines: Receiver<String>,
    dropped: Arc<AtomicU64>,
    ended: Option<End>,
}

enum Body {
    Process {
        process: process::Child,
        watch: Watch,
        /// `None` for the guard, which holds no word, or if the system could not create a thread.
        ending: Option<Ending>,
        is_reaped: bool,
    },
    Thread(Option<JoinHandle<Outcome>>),
    /// `None` once it has failed or ended.
    Inline(Option<Box<dyn Hosted>>),
    /// Replaced by the program that launched the run.
    Played,
}

impl Child {
    /// Starts a component as a separate process.
    pub(super) fn process(
        program: &Path,
        folder: &RunFolder,
        name: &str,
        (region, index): (&Rc<Region>, usize),
    ) -> Result<Self, LaunchError> {
        let mut command = Command::new(program);
        command.arg(WORKER).arg(folder.path()).arg(name);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        held_word::offer(&region.components()[index].held);
        let mut child = Self::spawn(command, program, folder, name)?;
        if let Body::Process { process, ending, .. } = &mut child.body {
            // Without it the end is detected a few milliseconds later.
            *ending = Ending::watch(process.id(), region, index).ok();
        }
        Ok(child)
    }

    /// Starts the guard in its own process group, so that a signal to the launcher's group does not reach it.
    pub(super) fn guard(program: &Path, folder: &RunFolder) -> Result<Self, LaunchError> {
        let mut command = Command::new(program);
        command.arg(GUARD).arg(folder.path()).process_group(0);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::inherit());
        Self::spawn(command, program, folder, "guard")
    }

    fn spawn(
        mut command: Command,
        program: &Path,
        folder: &RunFolder,
        name: &str,
    ) -> Result<Self, LaunchError> {
        let failed = |error: std::io::Error| {
            let reason = with_shortage(named(&error), folder.path());
            LaunchError::Start { name: name.to_string(), program: program.to_path_buf(), reason }
        };
        let mut process = command.spawn().map_err(failed)?;
        let watch = match Watch::new(process.id()) {
            Ok(watch) => watch,
            Err(error) => {
                let _ = process.kill();
                let _ = process.wait();
                return Err(failed(error));
            }
        };
        let (sender, lines) = bounded(LINES);
        let dropped = Arc::new(AtomicU64::new(0));
        let relayed = process
            .stdout
            .take()
            .map_or(Ok(()), |output| relay(output, sender.clone(), dropped.clone()))
            .and_then(|()| {
                process.stderr.take().map_or(Ok(()), |output| relay(output, sender, dropped.clone()))
            });
        let mut child = Self {
            name: name.to_string(),
            body: Body::Process { process, watch, ending: None, is_reaped: false },
            lines,
            dropped,
            ended: None,
        };
        if let Err(error) = relayed {
            child.kill();
            return Err(failed(error));
        }
        Ok(child)
    }

    /// Starts a component as a thread of this process.
    pub(super) fn thread(kind: Option<&Kind>, folder: &RunFolder, name: &str) -> Result<Self, LaunchError> {
        let failed = |reason: String| LaunchError::Component { name: name.to_string(), reason };
        let kind = *kind.ok_or_else(|| failed("this program does not host its kind".to_string()))?;
        let worker = Worker::open(folder.clone(), name).map_err(failed)?.hosted();
        let thread = std::thread::Builder::new()
            .name(name.to_string())
            .spawn(move || kind.run(worker))
            .map_err(|error| failed(named(&error)))?;
        Ok(Self::of_this_process(name, Body::Thread(Some(thread))))
    }

    /// Opens a component in this thread. A failed configuration is recorded in its block.
    pub(super) fn inline(kind: Option<&Kind>, host: &Host<'_>, index: usize) -> Result<Self, LaunchError> {
        let name = &host.plan.components[index].name;
        let failed = |reason: String| LaunchError::Component { name: name.clone(), reason };
        let kind = kind.ok_or_else(|| failed("this program does not host its kind".to_string()))?;
        let block = &host.region.components()[index];
        let mut child = Self::of_this_process(name, Body::Inline(None));
        match kind.open(host, index) {
            Ok(hosted) => {
                child.body = Body::Inline(Some(hosted));
                block.enter(Phase::Ready);
            }
            Err(failure) => child.fail(block, &failure),
        }
        Ok(child)
    }

    /// Creates a component that the launching program replaces.
    pub(super) fn played(name: &str, block: &ComponentBlock) -> Self {
        block.played.store(1, Relaxed);
        block.enter(Phase::Ready);
        Self::of_this_process(name, Body::Played)
    }

    pub(super) fn is_played(&self) -> bool {
        matches!(self.body, Body::Played)
    }

    fn of_this_process(name: &str, body: Body) -> Self {
        let (_, lines) = bounded(0);
        Self { name: name.to_string(), body, lines, dropped: Arc::default(), ended: None }
    }

    fn fail(&mut self, block: &ComponentBlock, failure: &Failure) {
        block.set_failure(failure);
        block.enter(Phase::Faulted);
        self.body = Body::Inline(None);
        self.ended = Some(End::Failed);
    }

    /// Connects the ports of a component in this thread.
    pub(super) fn connect(&mut self, block: &ComponentBlock) {
        match &mut self.body {
            Body::Inline(Some(hosted)) => match hosted.connect() {
                Ok(()) => block.enter(Phase::Connected),
                Err(failure) => self.fail(block, &failure),
            },
            Body::Played => block.enter(Phase::Connected),
            Body::Process { .. } | Body::Thread(_) | Body::Inline(None) => {}
        }
    }

    /// Begins the run of a component in this thread.
    pub(super) fn begin(&mut self, block: &ComponentBlock) {
        match &mut self.body {
            Body::Inline(Some(hosted)) => {
                hosted.begin();
                block.enter(Phase::Running);
            }
            Body::Played => block.enter(Phase::Running),
            Body::Process { .. } | Body::Thread(_) | Body::Inline(None) => {}
        }
    }

    /// Steps a component in this thread and updates `now_ns` from `CLOCK_MONOTONIC`. Returns `false` if it
    /// failed.
    #[inline]
    pub(super) fn step(&mut self, block: &ComponentBlock, time_ns: u64, now_ns: &mut u64) -> bool {
        let Body::Inline(Some(hosted)) = &mut self.body else { return false };
        match hosted.step(time_ns, *now_ns) {
            Ok(ended_ns) => {
                *now_ns = ended_ns;
                true
            }
            Err(failure) => {
                self.fail(block, &failure);
                false
            }
        }
    }

    /// Resets a component in this thread for an episode. Returns `false` if it failed.
    pub(super) fn reset(&mut self, block: &ComponentBlock, index: u64, seed: u64) -> bool {
        let Body::Inline(Some(hosted)) = &mut self.body else { return matches!(self.body, Body::Played) };
        match hosted.reset(index, seed) {
            Ok(()) => true,
            Err(failure) => {
                self.fail(block, &failure);
                false
            }
        }
    }

    /// Ends a component in this thread in an orderly way.
    pub(super) fn finish(&mut self, block: &ComponentBlock, folder: &RunFolder) {
        match &mut self.body {
            Body::Process { .. } | Body::Thread(_) => return,
            Body::Inline(hosted) => {
                let Some(hosted) = hosted.take() else { return };
                match hosted.finish(folder) {
                    Ok(()) => block.enter(Phase::Stopped),
                    Err(failure) => self.fail(block, &failure),
                }
            }
            Body::Played => block.enter(Phase::Stopped),
        }
        self.ended.get_or_insert(End::Exited(0));
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn pid(&self) -> u32 {
        match &self.body {
            Body::Process { process, .. } => process.id(),
            Body::Thread(_) | Body::Inline(_) | Body::Played => process::id(),
        }
    }

    /// Returns the descriptors that become readable when the process starts to end, and when it has ended.
    pub(super) fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let (ending, ended) = match &self.body {
            Body::Process { watch, ending, is_reaped: false, .. } => {
                let ending = ending.as_ref().filter(|_| self.ended.is_none());
                (ending.map(Ending::descriptor), Some(watch.as_fd()))
            }
            _ => (None, None),
        };
        ending.into_iter().chain(ended)
    }

    /// Returns the lines printed since the last call.
    pub(super) fn printed(&self) -> impl Iterator<Item = String> + '_ {
        self.lines.try_iter()
    }

    /// Returns the number of lines dropped since the last call because they came too fast.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped.swap(0, Relaxed)
    }

    /// Returns the end of the component, or `None` while it is alive.
    pub(super) fn ended(&mut self) -> Option<End> {
        self.is_gone();
        if self.ended.is_none() {
            self.ended = match &mut self.body {
                Body::Process { ending, .. } => ending.as_ref().and_then(Ending::status).map(End::from),
                Body::Thread(thread) if thread.as_ref().is_none_or(JoinHandle::is_finished) => {
                    match thread.take().map(JoinHandle::join) {
                        Some(Ok(Outcome::Stopped)) | None => Some(End::Exited(0)),
                        Some(Ok(Outcome::Failed)) => Some(End::Failed),
                        Some(Err(_)) => Some(End::Panicked(PanicOrigin::Component)),
                    }
                }
                _ => None,
            };
        }
        self.ended
    }

    /// Returns the time at which the end was detected, ns; `None` if it was not detected before the process
    /// was gone.
    pub(super) fn seen_ns(&self) -> Option<u64> {
        match &self.body {
            Body::Process { ending, .. } => ending.as_ref().and_then(Ending::seen_ns),
            Body::Thread(_) | Body::Inline(_) | Body::Played => None,
        }
    }

    /// Returns `true` once the process is completely gone, and reaps it.
    pub(super) fn is_gone(&mut self) -> bool {
        let Body::Process { process, watch, ending, is_reaped } = &mut self.body else {
            return self.ended.is_some();
        };
        if !*is_reaped && watch.has_ended() {
            if let Some(ending) = ending {
                ending.end();
            }
            if let Ok(status) = process.wait() {
                *is_reaped = true;
                self.ended.get_or_insert(End::from(status));
            }
        }
        *is_reaped
    }

    /// Interrupts the component's wait, so that it reads the command.
    pub(super) fn interrupt(&self, thread: i32) {
        match &self.body {
            Body::Process { watch, .. } => watch.signal(Signal::USR2),
            Body::Thread(Some(_)) if thread != 0 => interrupt_thread(thread),
            Body::Thread(_) | Body::Inline(_) | Body::Played => {}
        }
    }

    /// Waits for the end of the component.
    pub(super) fn wait(&mut self, timeout: Duration) -> bool {
        if let Body::Process { watch, .. } = &self.body {
            watch.wait(Some(timeout));
        } else {
            let until = std::time::Instant::now() + timeout;
            while self.ended().is_none() && std::time::Instant::now() < until {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        self.ended().is_some()
    }

    /// Kills a process without waiting for its end. Returns `false` for a thread, which cannot be killed.
    pub(super) fn end(&mut self) -> bool {
        match &mut self.body {
            Body::Process { process, .. } => {
                let _ = process.kill();
                true
            }
            Body::Thread(_) | Body::Inline(_) | Body::Played => false,
        }
    }

    /// Kills and reaps a running process. A thread, which has received the stop command, gets time to end.
    pub(super) fn kill(&mut self) {
        if let Body::Thread(_) = self.body {
            self.wait(STOP_WITHIN);
        }
        if !self.is_gone()
            && let Body::Process { process, ending, is_reaped, .. } = &mut self.body
        {
            if let Some(ending) = ending {
                ending.end();
            }
            let _ = process.kill();
            let _ = process.wait();
            *is_reaped = true;
            self.ended.get_or_insert(End::KilledByLauncher);
        }
    }
}

/// Number of buffered lines of a component.
const LINES: usize = 1024;
/// Longest line that is forwarded in one piece, bytes.
const LONGEST_LINE: u64 = 16 * 1024;

/// Forwards the lines of a component from a separate thread that never blocks: a component must not wait for
/// readers of its output.
fn relay(
    output: impl std::io::Read + Send + 'static,
    sender: Sender<String>,
    dropped: Arc<AtomicU64>,
) -> std::io::Result<()> {
    let thread = std::thread::Builder::new().name("relay".to_string());
    let mut output = BufReader::new(output);
    let spawned = thread.spawn(move || {
        let mut line = Vec::new();
        loop {
            line.clear();
            let read = output.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line);
            if !matches!(read, Ok(bytes) if bytes > 0) {
                return;
            }
            let end = line.len() - usize::from(line.ends_with(b"\n"));
            if sender.try_send(String::from_utf8_lossy(&line[..end]).into_owned()).is_err() {
                dropped.fetch_add(1, Relaxed);
            }
        }
    });
    spawned.map(drop)
}
