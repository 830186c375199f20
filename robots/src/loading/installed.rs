//! Installed robots. They are in the folder `$MOTORIUM_ROBOTS` or, if this variable is not set, in
//! `motorium/robots` in the user's data folder. Each subfolder is a collection, in which every `.urdf` file
//! is a robot.

use std::path::{Path, PathBuf};

/// A robot found in the folder of installed robots.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Installed {
    /// Name by which the robot is loaded: the name of its file without the extension.
    pub name: String,
    /// Collection to which the robot belongs. The robot can be loaded as `COLLECTION/NAME` or as `NAME`.
    pub collection: String,
    /// URDF file of the robot.
    pub urdf: PathBuf,
}

/// Returns the folder of installed robots: `$MOTORIUM_ROBOTS`, `$XDG_DATA_HOME/motorium/robots` or
/// `~/.local/share/motorium/robots`. `None` if neither these variables nor `HOME` are set.
pub fn installed_folder() -> Option<PathBuf> {
    let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    variable("MOTORIUM_ROBOTS").or_else(|| {
        let data = variable("XDG_DATA_HOME").or_else(|| Some(variable("HOME")?.join(".local/share")))?;
        Some(data.join("motorium/robots"))
    })
}

/// Returns all installed robots, sorted by name.
pub fn installed() -> Vec<Installed> {
    installed_folder().map(|folder| installed_in(&folder)).unwrap_or_default()
}

fn installed_in(folder: &Path) -> Vec<Installed> {
    let mut found = Vec::new();
    for collection in entries(folder).into_iter().filter(|path| path.is_dir()) {
        let name = text(collection.file_name());
        // An installation in progress unpacks into a hidden folder.
        if !name.starts_with('.') {
            search(&collection, &name, 0, &mut found);
        }
    }
    found.sort();
    found
}

/// Collects the `.urdf` files of a folder and its subfolders.
fn search(folder: &Path, collection: &str, depth: usize, found: &mut Vec<Installed>) {
    for path in entries(folder) {
        if path.extension().is_some_and(|extension| extension == "urdf") && path.is_file() {
            let (name, collection) = (text(path.file_stem()), collection.to_owned());
            found.push(Installed { name, collection, urdf: path });
        } else if depth < 8 && path.is_dir() && !path.ends_with("meshes") {
            search(&path, collection, depth + 1, found);
        }
    }
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    entries.filter_map(|entry| Some(entry.ok()?.path())).collect()
}

fn text(name: Option<&std::ffi::OsStr>) -> String {
    name.unwrap_or_default().to_string_lossy().into_owned()
}

/// Finds the installed robot `reference`: `NAME` or `COLLECTION/NAME`.
pub(crate) fn find<'a>(robots: &'a [Installed], reference: &str) -> Option<&'a Installed> {
    robots.iter().find(|robot| match reference.split_once('/') {
        Some((collection, name)) => robot.collection == collection && robot.name == name,
        None => robot.name == reference,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_are_found_by_name_anywhere_in_a_collection() {
        let folder = tempfile::tempdir().unwrap();
        for file in [
            "data/robots/leg/urdf/leg.urdf",
            "data/robots/arm.urdf",
            ".partial/robots/half.urdf",
            "other/arm.urdf",
        ] {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "<robot/>").unwrap();
        }
        let robots = installed_in(folder.path());
        let names: Vec<_> = robots.iter().map(|robot| robot.name.as_str()).collect();
        assert_eq!(names, ["arm", "arm", "leg"]);
        assert_eq!(find(&robots, "arm").unwrap().collection, "data");
        assert!(find(&robots, "other/arm").unwrap().urdf.ends_with("other/arm.urdf"));
        assert!(find(&robots, "half").is_none() && find(&robots, "data/foot").is_none());
    }
}
