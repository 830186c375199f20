//! Reader for MuJoCo's format, MJCF, that creates a [`Model`].
//!
//! A file is interpreted as in MuJoCo, or rejected with line and column. The tables of `schema` classify
//! every attribute: it is read, has no effect on a model, is ignored with a [`ModelWarning::Ignored`]
//! (springs, actuators, tendons), or is rejected if its value has an effect. `docs/src/mjcf.md` lists all of
//! them.
//!
//! Not read: replicas and attachments. MuJoCo itself writes a file without them (`mj_saveLastXML`).

mod actuators;
pub(crate) mod attributes;
pub(crate) mod bodies;
pub(crate) mod build;
pub(crate) mod compiler;
mod drives;
mod equality;
pub(crate) mod error;
mod gains;
pub(crate) mod geoms;
pub(crate) mod height_fields;
pub(crate) mod include;
mod joints;
mod keyframes;
pub(crate) mod looks;
pub(crate) mod masks;
pub(crate) mod pose;
mod robot;
pub(crate) mod schema;
pub(crate) mod sections;

use std::path::Path;

pub use error::{MjcfError, MjcfProblem};
pub use robot::MjcfRobot;

use crate::LoadOptions;

/// Parses MJCF `text`. `file` is its path, for messages and to find meshes next to it.
///
/// A body has the frame and the name it has in MuJoCo; a body with several joints becomes a chain of massless
/// bodies `NAME/JOINT`, the last of which is the body. Geoms that collide with nothing (`contype` and
/// `conaffinity` zero) are not collision shapes but contribute to the inertia. The base floats when the one
/// body that moves in the world has a free joint.
///
/// # Errors
///
/// [`MjcfError`], with the position in the text.
pub fn parse_mjcf(text: &str, file: Option<&Path>, options: &LoadOptions) -> Result<MjcfRobot, MjcfError> {
    let expanded = include::expand(text, file)?;
    let mut robot = build::build(&expanded.text, file, options).map_err(|error| expanded.located(error))?;
    robot.warnings = robot.warnings.into_iter().map(|warning| expanded.located_warning(warning)).collect();
    Ok(robot)
}
