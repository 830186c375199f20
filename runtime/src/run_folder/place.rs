//! Private folders for the runs of a user.

use std::fs;
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};

use super::error::{RunFolderError, io};

/// Returns the folder for new runs of this user: `$XDG_RUNTIME_DIR/motorium` if the system sets that
/// variable, else `/dev/shm/motorium-UID`. It is created if missing.
///
/// # Errors
/// The folder cannot be created, or others could access it.
pub(super) fn make() -> Result<PathBuf, RunFolderError> {
    let path = all().swap_remove(0);
    match fs::DirBuilder::new().mode(0o700).create(&path) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => return Err(io(&path)(error)),
        _ => close(&path),
    }
    check(&path)?;
    Ok(path)
}

/// Restricts access to a folder of this user that other users can read but not write. iceoryx2 creates such a
/// folder when a program joins the last run just as it ends. Other users cannot have created anything in it.
fn close(path: &Path) {
    let Ok(metadata) = fs::symlink_metadata(path) else { return };
    let is_own = metadata.is_dir() && metadata.uid() == rustix::process::getuid().as_raw();
    if is_own && metadata.mode() & 0o077 != 0 && metadata.mode() & 0o022 == 0 {
        // A folder that remains accessible is refused later.
        let _ = fs::set_permissions(path, fs::Permissions::from_mode(0o700));
    }
}

/// Returns all folders that may contain runs of this user, the folder for new runs first.
pub(super) fn all() -> Vec<PathBuf> {
    let user = rustix::process::getuid().as_raw();
    let named = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    // This finds the runs in a shell without the variable, too, such as with `sudo` or in a service.
    let usual = PathBuf::from(format!("/run/user/{}", outer(user)));
    let named_first = named.into_iter().map(|path| (path, true)).chain([(usual, false)]);
    let mut places: Vec<(PathBuf, bool)> = Vec::new();
    for (path, is_named) in named_first {
        let known = places.iter().any(|(other, _)| *other == path);
        if path.is_absolute() && !known && check(&path).is_ok() {
            places.push((path, is_named));
        }
    }
    let shared = PathBuf::from(format!("/dev/shm/motorium-{}", outer(user)));
    let (named, unnamed): (Vec<_>, Vec<_>) = places.into_iter().partition(|(_, is_named)| *is_named);
    let inside = |(path, _): (PathBuf, bool)| path.join("motorium");
    named.into_iter().map(inside).chain([shared]).chain(unnamed.into_iter().map(inside)).collect()
}

/// Returns the user id outside this user namespace, because shared memory is global.
fn outer(user: u32) -> u32 {
    mapped(user, &fs::read_to_string("/proc/self/uid_map").unwrap_or_default()).unwrap_or(user)
}

/// Maps an id to the outer one by the lines of a map: first inner id, first outer id, count.
fn mapped(user: u32, map: &str) -> Option<u32> {
    map.lines().find_map(|line| {
        let mut numbers = line.split_whitespace().map(|number| number.parse::<u32>().ok());
        let (inside, outside, count) = (numbers.next()??, numbers.next()??, numbers.next()??);
        let offset = user.checked_sub(inside).filter(|offset| *offset < count)?;
        outside.checked_add(offset)
    })
}

/// Checks that a path is a folder of this user, not a link, and inaccessible to others.
pub(super) fn check(path: &Path) -> Result<(), RunFolderError> {
    let metadata = fs::symlink_metadata(path).map_err(io(path))?;
    let user = rustix::process::getuid().as_raw();
    let refuse = |found: String, advice: String| {
        Err(RunFolderError::NotPrivate { path: path.to_path_buf(), found, advice })
    };
    if !metadata.is_dir() {
        let found = if metadata.is_symlink() { "a symbolic link" } else { "no folder" };
        return refuse(
            found.into(),
            format!("find out who created it, then remove it: `rm {}`", path.display()),
        );
    }
    if metadata.uid() != user {
        let advice = if is_mapped_elsewhere() {
            "this is a user namespace: set a separate folder, `XDG_RUNTIME_DIR=$(mktemp -d)`"
        } else {
            "another user may have created this folder to see or to stop your runs; ask this user or root to remove it, or set XDG_RUNTIME_DIR to a folder of your own with mode 700"
        };
        return refuse(format!("of user {}, not of {user}", metadata.uid()), advice.into());
    }
    if metadata.mode() & 0o077 != 0 {
        let found = format!("open to other users (mode {:o})", metadata.mode() & 0o7777);
        return refuse(
            found,
            format!("check that all of its content is yours, then `chmod 700 {}`", path.display()),
        );
    }
    Ok(())
}

/// Returns `true` if this process is in a separate user namespace.
fn is_mapped_elsewhere() -> bool {
    let map = fs::read_to_string("/proc/self/uid_map").unwrap_or_default();
    !map.is_empty() && map.split_whitespace().collect::<Vec<_>>() != ["0", "0", "4294967295"]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_inaccessible_own_folder_is_private() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("runs");
        fs::DirBuilder::new().mode(0o700).create(&folder).unwrap();
        assert!(check(&folder).is_ok());
        for mode in [0o777, 0o750, 0o701] {
            fs::set_permissions(&folder, fs::Permissions::from_mode(mode)).unwrap();
            let text = check(&folder).unwrap_err().to_string();
            assert!(text.contains("open to other users") && text.contains("chmod 700"), "{text}");
        }
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o700)).unwrap();
        let link = parent.path().join("link");
        std::os::unix::fs::symlink(&folder, &link).unwrap();
        let text = check(&link).unwrap_err().to_string();
        assert!(text.contains("a symbolic link"), "{text}");
        if rustix::process::getuid().is_root() {
            std::os::unix::fs::chown(&folder, Some(65534), Some(65534)).unwrap();
            let text = check(&folder).unwrap_err().to_string();
            assert!(text.contains("of user 65534, not of 0"), "{text}");
        }
    }

    #[test]
    fn readable_folder_is_restricted_writable_one_rejected() {
        let folder = tempfile::tempdir().unwrap();
        for (mode, closed) in [(0o755, true), (0o750, true), (0o777, false), (0o720, false)] {
            fs::set_permissions(folder.path(), fs::Permissions::from_mode(mode)).unwrap();
            close(folder.path());
            assert_eq!(check(folder.path()).is_ok(), closed, "{mode:o}");
        }
    }

    #[test]
    fn namespace_user_id_is_mapped_to_the_outer_id() {
        assert_eq!(mapped(1000, "         0          0 4294967295\n"), Some(1000));
        assert_eq!(mapped(0, "         0       1000          1\n"), Some(1000));
        assert_eq!(mapped(33, "0 1000 1\n1 100000 65536\n"), Some(100_032));
        assert_eq!(mapped(5, "0 1000 1\n"), None);
        assert_eq!(mapped(5, ""), None);
    }
}
