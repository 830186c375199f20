//! Resolution of `package://` and relative file names.

use std::path::{Path, PathBuf};

/// Folders searched for packages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PackagePath {
    /// Folders that are packages or contain packages (`ROS_PACKAGE_PATH`).
    pub folders: Vec<PathBuf>,
    /// Install prefixes, with packages in `share/` (`AMENT_PREFIX_PATH`).
    pub prefixes: Vec<PathBuf>,
}

impl PackagePath {
    /// Reads the environment variables `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.
    pub fn from_env() -> Self {
        let read = |name| {
            std::env::var_os(name)
                .map(|value| {
                    std::env::split_paths(&value).filter(|path| !path.as_os_str().is_empty()).collect()
                })
                .unwrap_or_default()
        };
        Self { folders: read("ROS_PACKAGE_PATH"), prefixes: read("AMENT_PREFIX_PATH") }
    }

    /// Resolves `uri` to a path: `package://NAME/PATH`, `model://NAME/PATH`, `file://PATH`, or a path
    /// relative to `file`, the URDF that contains it. Packages are searched in the folders, the prefixes and
    /// the ancestors of `file`. If a robot was copied out of its package, the search continues in those
    /// ancestors of `file` that have the same name as a folder in `PATH`.
    ///
    /// # Errors
    ///
    /// The folders that were searched without success.
    pub fn resolve(&self, uri: &str, file: Option<&Path>) -> Result<PathBuf, Vec<PathBuf>> {
        let package = uri.strip_prefix("package://").or_else(|| uri.strip_prefix("model://"));
        let Some((name, path)) = package.map(|rest| rest.split_once('/').unwrap_or((rest, ""))) else {
            let path = Path::new(uri.strip_prefix("file://").unwrap_or(uri));
            let folder = file.and_then(Path::parent).unwrap_or(Path::new(""));
            let found = folder.join(path);
            return if found.is_file() { Ok(found) } else { Err(vec![folder.to_owned()]) };
        };
        let mut tried = Vec::new();
        for package in self.candidates(name, file) {
            let found = package.join(path);
            if found.is_file() {
                return Ok(found);
            }
            tried.push(package);
        }
        copied(path, file).ok_or(tried)
    }

    fn candidates(&self, name: &str, file: Option<&Path>) -> Vec<PathBuf> {
        let mut candidates = Vec::new();
        let mut offer = |folder: &Path| {
            if folder.file_name().is_some_and(|last| last == name) {
                candidates.push(folder.to_owned());
            }
            candidates.push(folder.join(name));
        };
        self.folders.iter().for_each(|folder| offer(folder));
        self.prefixes.iter().for_each(|prefix| offer(&prefix.join("share")));
        above(file).iter().for_each(|folder| offer(folder));
        candidates
    }
}

/// Returns the folders above a file, the nearest first.
fn above(file: Option<&Path>) -> Vec<PathBuf> {
    // A relative path does not contain the folders above the current one.
    let file = file.map(|file| std::path::absolute(file).unwrap_or_else(|_| file.to_owned()));
    file.iter().flat_map(|file| file.ancestors().skip(1)).map(Path::to_owned).collect()
}

/// Returns the file of a robot copied out of its package: in an ancestor of `file` with the name of a folder
/// in `path`.
fn copied(path: &str, file: Option<&Path>) -> Option<PathBuf> {
    let above = above(file);
    let parts: Vec<&str> = path.split('/').collect();
    let of_part = |(index, part): (usize, &&str)| {
        let rest: PathBuf = parts[index + 1..].iter().collect();
        let named = above.iter().filter(|folder| folder.file_name().is_some_and(|last| last == *part));
        named.map(|folder| folder.join(&rest)).find(|found| found.is_file())
    };
    parts.iter().enumerate().take(parts.len().saturating_sub(1)).find_map(of_part)
}
