//! Options of reading and loading a robot.

use std::path::PathBuf;

use crate::{FileFormat, PackagePath};

/// Treatment of the root link: fixed to the world or floating.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BaseMode {
    /// As in the robot's files: the root link floats if the profile specifies a floating base, or if the only
    /// joint that moves it has the type `floating`. Otherwise the root link is fixed to the world.
    #[default]
    AsFile,
    /// The root link floats.
    Floating,
    /// The root link is fixed to the world, regardless of the profile.
    Fixed,
}

/// Options of loading a robot.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Treatment of the root link.
    pub base: BaseMode,
    /// Treatment of mimic joints.
    pub mimic: MimicMode,
    /// Folders that are searched for packages before the folders in `ROS_PACKAGE_PATH` and
    /// `AMENT_PREFIX_PATH`.
    pub packages: PackagePath,
    /// Source of the profile.
    pub profile: ProfileChoice,
    /// Kind of shapes that the model contains: collision shapes or visible shapes.
    pub shapes: ShapeSource,
    /// Accepted format of the file.
    pub format: FileFormat,
}

/// Kind of shapes that a [`Model`](crate::Model) contains, of the kinds in a robot file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShapeSource {
    /// Collision shapes.
    #[default]
    Collision,
    /// Visible shapes, for rendering: the visuals of a URDF, or the geoms in the groups 0 to 2 of an MJCF
    /// file.
    Visual,
}

/// Source of a robot's profile.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ProfileChoice {
    /// The robot's own profile: the profile in the catalogue or, for a robot file, the `.toml` file of the
    /// same name in the same folder, if that file exists.
    #[default]
    Own,
    /// The profile in a file.
    File(PathBuf),
    /// No profile.
    Without,
}

/// Treatment of mimic joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MimicMode {
    /// Every mimic joint follows the joint that it mimics, as in the file.
    #[default]
    Follow,
    /// Every mimic joint is an independent joint with a separate coordinate.
    Independent,
}
