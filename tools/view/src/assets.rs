//! Files requested by viewers: the meshes of robots.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use motorium_robots::PackagePath;

/// Maximum size of a file that is sent, bytes.
const LONGEST: u64 = 64 * 1024 * 1024;
/// Extensions of the files that are sent: meshes, their materials and textures, descriptions of robots.
const KINDS: [&str; 12] =
    ["dae", "stl", "obj", "glb", "gltf", "mtl", "png", "jpg", "jpeg", "bin", "urdf", "xml"];

/// Search paths for files of the robots of a run.
#[derive(Debug, Clone, Default)]
pub(crate) struct Assets {
    packages: PackagePath,
    /// Robot files, next to which other files are searched.
    robots: Vec<PathBuf>,
    /// Texts without a file, by name.
    texts: BTreeMap<String, String>,
}

/// A file that cannot be sent.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum AssetError {
    #[error("`{uri}` is not a file of a robot, expected `package://PACKAGE/PATH` or `file://PATH` with one of the extensions {}", KINDS.join(", "))]
    Kind { uri: String },
    #[error("`{uri}` not found; searched in {}", searched(.tried))]
    Missing { uri: String, tried: Vec<PathBuf> },
    #[error("`{uri}` is outside of the robots' folders")]
    Outside { uri: String },
    #[error("`{uri}` cannot be sent: {reason}")]
    Read { uri: String, reason: String },
}

fn searched(tried: &[PathBuf]) -> String {
    match tried {
        [] => "no folder: set ROS_PACKAGE_PATH or `package_path` of the robot".to_string(),
        tried => tried.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", "),
    }
}

impl Assets {
    /// Creates assets from these package folders (in addition to the environment's), robot files, and texts
    /// by name.
    pub(crate) fn new(packages: Vec<PathBuf>, robots: Vec<PathBuf>, texts: BTreeMap<String, String>) -> Self {
        let mut path = PackagePath::from_env();
        path.folders.splice(0..0, packages);
        Self { packages: path, robots, texts }
    }

    /// Returns the content of a file.
    pub(crate) fn fetch(&self, uri: &str) -> Result<Vec<u8>, AssetError> {
        if let Some(text) = self.texts.get(uri) {
            return Ok(text.clone().into_bytes());
        }
        let kind = Path::new(uri).extension().and_then(|kind| kind.to_str()).unwrap_or_default();
        if !KINDS.contains(&kind.to_ascii_lowercase().as_str()) {
            return Err(AssetError::Kind { uri: uri.to_string() });
        }
        let mut tried = Vec::new();
        let places = self.robots.iter().map(|file| Some(file.as_path())).chain([None]);
        for place in places {
            match self.packages.resolve(uri, place) {
                Ok(found) => return self.read(uri, &found),
                Err(folders) => tried.extend(folders),
            }
        }
        tried.dedup();
        Err(AssetError::Missing { uri: uri.to_string(), tried })
    }

    /// Reads a file in a package folder, in the folder of a robot's file, or below the two folders above it.
    fn read(&self, uri: &str, path: &Path) -> Result<Vec<u8>, AssetError> {
        let failed =
            |reason: std::io::Error| AssetError::Read { uri: uri.to_string(), reason: reason.to_string() };
        let path = path.canonicalize().map_err(failed)?;
        let folders = self.packages.folders.iter().chain(&self.packages.prefixes).map(PathBuf::as_path);
        let beside = self.robots.iter().flat_map(|file| file.ancestors().skip(1).take(3));
        let is_inside = |folder: &Path| {
            folder.canonicalize().is_ok_and(|folder| folder != Path::new("/") && path.starts_with(folder))
        };
        if !folders.chain(beside).any(is_inside) {
            return Err(AssetError::Outside { uri: uri.to_string() });
        }
        let length = path.metadata().map_err(failed)?.len();
        if length > LONGEST {
            let reason = format!("it has {length} bytes, at most {LONGEST} are sent");
            return Err(AssetError::Read { uri: uri.to_string(), reason });
        }
        std::fs::read(&path).map_err(failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> (tempfile::TempDir, Assets) {
        let folder = tempfile::tempdir().unwrap();
        for (path, content) in
            [("arm/meshes/hand.stl", "solid"), ("arm/urdf/arm.urdf", "<robot/>"), ("secret.stl", "no")]
        {
            let path = folder.path().join("packages").join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, content).unwrap();
        }
        std::fs::write(folder.path().join("outside.stl"), "no").unwrap();
        let file = folder.path().join("packages/arm/urdf/arm.urdf");
        let texts = BTreeMap::from([("package://arm/0.obj".to_string(), "v 0 0 0".to_string())]);
        let assets = Assets { packages: PackagePath::default(), robots: vec![file], texts };
        (folder, assets)
    }

    #[test]
    fn mesh_is_found_by_package_and_next_to_its_robot() {
        let (_folder, assets) = robot();
        for uri in ["package://arm/meshes/hand.stl", "../meshes/hand.stl"] {
            assert_eq!(assets.fetch(uri).unwrap(), b"solid", "{uri}");
        }
        assert_eq!(assets.fetch("package://arm/0.obj").unwrap(), b"v 0 0 0", "one without a file");
    }

    #[test]
    fn nothing_outside_of_the_folders_of_the_robots_is_sent() {
        let (folder, assets) = robot();
        let absolute = format!("file://{}", folder.path().join("outside.stl").display());
        for uri in [absolute.as_str(), "../../../outside.stl", "package://arm/../../../outside.stl"] {
            let refused = assets.fetch(uri);
            assert!(
                matches!(refused, Err(AssetError::Outside { .. } | AssetError::Missing { .. })),
                "{uri}: {refused:?}"
            );
        }
        for uri in ["file:///etc/passwd", "package://arm/meshes/hand", "/root/.ssh/id_rsa"] {
            assert_eq!(assets.fetch(uri), Err(AssetError::Kind { uri: uri.to_string() }));
        }
    }

    #[test]
    fn missing_mesh_is_reported_with_searched_folders() {
        let (_folder, assets) = robot();
        let error = assets.fetch("package://leg/meshes/foot.stl").unwrap_err().to_string();
        assert!(error.contains("package://leg/meshes/foot.stl") && error.contains("arm/urdf"), "{error}");
    }
}
