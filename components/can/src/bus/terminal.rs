//! Serial lines that carry raw bytes and are reopened after a loss.

#![allow(unsafe_code)] // terminal settings need libc calls, which no crate of the project offers

use core::mem::MaybeUninit;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::fd::{AsFd, AsRawFd as _, BorrowedFd};
use std::os::unix::fs::OpenOptionsExt as _;

use super::socket::{Condition, OpenError, SocketCounts};
use super::time::Retry;
use crate::frame::Id;

/// Opens a serial line at this speed in raw, non-blocking mode: characters are neither translated, echoed nor
/// line-buffered.
pub(super) fn open(path: &str, speed: libc::speed_t) -> Result<File, OpenError> {
    set_up(path, speed).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => OpenError::NoLine(path.into()),
        _ => OpenError::Refused(path.into(), error),
    })
}

fn set_up(path: &str, speed: libc::speed_t) -> io::Result<File> {
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY | libc::O_CLOEXEC)
        .open(path)?;
    let mut settings = MaybeUninit::<libc::termios>::zeroed();
    // SAFETY: the descriptor is open and the buffer has the type that the call fills. It is read only after
    // the call has filled it, and is modified with the library's own functions.
    unsafe {
        if libc::tcgetattr(file.as_raw_fd(), settings.as_mut_ptr()) != 0 {
            return Err(io::Error::last_os_error());
        }
        let mut settings = settings.assume_init();
        libc::cfmakeraw(&raw mut settings);
        settings.c_cflag |= libc::CLOCAL | libc::CREAD;
        libc::cfsetspeed(&raw mut settings, speed);
        if libc::tcsetattr(file.as_raw_fd(), libc::TCSANOW, &raw const settings) != 0 {
            return Err(io::Error::last_os_error());
        }
    }
    Ok(file)
}

/// Serial line with its output and input buffers, its condition and its counters.
#[derive(Debug)]
pub(super) struct Terminal {
    path: String,
    file: File,
    /// Bytes that must be written before all others.
    pending: Vec<u8>,
    bytes: Box<[u8; 1024]>,
    /// Range of `bytes` that has not been read yet.
    unread: (usize, usize),
    filters: Vec<Id>,
    pub(super) condition: Condition,
    pub(super) counts: SocketCounts,
    retry: Retry,
}

impl Terminal {
    /// Creates a terminal for an open line, with an output buffer of `room` bytes.
    pub(super) fn new(path: &str, file: File, room: usize) -> Self {
        Self {
            path: path.into(),
            file,
            pending: Vec::with_capacity(room),
            bytes: Box::new([0; 1024]),
            unread: (0, 0),
            filters: Vec::new(),
            condition: Condition::Active,
            counts: SocketCounts::default(),
            retry: Retry::default(),
        }
    }

    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Returns `true` for a pseudo-terminal, which has a program instead of a wire behind it.
    pub(super) fn is_virtual(&self) -> bool {
        std::fs::canonicalize(&self.path).is_ok_and(|path| path.starts_with("/dev/pts"))
    }

    /// Restricts reception to frames with these identifiers.
    pub(super) fn receive_only(&mut self, ids: &[Id]) {
        self.filters = ids.to_vec();
    }

    /// Returns `true` if frames with this identifier pass the filter.
    pub(super) fn wants(&self, id: Id) -> bool {
        self.filters.is_empty() || self.filters.contains(&id)
    }

    /// Records that the line has gone.
    fn lose(&mut self) {
        if self.condition != Condition::Gone {
            self.counts.down += 1;
            self.condition = Condition::Gone;
            self.retry.begin();
        }
    }

    /// Tries once per second to reopen a lost line. Returns `true` once it is open again.
    pub(super) fn look_again(&mut self, open: impl FnOnce(&str) -> Result<File, OpenError>) -> bool {
        if self.condition != Condition::Gone || !self.retry.is_due() {
            return false;
        }
        let Ok(file) = open(&self.path) else { return false };
        (self.file, self.condition, self.unread) = (file, Condition::Active, (0, 0));
        self.pending.clear();
        true
    }

    /// Returns the number of free bytes in the output buffer.
    pub(super) fn room(&self) -> usize {
        self.pending.capacity() - self.pending.len()
    }

    /// Appends bytes to the output buffer.
    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.pending.extend_from_slice(bytes);
    }

    /// Writes the output buffer. Returns `false` if bytes are left.
    pub(super) fn flush(&mut self) -> bool {
        while !self.pending.is_empty() {
            match self.file.write(&self.pending) {
                Ok(0) => return false,
                Ok(count) => drop(self.pending.drain(..count)),
                Err(error) => {
                    self.fail(&error);
                    return false;
                }
            }
        }
        true
    }

    /// Writes bytes immediately, after the output buffer has been emptied. Returns the number of bytes
    /// written.
    pub(super) fn write(&mut self, bytes: &[u8]) -> usize {
        match self.file.write(bytes) {
            Ok(written) => written,
            Err(error) => {
                self.fail(&error);
                0
            }
        }
    }

    fn fail(&mut self, error: &io::Error) {
        match error.kind() {
            io::ErrorKind::WouldBlock => self.counts.queue_full += 1,
            io::ErrorKind::Interrupted => {}
            _ => self.lose(),
        }
    }

    /// Waits for input for at most `longest_ns`. Returns `false` if nothing arrived.
    pub(super) fn wait(&self, longest_ns: u64) -> bool {
        let mut polled = libc::pollfd { fd: self.file.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        let longest = libc::timespec {
            tv_sec: (longest_ns / 1_000_000_000) as _,
            tv_nsec: (longest_ns % 1_000_000_000) as _,
        };
        // SAFETY: the one descriptor and the time live throughout the call.
        unsafe { libc::ppoll(&raw mut polled, 1, &raw const longest, core::ptr::null()) > 0 }
    }

    /// Returns the next byte, if available.
    pub(super) fn next_byte(&mut self) -> Option<u8> {
        if self.unread.0 == self.unread.1 {
            match self.file.read(&mut self.bytes[..]) {
                // the line has hung up
                Ok(0) => {
                    self.lose();
                    return None;
                }
                Ok(count) => self.unread = (0, count),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return None,
                Err(error) => {
                    self.fail(&error);
                    return None;
                }
            }
        }
        self.unread.0 += 1;
        self.bytes.get(self.unread.0 - 1).copied()
    }
}

impl AsFd for Terminal {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}
