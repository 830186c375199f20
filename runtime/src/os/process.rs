//! Threads and processes: interrupting a waiting thread, watching for the end of another process.

#![allow(unsafe_code)] // signal handlers and `tgkill` have no safe wrapper that keeps EINTR

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags};

/// Thread id of the calling thread, as the kernel numbers it.
pub fn thread_id() -> i32 {
    rustix::thread::gettid().as_raw_nonzero().get()
}

extern "C" fn interrupted(_: libc::c_int) {}

/// Makes `SIGUSR1` interrupt a waiting system call of the thread it is sent to, and do nothing else.
///
/// # Errors
/// The kernel refused the handler.
pub fn install_interrupt() -> io::Result<()> {
    // SAFETY: the action is fully initialised (zero is a valid empty mask and flag set, so no SA_RESTART), and the
    // handler does nothing, which is safe in any context.
    let result = unsafe {
        let mut action: libc::sigaction = core::mem::zeroed();
        action.sa_sigaction = interrupted as *const () as usize;
        libc::sigaction(libc::SIGUSR1, &action, core::ptr::null_mut())
    };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Interrupts the system call in which a thread of this process waits.
pub fn interrupt_thread(thread: i32) {
    // SAFETY: a system call on integers; a thread that is gone gives ESRCH, which is fine.
    unsafe {
        libc::syscall(libc::SYS_tgkill, libc::getpid(), thread, libc::SIGUSR1);
    }
}

/// A handle on another process that reports its end, even if its number is reused.
#[derive(Debug)]
pub struct Watch(OwnedFd);

impl Watch {
    /// Watches the process with this number.
    ///
    /// # Errors
    /// There is no such process (any more).
    pub fn new(pid: u32) -> io::Result<Self> {
        let pid = Pid::from_raw(pid as i32).ok_or_else(|| io::Error::other("0 is no process"))?;
        Ok(Self(rustix::process::pidfd_open(pid, PidfdFlags::empty())?))
    }

    /// Sends a signal to it; does nothing when it has ended.
    pub fn signal(&self, signal: rustix::process::Signal) {
        let _ = rustix::process::pidfd_send_signal(&self.0, signal);
    }

    /// True if it has ended.
    pub fn has_ended(&self) -> bool {
        self.wait(Some(Duration::ZERO))
    }

    /// Waits for its end; true if it has ended, false after the timeout or an interruption.
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
