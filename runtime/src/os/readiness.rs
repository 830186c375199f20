//! Waiting for a descriptor, a signal or a time, whichever comes first.

#![allow(unsafe_code)] // the signal mask of one thread and the wait that changes it are plain libc calls

use std::io;
use std::os::fd::{AsRawFd as _, OwnedFd};

use super::monotonic_ns;

/// Waits in one thread for a descriptor to become readable, a signal, or a time.
///
/// While this value exists, `SIGUSR1` is blocked in the creating thread except during a wait. A signal that
/// arrives just before a wait therefore ends the wait immediately, and no interrupt is lost.
#[derive(Debug)]
pub struct Readiness {
    descriptor: OwnedFd,
    /// Signals blocked during a wait.
    waiting: libc::sigset_t,
}

impl Readiness {
    /// Prepares the calling thread for waits on this descriptor.
    ///
    /// # Errors
    /// The kernel refused the signal mask.
    pub fn new(descriptor: OwnedFd) -> io::Result<Self> {
        // SAFETY: zero is a valid value of the plain structure, which the call overwrites with the current
        // mask.
        let mut waiting: libc::sigset_t = unsafe { core::mem::zeroed() };
        // SAFETY: both sets are initialised and outlive the calls, which only change the mask of this thread.
        let result = unsafe {
            let mut interrupt: libc::sigset_t = core::mem::zeroed();
            libc::sigemptyset(&raw mut interrupt);
            libc::sigaddset(&raw mut interrupt, libc::SIGUSR1);
            let result = libc::pthread_sigmask(libc::SIG_BLOCK, &raw const interrupt, &raw mut waiting);
            libc::sigdelset(&raw mut waiting, libc::SIGUSR1);
            result
        };
        if result == 0 { Ok(Self { descriptor, waiting }) } else { Err(io::Error::from_raw_os_error(result)) }
    }

    /// Waits until the descriptor is readable, a signal arrives, or `CLOCK_MONOTONIC` reaches `until_ns`.
    /// Returns `true` if the descriptor is readable. A closed or failed descriptor counts as readable; its
    /// next read reports the error.
    pub fn wait(&self, until_ns: Option<u64>) -> bool {
        let mut polled = libc::pollfd { fd: self.descriptor.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        self.poll(core::slice::from_mut(&mut polled), until_ns);
        polled.revents != 0
    }

    /// Sleeps until `CLOCK_MONOTONIC` reaches `until_ns`, or a signal arrives.
    pub fn sleep_until(&self, until_ns: u64) {
        self.poll(&mut [], Some(until_ns));
    }

    fn poll(&self, polled: &mut [libc::pollfd], until_ns: Option<u64>) {
        let timeout = until_ns.map(|until| {
            let ns = until.saturating_sub(monotonic_ns());
            libc::timespec { tv_sec: (ns / 1_000_000_000) as _, tv_nsec: (ns % 1_000_000_000) as _ }
        });
        let timeout = timeout.as_ref().map_or(core::ptr::null(), core::ptr::from_ref);
        // SAFETY: the descriptors (with the given count), the time and the mask outlive the call. An error
        // means a signal; the caller checks the time and its commands in any case.
        unsafe {
            libc::ppoll(polled.as_mut_ptr(), polled.len() as _, timeout, &raw const self.waiting);
        }
    }
}

impl Drop for Readiness {
    fn drop(&mut self) {
        // SAFETY: as in `of`; the previous mask is restored without the interrupt.
        unsafe {
            libc::pthread_sigmask(libc::SIG_SETMASK, &raw const self.waiting, core::ptr::null_mut());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::os::{install_interrupt, interrupt_thread, thread_id};

    const MS: u64 = 1_000_000;

    fn pipe() -> (Readiness, io::PipeWriter) {
        let (reader, writer) = io::pipe().unwrap();
        (Readiness::new(reader.into()).unwrap(), writer)
    }

    #[test]
    fn wait_ends_on_data_or_a_closed_peer() {
        use io::Write as _;
        let (readiness, mut writer) = pipe();
        assert!(!readiness.wait(Some(monotonic_ns())));
        writer.write_all(&[1]).unwrap();
        assert!(readiness.wait(None) && readiness.wait(None), "until it is read");
        let (readiness, writer) = pipe();
        drop(writer);
        assert!(readiness.wait(None));
    }

    #[test]
    fn wait_ends_at_its_time() {
        let (readiness, _writer) = pipe();
        let until = monotonic_ns() + 5 * MS;
        assert!(!readiness.wait(Some(until)));
        assert!(monotonic_ns() >= until);
        readiness.sleep_until(until + 5 * MS);
        assert!(monotonic_ns() >= until + 5 * MS);
    }

    #[test]
    fn interrupt_before_the_wait_ends_the_wait() {
        install_interrupt().unwrap();
        let (readiness, _writer) = pipe();
        let began = monotonic_ns();
        interrupt_thread(thread_id());
        assert!(!readiness.wait(Some(began + 20_000 * MS)));
        interrupt_thread(thread_id());
        readiness.sleep_until(began + 20_000 * MS);
        assert!(monotonic_ns() < began + 10_000 * MS);
    }
}
