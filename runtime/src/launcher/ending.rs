//! Detection of a process's end before its memory is released.

#![allow(unsafe_code)] // a second thread reads a word of the control block

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::process::ExitStatus;
use std::rc::Rc;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::os::held_word::{self, Flag};
use crate::os::monotonic_ns;
use crate::region::Region;

/// A watch over the word that a component's process holds. When the process begins to end, its threads lose
/// their real-time priority and a descriptor becomes readable.
pub(super) struct Ending {
    region: Rc<Region>,
    index: usize,
    seen: Arc<Seen>,
    thread: Option<JoinHandle<()>>,
}

struct Seen {
    flag: Flag,
    /// Exit status, and the time of its detection, ns.
    status: OnceLock<(ExitStatus, u64)>,
    is_over: AtomicBool,
}

/// Maximum number of checks for the exit status of a process whose word was released.
const LOOKS: u32 = 100;
/// Interval between these checks.
const BETWEEN: Duration = Duration::from_micros(20);

impl Ending {
    /// Watches a component's process that was just started.
    pub(super) fn watch(pid: u32, region: &Rc<Region>, index: usize) -> io::Result<Self> {
        let seen = Seen { flag: Flag::new()?, status: OnceLock::new(), is_over: AtomicBool::new(false) };
        let seen = Arc::new(seen);
        // SAFETY: the word is in the mapping of the region, which this value keeps until the thread has been
        // joined.
        let word: &'static AtomicU32 = unsafe { &*core::ptr::from_ref(&region.components()[index].held) };
        let shared = seen.clone();
        let thread = std::thread::Builder::new().name("ending".to_string()).stack_size(128 * 1024);
        let thread = thread.spawn(move || shared.look(word, pid))?;
        Ok(Self { region: region.clone(), index, seen, thread: Some(thread) })
    }

    /// Returns the exit status of the ending process, if known.
    pub(super) fn status(&self) -> Option<ExitStatus> {
        self.seen.status.get().map(|(status, _)| *status)
    }

    /// Returns the time of the detection, ns.
    pub(super) fn seen_ns(&self) -> Option<u64> {
        self.seen.status.get().map(|(_, seen_ns)| *seen_ns)
    }

    /// Returns a descriptor that becomes readable when the status is known.
    pub(super) fn descriptor(&self) -> BorrowedFd<'_> {
        self.seen.flag.as_fd()
    }

    /// Ends the watch. Call it before the process is reaped, because its id may be reused afterwards.
    pub(super) fn end(&mut self) {
        let Some(thread) = self.thread.take() else { return };
        self.seen.is_over.store(true, Relaxed);
        held_word::release(&self.region.components()[self.index].held);
        let _ = thread.join();
    }
}

impl Drop for Ending {
    fn drop(&mut self) {
        self.end();
    }
}

impl Seen {
    fn look(&self, word: &AtomicU32, pid: u32) {
        // Runs even if the shared cores are busy, so that a crash is detected immediately.
        crate::os::wake_first();
        held_word::await_end(word);
        for _ in 0..LOOKS {
            if self.is_over.load(Relaxed) {
                return;
            }
            if let Some(status) = held_word::ending_status(pid) {
                let _ = self.status.set((status, monotonic_ns()));
                self.flag.raise();
                return held_word::demote(pid);
            }
            std::thread::sleep(BETWEEN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::End;

    #[test]
    fn killed_process_shows_its_status_while_ending() {
        assert_eq!(held_word::ending_status(std::process::id()), None);
        let mut child = std::process::Command::new("sleep").arg("100").spawn().unwrap();
        assert_eq!(held_word::ending_status(child.id()), None);
        child.kill().unwrap();
        let status = loop {
            // The process remains visible as ending until it is reaped.
            if let Some(status) = held_word::ending_status(child.id()) {
                break status;
            }
        };
        assert_eq!(End::from(status), End::Killed(libc::SIGKILL));
        assert_eq!(child.wait().unwrap(), status);
    }
}
