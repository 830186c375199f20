//! Serial lines that carry bytes as they are.

#![allow(unsafe_code)] // the settings of a terminal are plain libc calls, and no crate of the project offers them

use core::mem::MaybeUninit;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd as _;
use std::os::unix::fs::OpenOptionsExt as _;

/// Opens a serial line that never waits, at this speed, with no character translated, echoed or kept.
pub(super) fn open(path: &str, speed: libc::speed_t) -> io::Result<File> {
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY | libc::O_CLOEXEC)
        .open(path)?;
    let mut settings = MaybeUninit::<libc::termios>::zeroed();
    // SAFETY: the descriptor is open and the place has the type that the call fills; it is read only once the call has filled
    // it, and changed through the library's own functions.
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
