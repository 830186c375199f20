//! Threads and processes: interrupting a waiting thread, and watching for the end of another process.

#![allow(unsafe_code)] // signal handlers and `tgkill` have no safe wrapper that keeps EINTR

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags};

/// Returns the kernel thread id of the calling thread.
pub fn thread_id() -> i32 {
    rustix::thread::gettid().as_raw_nonzero().get()
}

extern "C" fn interrupted(_: libc::c_int) {}

/// Installs a handler with which `SIGUSR1` only interrupts a waiting system call of the thread that receives
/// it.
///
/// # Errors
/// The kernel refused the handler.
pub fn install_interrupt() -> io::Result<()> {
    // SAFETY: the action is fully initialised (zero is a valid empty mask and flag set, so no SA_RESTART),
    // and the handler does nothing, which is safe in any context.
    let result = unsafe {
        let mut action: libc::sigaction = core::mem::zeroed();
        action.sa_sigaction = interrupted as *const () as usize;
        libc::sigaction(libc::SIGUSR1, &action, core::ptr::null_mut())
    };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Interrupts the system call in which a thread of this process waits. Requires [`install_interrupt`].
pub fn interrupt_thread(thread: i32) {
    // SAFETY: a system call on integers; it returns ESRCH for a missing thread, which is fine.
    unsafe {
        libc::syscall(libc::SYS_tgkill, libc::getpid(), thread, libc::SIGUSR1);
    }
}

/// Returns `true` if a signal has its default action in this process.
pub(crate) fn is_default(signal: libc::c_int) -> bool {
    action_of(signal) == Some(libc::SIG_DFL)
}

/// Returns `true` if this process ignores a signal.
pub(crate) fn is_ignored(signal: libc::c_int) -> bool {
    action_of(signal) == Some(libc::SIG_IGN)
}

fn action_of(signal: libc::c_int) -> Option<libc::sighandler_t> {
    // SAFETY: zero is a valid value of the plain structure, into which the call writes the current action.
    unsafe {
        let mut action: libc::sigaction = core::mem::zeroed();
        (libc::sigaction(signal, core::ptr::null(), &raw mut action) == 0).then_some(action.sa_sigaction)
    }
}

/// Returns the state of a thread as reported by the kernel: `R` running or ready, `S` sleeping, `D` waiting
/// for a device, `T` stopped by a signal, `t` stopped by a debugger, `Z` ended. Returns `None` if the thread
/// does not exist.
pub fn process_state(pid: u32, thread: u32) -> Option<char> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/task/{thread}/stat")).ok()?;
    // the name is in parentheses and may contain any characters
    stat.rsplit_once(')')?.1.trim_start().chars().next()
}

/// Discards all further output of this process.
pub fn discard_output() {
    use std::os::fd::AsRawFd as _;
    let Ok(nowhere) = std::fs::File::options().write(true).open("/dev/null") else { return };
    for standard in [libc::STDOUT_FILENO, libc::STDERR_FILENO] {
        // SAFETY: a system call on integers; both descriptors are open, and nothing owns the standard ones.
        unsafe { libc::dup2(nowhere.as_raw_fd(), standard) };
    }
}

/// A handle to a process that reports when the process has ended, even if the system reuses the id of the
/// process.
#[derive(Debug)]
pub struct Watch(OwnedFd);

impl Watch {
    /// Watches the process with this id.
    ///
    /// # Errors
    /// The process does not exist.
    pub fn new(pid: u32) -> io::Result<Self> {
        let pid = Pid::from_raw(pid as i32).ok_or_else(|| io::Error::other("0 is not a process id"))?;
        Ok(Self(rustix::process::pidfd_open(pid, PidfdFlags::empty())?))
    }

    /// Sends a signal. Has no effect if the process has ended.
    pub fn signal(&self, signal: rustix::process::Signal) {
        let _ = rustix::process::pidfd_send_signal(&self.0, signal);
    }

    /// Returns `true` if the process has ended.
    pub fn has_ended(&self) -> bool {
        self.wait(Some(Duration::ZERO))
    }

    /// Waits for the end of the process. Returns `true` if it has ended, `false` after the timeout or if a
    /// signal interrupted the wait.
    pub fn wait(&self, timeout: Option<Duration>) -> bool {
        let timeout =
            timeout.map(|t| Timespec { tv_sec: t.as_secs() as i64, tv_nsec: t.subsec_nanos() as _ });
        let mut polled = [PollFd::new(&self.0, PollFlags::IN)];
        matches!(poll(&mut polled, timeout.as_ref()), Ok(n) if n > 0)
    }
}

impl AsFd for Watch {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calling_thread_is_running_and_unknown_has_no_state() {
        assert_eq!(process_state(std::process::id(), thread_id() as u32), Some('R'));
        assert_eq!(process_state(u32::MAX, 1), None);
    }
}
