//! The checkout of motorium that this program was built from, if it is still there.

use std::path::{Path, PathBuf};

/// A checkout of motorium.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Checkout {
    root: PathBuf,
}

impl Checkout {
    /// The checkout around this program's file, else the one it was built in.
    pub(super) fn find() -> Option<Self> {
        let program = std::env::current_exe().and_then(|path| path.canonicalize()).ok();
        let around = program.iter().flat_map(|path| path.ancestors().skip(1));
        let built = Path::new(env!("CARGO_MANIFEST_DIR")).parent();
        around.chain(built).find_map(Self::at)
    }

    /// The checkout at this folder, if it is one of this version.
    fn at(root: &Path) -> Option<Self> {
        let manifest = std::fs::read_to_string(root.join("runtime/Cargo.toml")).ok()?;
        let workspace = std::fs::read_to_string(root.join("Cargo.toml")).ok()?;
        let has = |text: &str, line: &str| text.lines().any(|found| found.trim() == line);
        let version = format!("version = \"{}\"", env!("CARGO_PKG_VERSION"));
        (has(&manifest, "name = \"motorium\"") && has(&workspace, &version))
            .then(|| Self { root: root.to_path_buf() })
    }

    /// The folder of the runtime crate.
    pub(super) fn runtime(&self) -> PathBuf {
        self.root.join("runtime")
    }

    /// The exact versions of everything it depends on.
    pub(super) fn lock(&self) -> Option<String> {
        std::fs::read_to_string(self.root.join("Cargo.lock")).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checkout_of_these_tests_is_found_with_its_runtime() {
        let checkout = Checkout::find().expect("these tests run in a checkout");
        assert!(checkout.runtime().join("src/lib.rs").is_file());
    }

    #[test]
    fn another_project_with_a_runtime_is_not_taken_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        write("Cargo.toml", "[workspace.package]\nversion = \"0.0.1\"\n");
        write("runtime/Cargo.toml", "[package]\nname = \"motorium\"\n");
        assert_eq!(Checkout::at(folder.path()), None, "another version");
        let version = env!("CARGO_PKG_VERSION");
        write("Cargo.toml", &format!("[workspace.package]\nversion = \"{version}\"\n"));
        assert!(Checkout::at(folder.path()).is_some());
        write("runtime/Cargo.toml", "[package]\nname = \"other\"\n");
        assert_eq!(Checkout::at(folder.path()), None, "another crate");
    }
}
