//! Finding the files that `package://` and relative names mean.

use std::path::{Path, PathBuf};

/// Folders that packages are searched in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PackagePath {
    /// Folders that are packages or contain them (`ROS_PACKAGE_PATH`).
    pub folders: Vec<PathBuf>,
    /// Install prefixes, with packages in `share/` (`AMENT_PREFIX_PATH`).
    pub prefixes: Vec<PathBuf>,
}

impl PackagePath {
    /// As the environment variables `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH` say.
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

    /// The file `uri` means: `package://NAME/PATH`, `model://NAME/PATH`, `file://PATH` or a path relative to `file`,
    /// the URDF that names it. Packages are looked for in the folders, the prefixes, then among `file`'s ancestors.
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
        Err(tried)
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
        file.into_iter().flat_map(|file| file.ancestors().skip(1)).for_each(&mut offer);
        candidates
    }
}
