//! File locks that end with the holding process.

#![allow(unsafe_code)] // locks of open file descriptions have no safe wrapper that can also test for holders

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;

/// A shared file lock, held until it is dropped or its process ends in any way.
///
/// Any number of processes may hold the lock, in any namespace. [`is_held`] tests the lock without acquiring
/// it.
#[derive(Debug)]
pub struct Lock(#[expect(dead_code, reason = "the open file holds the lock")] File);

impl Lock {
    /// Acquires the lock on a file. Creates a missing file, accessible to its owner only.
    ///
    /// # Errors
    /// The file cannot be created or opened, or the file system has no locks.
    pub fn hold(path: &Path) -> io::Result<Self> {
        let file = options().create(true).truncate(false).mode(0o600).open(path)?;
        command(&file, libc::F_OFD_SETLK, &mut request(libc::F_RDLCK, 0))?;
        Ok(Self(file))
    }

    /// Acquires the exclusive lock with number `place` (from 0) of a file. Returns `None` if another process
    /// holds it. These locks are independent of [`hold`](Self::hold) on the same file.
    ///
    /// # Errors
    /// The file is missing or cannot be opened, or the file system has no locks.
    pub fn take(path: &Path, place: u32) -> io::Result<Option<Self>> {
        let file = options().open(path)?;
        match command(&file, libc::F_OFD_SETLK, &mut request(libc::F_WRLCK, i64::from(place) + 1)) {
            Ok(()) => Ok(Some(Self(file))),
            Err(error) if matches!(error.raw_os_error(), Some(libc::EAGAIN | libc::EACCES)) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

fn options() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true).write(true).custom_flags(libc::O_NOFOLLOW | libc::O_CLOEXEC);
    options
}

/// Returns `true` if any process holds the [`Lock`] on a file. A missing file is not locked. If the lock
/// cannot be tested, for example because no descriptor is free, the file counts as locked.
pub fn is_held(path: &Path) -> bool {
    let file = match options().open(path) {
        Ok(file) => file,
        Err(error) => return error.kind() != io::ErrorKind::NotFound,
    };
    let mut asked = request(libc::F_WRLCK, 0);
    command(&file, libc::F_OFD_GETLK, &mut asked).is_err() || asked.l_type != libc::F_UNLCK as libc::c_short
}

/// Creates a request for one byte of a file, which need not exist.
fn request(kind: libc::c_int, byte: i64) -> libc::flock {
    // SAFETY: zero is valid for all fields of the plain structure; locks of open file descriptions require
    // process 0.
    let mut request: libc::flock = unsafe { core::mem::zeroed() };
    request.l_type = kind as libc::c_short;
    request.l_whence = libc::SEEK_SET as libc::c_short;
    request.l_start = byte as libc::off_t;
    request.l_len = 1;
    request
}

fn command(file: &File, command: libc::c_int, request: &mut libc::flock) -> io::Result<()> {
    // SAFETY: the descriptor is open, and the request outlives the call, which changes nothing else.
    let result = unsafe { libc::fcntl(file.as_raw_fd(), command, core::ptr::from_mut(request)) };
    if result == -1 { Err(io::Error::last_os_error()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lock_is_held_until_its_last_holder_drops_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        assert!(!is_held(&path), "there is no file yet");
        let first = Lock::hold(&path).unwrap();
        let second = Lock::hold(&path).unwrap();
        assert!(is_held(&path));
        drop(first);
        assert!(is_held(&path), "testing does not acquire it, and the second holds it");
        drop(second);
        assert!(!is_held(&path));
    }

    #[test]
    fn place_is_exclusive_and_independent_of_the_lock() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        assert!(Lock::take(&path, 0).is_err(), "there is no file yet");
        let _held = Lock::hold(&path).unwrap();
        let first = Lock::take(&path, 0).unwrap();
        assert!(first.is_some() && Lock::take(&path, 0).unwrap().is_none());
        assert!(Lock::take(&path, u32::MAX).unwrap().is_some(), "another place");
        drop(first);
        assert!(Lock::take(&path, 0).unwrap().is_some());
        assert!(is_held(&path));
    }

    #[test]
    fn symbolic_link_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("lock"), folder.path().join("link"));
        let _lock = Lock::hold(&path).unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(Lock::hold(&link).is_err());
    }
}
