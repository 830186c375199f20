//! The program of workers and guards.

use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Program of this process, even if its file was replaced or removed.
const OWN_PROGRAM: &str = "/proc/self/exe";

/// Program for workers and guards. If the file of this process was replaced, for example by an upgrade, the
/// old program is used, because another version may have a different shared memory layout.
pub(super) struct WorkerProgram {
    path: PathBuf,
    /// True if it is the program of this process.
    is_own: bool,
}

impl WorkerProgram {
    /// Creates the program at a path.
    pub(super) fn new(path: &Path) -> Self {
        Self { path: path.to_path_buf(), is_own: is_own(path) }
    }

    /// Returns the path to start it by.
    pub(super) fn path(&self) -> &Path {
        let is_replaced = self.is_own && !is_own(&self.path);
        if is_replaced { Path::new(OWN_PROGRAM) } else { &self.path }
    }
}

/// Returns `true` if a file is the program of this process.
fn is_own(program: &Path) -> bool {
    let same = |path: &Path| std::fs::metadata(path).ok().map(|file| (file.dev(), file.ino()));
    same(program).is_some_and(|file| Some(file) == same(Path::new(OWN_PROGRAM)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaced_file_is_not_the_own_program() {
        assert!(is_own(&std::env::current_exe().unwrap()));
        assert!(!is_own(Path::new("/bin/sh")) && !is_own(Path::new("/nowhere")));
    }
}
