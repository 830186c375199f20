//! Reader of MuJoCo's format, MJCF, as a [`Model`].
//!
//! A file is interpreted as in MuJoCo, or rejected with line and column. The tables of `schema` classify
//! every attribute as read, as without effect on a model, as ignored with a [`ModelWarning::Ignored`]
//! (springs, actuators, tendons), or as rejected if its value has an effect. `docs/src/mjcf.md` lists all
//! attributes.
//!
//! The parts of the reader are public, so that crates can read content that is not a robot, such as worlds.
//! First [`expand`] a text and call [`parse_document`]. Then read the [`Attributes`] and the [`Compiler`],
//! and finally the elements and [`Geoms`].
//!
//! Replicas and attachments are not supported. MuJoCo's function `mj_saveLastXML` writes an equivalent file
//! without them.

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

/// Parses MJCF `text`. `file` is the path of the text, which is used in messages and to find meshes.
///
/// A body has the same frame and name as in MuJoCo. A body with several joints becomes a chain: massless
/// bodies `NAME/JOINT`, followed by the body itself. Geoms that do not collide (`contype` and `conaffinity`
/// zero) are not collision shapes, but contribute to the inertia. The base floats if exactly one body of the
/// world moves and this body has a free joint.
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
