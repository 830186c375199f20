//! The files of a new component crate.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::sources::Sources;
use crate::registry;

/// Path of a file in the crate and its text.
pub(super) type File = (&'static str, String);

/// Error of writing the files.
#[derive(Debug, thiserror::Error)]
pub(super) enum WriteError {
    #[error("`{}` already exists and was not changed; choose another name, or another folder with --path", .0.display())]
    Exists(PathBuf),
    #[error("the folder `{}` does not exist", .0.display())]
    NoParent(PathBuf),
    #[error("`{}` cannot be written: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
}

/// Returns all files of a crate of this name.
pub(super) fn files(name: &str, sources: Option<&Sources>) -> Vec<File> {
    let [dependency, testing] = [", default-features = false", ", features = [\"testing\"]"]
        .map(|features| dependency(sources, features));
    let fill = |template: &str| {
        template
            .replace("{{name}}", name)
            .replace("{{dependency}}", &dependency)
            .replace("{{testing_dependency}}", &testing)
    };
    let schema = motorium::graph::schema(&registry::registry());
    let mut files = vec![
        ("Cargo.toml", fill(include_str!("../../../templates/Cargo.toml.in"))),
        ("README.md", fill(include_str!("../../../templates/README.md.in"))),
        ("graph.toml", fill(include_str!("../../../templates/graph.toml.in"))),
        ("graph.schema.json", format!("{:#}\n", schema.as_value())),
        ("src/main.rs", include_str!("../../../templates/main.rs").to_string()),
        (".gitignore", include_str!("../../../templates/gitignore.in").to_string()),
    ];
    // Versions that the runtime was built and tested with; cargo drops unneeded ones.
    files.extend(sources.and_then(Sources::lock).map(|lock| ("Cargo.lock", lock)));
    files
}

/// Returns the dependency of the crate on motorium: local sources, or the published version of this program.
/// `features` is the rest of the table and selects the features.
fn dependency(sources: Option<&Sources>, features: &str) -> String {
    let version = env!("CARGO_PKG_VERSION");
    match sources {
        // A path as a TOML string: quoted and escaped as JSON is.
        Some(sources) => {
            let path = serde_json::Value::String(sources.runtime().to_string_lossy().into_owned());
            format!("{{ version = \"{version}\", path = {path}{features} }}")
        }
        None => format!("{{ version = \"={version}\"{features} }}"),
    }
}

/// Creates the crate's folder in `parent` and writes the files into it, without changing anything that
/// exists. If a file cannot be written, the files created so far are removed.
pub(super) fn write(parent: &Path, name: &str, files: &[File]) -> Result<PathBuf, WriteError> {
    let folder = parent.join(name);
    fs::create_dir(&folder).map_err(|source| match source.kind() {
        io::ErrorKind::AlreadyExists => WriteError::Exists(folder.clone()),
        io::ErrorKind::NotFound => WriteError::NoParent(parent.to_path_buf()),
        _ => WriteError::Io { path: folder.clone(), source },
    })?;
    for (file, text) in files {
        let path = folder.join(file);
        let written = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(&path, text));
        if let Err(source) = written {
            let _ = fs::remove_dir_all(&folder);
            return Err(WriteError::Io { path, source });
        }
    }
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_placeholder_is_left_in_any_file() {
        for sources in [None, Sources::find()] {
            for (name, text) in files("my-controller", sources.as_ref()) {
                assert!(!text.contains("{{"), "{name}");
            }
        }
    }

    #[test]
    fn published_version_is_requested_without_sources() {
        let made = files("my-controller", None);
        let manifest = &made.iter().find(|(name, _)| *name == "Cargo.toml").unwrap().1;
        assert!(
            manifest.contains(&format!(
                "motorium = {{ version = \"={}\", default-features = false }}",
                env!("CARGO_PKG_VERSION")
            )),
            "{manifest}"
        );
        assert!(made.iter().all(|(name, _)| *name != "Cargo.lock"));
    }

    #[test]
    fn existing_files_are_never_overwritten() {
        let parent = tempfile::tempdir().unwrap();
        let kept = parent.path().join("mine/Cargo.toml");
        fs::create_dir(parent.path().join("mine")).unwrap();
        fs::write(&kept, "mine").unwrap();
        let error = write(parent.path(), "mine", &[("Cargo.toml", "new".into())]).unwrap_err();
        assert!(matches!(error, WriteError::Exists(_)), "{error}");
        assert_eq!(fs::read_to_string(kept).unwrap(), "mine");
    }

    #[test]
    fn incomplete_crate_is_removed() {
        let parent = tempfile::tempdir().unwrap();
        let files = [("a", "text".to_string()), ("a/b", "below a file".to_string())];
        assert!(matches!(write(parent.path(), "half", &files), Err(WriteError::Io { .. })));
        assert!(!parent.path().join("half").exists());
        let missing = parent.path().join("nowhere");
        assert!(matches!(write(&missing, "x", &files), Err(WriteError::NoParent(_))));
    }
}
