//! Conversion of URDF text to a [`Model`].

mod assemble;
mod colours;
mod doubts;
mod error;
mod hold;
mod inertia;
mod joints;
mod mimic;
mod named;
mod pinocchio;
mod plausibility;
mod robot;
mod simplified;
mod source;
mod structure;
mod transmission;
mod warning;
mod write;

use std::path::Path;

pub(crate) use hold::hold_joints;
pub(crate) use inertia::{check_inertia, warn_of_massless_ends};
pub(crate) use joints::has_many_turns;
pub(crate) use plausibility::{LONGEST, extent, warn_of_model};

pub use error::{UrdfError, UrdfProblem};
pub use pinocchio::pinocchio_joint_order;
pub use robot::UrdfRobot;
pub use warning::ModelWarning;
pub(crate) use write::write;
pub use write::{DrawnRobot, draw_as_urdf};

use crate::{LoadOptions, MimicMode, PackagePath};

/// Parses URDF `text`. `file` is the path of the text, which is used in messages and to find meshes.
///
/// The parser reads links, joints with their safety controllers, inertias, collision geometry, and the
/// reduction and rotor inertia of transmissions. Visuals, materials and the extension elements of simulators
/// are skipped.
///
/// # Errors
///
/// [`UrdfError`] with the position in the text. Common defects of real files, such as impossible inertias,
/// are warnings.
pub fn parse_urdf(
    text: &str,
    file: Option<&Path>,
    mimic: MimicMode,
    packages: &PackagePath,
) -> Result<UrdfRobot, UrdfError> {
    parse_urdf_with(text, file, &LoadOptions { mimic, packages: packages.clone(), ..LoadOptions::default() })
}

/// Parses URDF `text` like [`parse_urdf`], but with the options in `options`.
///
/// # Errors
///
/// See [`parse_urdf`].
pub fn parse_urdf_with(
    text: &str,
    file: Option<&Path>,
    options: &LoadOptions,
) -> Result<UrdfRobot, UrdfError> {
    assemble::assemble(text, file, options)
        .map_err(|error| UrdfError { file: file.map(Path::to_owned), ..error })
}
