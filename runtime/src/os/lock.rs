//! Locks on files that end with the process that holds them.

#![allow(unsafe_code)] // locks of open file descriptions have no safe wrapper that can also ask for their holders

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;

/// A shared lock on a file, held until it is dropped or its process ends, however it ends.
///
/// Any number of processes may hold it, in any namespace; [`is_held`] asks for it without taking it, so that asking
/// disturbs no one.
#[derive(Debug)]
pub struct Lock(#[expect(dead_code, reason = "the open file holds the lock")] File);

impl Lock {
    /// Takes the lock on a file, which is made if it is not there: readable and writable by its owner alone.
    ///
    /// # Errors
    /// The file cannot be made or opened, or the file system knows no locks.
    pub fn hold(path: &Path) -> io::Result<Self> {
        let flags = libc::O_NOFOLLOW | libc::O_CLOEXEC;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .custom_flags(flags)
            .open(path)?;
        command(&file, libc::F_OFD_SETLK, &mut request(libc::F_RDLCK))?;
        Ok(Self(file))
    }
}

/// Whether any process holds the [`Lock`] on a file. A file that is not there is not locked; one that cannot be asked,
/// for want of descriptors say, is taken for locked.
pub fn is_held(path: &Path) -> bool {
    let flags = libc::O_NOFOLLOW | libc::O_CLOEXEC;
    let file = match OpenOptions::new().read(true).write(true).custom_flags(flags).open(path) {
        Ok(file) => file,
        Err(error) => return error.kind() != io::ErrorKind::NotFound,
    };
    let mut asked = request(libc::F_WRLCK);
    command(&file, libc::F_OFD_GETLK, &mut asked).is_err() || asked.l_type != libc::F_UNLCK as libc::c_short
}

/// A request for the whole file.
fn request(kind: libc::c_int) -> libc::flock {
    // SAFETY: zero is a valid value of all fields of the plain structure; length 0 is the whole file, process 0 is what
    // locks of open file descriptions ask for.
    let mut request: libc::flock = unsafe { core::mem::zeroed() };
    request.l_type = kind as libc::c_short;
    request.l_whence = libc::SEEK_SET as libc::c_short;
    request
}

fn command(file: &File, command: libc::c_int, request: &mut libc::flock) -> io::Result<()> {
    // SAFETY: the descriptor is open, the request lives throughout the call, which changes nothing else.
    let result = unsafe { libc::fcntl(file.as_raw_fd(), command, core::ptr::from_mut(request)) };
    if result == -1 { Err(io::Error::last_os_error()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_held_until_the_last_of_its_holders_drops_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        assert!(!is_held(&path), "there is no file yet");
        let first = Lock::hold(&path).unwrap();
        let second = Lock::hold(&path).unwrap();
        assert!(is_held(&path));
        drop(first);
        assert!(is_held(&path), "asking has not taken it, and the second holds it");
        drop(second);
        assert!(!is_held(&path));
    }

    #[test]
    fn a_link_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("lock"), folder.path().join("link"));
        let _lock = Lock::hold(&path).unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(Lock::hold(&link).is_err());
    }
}
