//! A robot as referenced by a graph file.

use std::path::{Path, PathBuf};

use crate::loading::settings::Settings;
use crate::{BasePose, FileFormat, LoadError, LoadOptions, Loaded, ProfileChoice, load_with};

/// A robot reference of a graph file.
///
/// ```
/// # use std::path::Path;
/// use motorium_robots::RobotSource;
///
/// let arm = RobotSource { name: "arm", text: "panda", base: Path::new("."), ..RobotSource::default() };
/// assert_eq!(arm.load().unwrap().model.nv(), 8);
///
/// let wrong = RobotSource { text: "pnada", ..arm };
/// assert!(wrong.load().unwrap_err().to_string().starts_with("robot `arm`: "));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotSource<'a> {
    /// Name of the robot in the graph.
    pub name: &'a str,
    /// A catalogue name, a file or folder, or an installed robot; see [`load`](crate::load).
    pub text: &'a str,
    /// Folder for relative paths in `text`: the graph file's folder.
    pub base: &'a Path,
    /// Pose of the base in the world, if given in the graph.
    pub pose: Option<BasePose>,
    /// Profile specified by the graph, if any; otherwise the robot's own profile is used.
    pub profile: Option<&'a Path>,
    /// Folders searched for packages before all others.
    pub packages: &'a [PathBuf],
    /// Table with the graph's keys `mjcf` (true if the graph uses this key for the file), `joints`, `fixed`,
    /// `frame`, `start` and `gains`. The last three override the profile.
    pub settings: Option<&'a serde_json::Value>,
}

impl Default for RobotSource<'_> {
    fn default() -> Self {
        Self {
            name: "",
            text: "",
            base: Path::new(""),
            pose: None,
            profile: None,
            packages: &[],
            settings: None,
        }
    }
}

/// A robot in a graph cannot be loaded.
#[derive(Debug, thiserror::Error)]
#[error("robot `{name}`: {source}")]
pub struct RobotSourceError {
    /// Name of the robot in the graph.
    pub name: String,
    /// Cause.
    pub source: Box<LoadError>,
}

impl RobotSource<'_> {
    /// Loads the robot from its files, with its base at the pose in the graph.
    ///
    /// # Errors
    ///
    /// [`RobotSourceError`], with the robot and the cause.
    pub fn load(&self) -> Result<Loaded, RobotSourceError> {
        self.load_with(&LoadOptions::default())
    }

    /// Loads the robot with options.
    ///
    /// # Errors
    ///
    /// Same as [`load`](Self::load).
    pub fn load_with(&self, options: &LoadOptions) -> Result<Loaded, RobotSourceError> {
        let mut options = options.clone();
        options.packages.folders.splice(0..0, self.packages.iter().cloned());
        if let Some(profile) = self.profile {
            options.profile = ProfileChoice::File(profile.to_path_buf());
        }
        if self.settings.is_some_and(|settings| settings["mjcf"] == true) {
            options.format = FileFormat::Mjcf;
        }
        let refused = |source| RobotSourceError { name: self.name.to_owned(), source: Box::new(source) };
        let mut loaded = load_with(self.text, self.base, &options).map_err(refused)?;
        if let Some(settings) = self.settings {
            let applied = Settings::read(settings).and_then(|settings| settings.apply(&mut loaded));
            applied.map_err(|error| refused(error.into()))?;
        }
        if let Some(pose) = self.pose {
            loaded.model = loaded.model.placed(&pose.isometry());
        }
        Ok(loaded)
    }
}
