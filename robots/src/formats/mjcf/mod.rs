//! Reader of MuJoCo's format, MJCF, as a [`Model`].
//!
//! A file is interpreted as in MuJoCo, or rejected with line and column. The tables of `schema` classify
//! every attribute. It is read, has no effect on a model, is ignored with a [`ModelWarning::Ignored`]
//! (springs, actuators, tendons), or is rejected if its value has an effect. `docs/src/mjcf.md` lists all
//! attributes.
//!
//! The building blocks are public for readers of other content, such as worlds: [`expand`] a text,
//! [`parse_document`], read the [`Attributes`] and the [`Compiler`], then elements and [`Geoms`].
//!
//! Replicas and attachments are not supported. MuJoCo itself writes a file without them (`mj_saveLastXML`).

mod actuators;
mod attributes;
mod bodies;
mod build;
mod compiler;
mod document;
mod drives;
mod equality;
mod error;
mod gains;
mod geoms;
mod include;
mod joints;
mod keyframes;
mod masks;
mod pose;
mod robot;
mod schema;
mod sections;

use std::path::Path;

pub use attributes::{Attributes, Element, MAIN, named};
pub use bodies::{DEEPEST, body_name};
pub use compiler::Compiler;
pub use document::parse_document;
pub use error::{MjcfError, MjcfProblem};
pub use geoms::{Geom, Geoms, WATER};
pub use include::{Expanded, expand};
pub use pose::pose;
pub use robot::MjcfRobot;
pub use schema::{BODY, FRAME, FREEJOINT, GEOM, HELD, HFIELD, JOINT, OPTION, Schema, is_off};
pub use sections::read_assets;

use crate::LoadOptions;

/// Parses MJCF `text`. `file` is its path, which is used in messages and to find meshes.
///
/// A body has the same frame and name as in MuJoCo. A body with several joints becomes a chain of massless
/// bodies `NAME/JOINT`, the last of which is the body itself. Geoms that do not collide (`contype` and
/// `conaffinity` zero) are not collision shapes but contribute to the inertia. The base floats if the only
/// body that moves in the world has a free joint.
///
/// # Errors
///
/// [`MjcfError`] with the position in the text.
pub fn parse_mjcf(text: &str, file: Option<&Path>, options: &LoadOptions) -> Result<MjcfRobot, MjcfError> {
    let expanded = include::expand(text, file)?;
    let mut robot = build::build(&expanded.text, file, options).map_err(|error| expanded.located(error))?;
    robot.warnings = robot.warnings.into_iter().map(|warning| expanded.located_warning(warning)).collect();
    Ok(robot)
}
