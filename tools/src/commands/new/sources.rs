//! Sources of the crate `motorium` for new components.

use std::path::{Path, PathBuf};

/// Sources of the crate `motorium` in the version of this program: in a checkout, or next to an installed
/// program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Sources {
    runtime: PathBuf,
    lock: PathBuf,
}

impl Sources {
    /// Finds the sources around this program's file, in a checkout or a release archive, or else the checkout
    /// in which it was built.
    pub(super) fn find() -> Option<Self> {
        let program = std::env::current_exe().and_then(|path| path.canonicalize()).ok();
        let around = program.iter().flat_map(|path| path.ancestors().skip(1));
        let built = Path::new(env!("CARGO_MANIFEST_DIR")).parent();
        around.chain(built).find_map(Self::in_folder)
    }

    /// Returns the sources below this folder if their version matches.
    fn in_folder(root: &Path) -> Option<Self> {
        Self::checkout(root).or_else(|| Self::installed(root))
    }

    /// Returns a checkout: `runtime`, with the version in the workspace around it.
    fn checkout(root: &Path) -> Option<Self> {
        let runtime = root.join("runtime");
        (names_the_crate(&runtime) && names_the_version(root))
            .then(|| Self { runtime, lock: root.join("Cargo.lock") })
    }

    /// Returns the location in a release archive, below the parent of `bin`: the crate as published.
    fn installed(prefix: &Path) -> Option<Self> {
        let runtime = prefix.join("share/motorium/runtime");
        (names_the_crate(&runtime) && names_the_version(&runtime))
            .then(|| Self { lock: runtime.join("Cargo.lock"), runtime })
    }

    /// Returns the folder of the crate.
    pub(super) fn runtime(&self) -> &Path {
        &self.runtime
    }

    /// Returns the exact versions of all its dependencies.
    pub(super) fn lock(&self) -> Option<String> {
        std::fs::read_to_string(&self.lock).ok()
    }
}

/// Returns `true` if the manifest in this folder contains this line.
fn has_line(folder: &Path, line: &str) -> bool {
    std::fs::read_to_string(folder.join("Cargo.toml"))
        .is_ok_and(|text| text.lines().any(|found| found.trim() == line))
}

fn names_the_crate(folder: &Path) -> bool {
    has_line(folder, "name = \"motorium\"")
}

fn names_the_version(folder: &Path) -> bool {
    has_line(folder, &format!("version = \"{}\"", env!("CARGO_PKG_VERSION")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(folder: &Path, name: &str, text: &str) {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }

    #[test]
    fn the_checkout_of_these_tests_is_found_with_its_runtime() {
        let sources = Sources::find().expect("these tests run in a checkout");
        assert!(sources.runtime().join("src/lib.rs").is_file());
    }

    #[test]
    fn another_project_with_a_runtime_is_not_confused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| write(folder.path(), name, text);
        write("Cargo.toml", "[workspace.package]\nversion = \"0.0.1\"\n");
        write("runtime/Cargo.toml", "[package]\nname = \"motorium\"\n");
        assert_eq!(Sources::in_folder(folder.path()), None, "another version");
        let version = env!("CARGO_PKG_VERSION");
        write("Cargo.toml", &format!("[workspace.package]\nversion = \"{version}\"\n"));
        assert!(Sources::in_folder(folder.path()).is_some());
        write("runtime/Cargo.toml", "[package]\nname = \"other\"\n");
        assert_eq!(Sources::in_folder(folder.path()), None, "another crate");
    }

    #[test]
    fn unpacked_archive_contains_the_crate_and_its_versions() {
        let prefix = tempfile::tempdir().unwrap();
        let manifest = |version: &str| format!("[package]\nname = \"motorium\"\nversion = \"{version}\"\n");
        write(prefix.path(), "share/motorium/runtime/Cargo.toml", &manifest("0.0.1"));
        assert_eq!(Sources::in_folder(prefix.path()), None, "another version");
        write(prefix.path(), "share/motorium/runtime/Cargo.toml", &manifest(env!("CARGO_PKG_VERSION")));
        write(prefix.path(), "share/motorium/runtime/Cargo.lock", "version = 4\n");
        let sources = Sources::in_folder(prefix.path()).expect("found");
        assert_eq!(sources.runtime(), prefix.path().join("share/motorium/runtime"));
        assert_eq!(sources.lock().as_deref(), Some("version = 4\n"));
    }
}
