//! A robot as referenced by a graph file.

use std::path::{Path, PathBuf};

use crate::loading::load::RADIANS;
use crate::loading::settings::Settings;
use crate::{BasePose, FileFormat, LoadError, LoadOptions, Loaded, ModelWarning, ProfileChoice, load_with};

/// Reference to a robot in a graph file, with the settings of the graph.
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
    /// Reference to the robot as written in the graph: a catalogue name, a file or folder, or an installed
    /// robot; see [`load`](crate::load).
    pub text: &'a str,
    /// Folder to which paths in `text` are relative: the graph file's folder.
    pub base: &'a Path,
    /// Pose of the base in the world; `None` if the graph does not specify it.
    pub pose: Option<BasePose>,
    /// Path of the profile that the graph specifies; `None` for the robot's own profile.
    pub profile: Option<&'a Path>,
    /// Folders that are searched for packages before the folders in `ROS_PACKAGE_PATH` and
    /// `AMENT_PREFIX_PATH`.
    pub packages: &'a [PathBuf],
    /// Settings of the graph: the keys `mjcf` (true if the graph specifies the file as MJCF), `joints`,
    /// `fixed`, `frame`, `start` and `gains`. The keys `frame`, `start` and `gains` override the profile.
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

/// Error of loading a robot of a graph.
#[derive(Debug, thiserror::Error)]
#[error("robot `{name}`: {source}")]
pub struct RobotSourceError {
    /// Name of the robot in the graph.
    pub name: String,
    /// Cause.
    pub source: Box<LoadError>,
}

impl RobotSource<'_> {
    /// Loads the robot from its files, with the base at the pose that the graph specifies.
    ///
    /// # Errors
    ///
    /// [`RobotSourceError`] with the robot's name and the cause.
    pub fn load(&self) -> Result<Loaded, RobotSourceError> {
        self.load_with(&LoadOptions::default())
    }

    /// Loads the robot like [`load`](Self::load), with options such as the treatment of mimic joints.
    ///
    /// # Errors
    ///
    /// See [`load`](Self::load).
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
            loaded.warnings.extend(ModelWarning::of_angles("`rpy` of `base`", &pose.rpy, RADIANS, None));
            loaded.model = loaded.model.placed(&pose.isometry());
        }
        Ok(loaded)
    }
}
