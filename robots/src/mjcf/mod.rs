//! A reader of MuJoCo's format, MJCF, into a [`Model`].
//!
//! A file is read as MuJoCo reads it, or refused with line and column. The tables of `schema` say what becomes of every
//! attribute: it is read, has no effect on a model, is ignored with a [`ModelWarning::Ignored`] (springs, actuators,
//! tendons), or is refused where its value has an effect. `docs/src/mjcf.md` lists all of it.
//!
//! Not read: replicas and attachments. MuJoCo itself writes a file without them (`mj_saveLastXML`).

mod actuators;
mod attributes;
mod bodies;
mod build;
mod compiler;
mod contacts;
mod drives;
mod equality;
mod error;
mod free_bodies;
mod gains;
mod geoms;
mod height_fields;
mod held;
mod include;
mod joints;
mod keyframes;
mod looks;
mod masks;
mod pose;
mod schema;
mod sections;
mod world;

use std::path::Path;

pub use error::{MjcfError, MjcfProblem};
pub use world::{MjcfWorld, parse_mjcf_world};

use crate::{LinkColours, LoadOptions, Model, ModelWarning, Profile, Srdf};

/// An MJCF text turned into a model.
#[derive(Clone, Debug)]
pub struct MjcfRobot {
    /// The robot. Joints stand in MuJoCo's order.
    pub model: Model,
    /// Defects that did not keep it from loading, and what is ignored.
    pub warnings: Vec<ModelWarning>,
    /// The pairs of bodies that `<contact><exclude>` names or that `contype` and `conaffinity` rule out, as rules for a
    /// [`CollisionModel`](crate::CollisionModel).
    pub exclusions: Srdf,
    /// Poses from its keyframes, and gains and joints without a drive from its actuators; `None` where it has neither
    /// keyframes nor actuators that hold positions.
    pub profile: Option<Profile>,
    /// Colours of the shapes of the model, as its geoms (`rgba`) or their materials state them.
    pub colours: LinkColours,
}

/// Parses MJCF `text`. `file` is where it came from: for messages, and to find meshes beside it.
///
/// A body has the frame and the name it has in MuJoCo; a body with several joints becomes a chain of massless bodies
/// `NAME/JOINT`, the last of which is the body. Geoms that collide with nothing (`contype` and `conaffinity` zero) are
/// no collision shapes, but count in the inertia. The base floats when the one body that moves in the world has a free
/// joint.
///
/// # Errors
///
/// [`MjcfError`], with the place in the text.
pub fn parse_mjcf(text: &str, file: Option<&Path>, options: &LoadOptions) -> Result<MjcfRobot, MjcfError> {
    let expanded = include::expand(text, file)?;
    let mut robot = build::build(&expanded.text, file, options).map_err(|error| expanded.located(error))?;
    robot.warnings = robot.warnings.into_iter().map(|warning| expanded.located_warning(warning)).collect();
    Ok(robot)
}
