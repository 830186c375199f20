//! MuJoCo's format, a well-defined part of it, into a [`Model`].
//!
//! Read: `<compiler>` (angle, eulerseq, autolimits, inertiafromgeom, settotalmass, meshdir, assetdir), `<default>` classes of joints,
//! geoms and meshes, `<asset><mesh file>`, the tree of `<body>` and `<frame>` with `<inertial>`, `<joint>` (hinge, slide,
//! free), `<freejoint>`, `<geom>` (sphere, capsule, cylinder, box, mesh, and planes of the world), `<site>` as a frame,
//! `<contact><exclude>`, and `<equality><joint>` of first order as a mimic joint.
//!
//! Skipped, since no quantity here contains it: options, actuators, sensors, tendons, keyframes, cameras, lights, looks,
//! springs, `<contact><pair>`. Everything else is refused with its line and column rather than read wrongly: MuJoCo itself
//! writes a file without includes, replicas and attachments (`mj_saveLastXML`).

mod attributes;
mod bodies;
mod compiler;
mod equality;
mod error;
mod geoms;
mod joints;
mod pose;
mod sections;

use std::path::Path;

pub use error::{MjcfError, MjcfProblem};

use crate::{LoadOptions, Model, ModelWarning, Srdf};

/// An MJCF text turned into a model.
#[derive(Clone, Debug)]
pub struct MjcfRobot {
    /// The robot. Joints stand in MuJoCo's order.
    pub model: Model,
    /// Defects that did not keep it from loading.
    pub warnings: Vec<ModelWarning>,
    /// The pairs of bodies that `<contact><exclude>` names, as rules for a [`CollisionModel`](crate::CollisionModel).
    pub exclusions: Srdf,
}

/// Parses MJCF `text`. `file` is where it came from: for messages, and to find meshes beside it.
///
/// A body has the frame and the name it has in MuJoCo; a body with several joints becomes a chain of massless bodies
/// `NAME/JOINT`, the last of which is the body. Geoms that collide with nothing (`contype` and `conaffinity` zero) are no
/// collision shapes, but weigh what they weigh. The base floats when the one body that moves in the world has a free joint.
///
/// # Errors
///
/// [`MjcfError`], with the place in the text.
pub fn parse_mjcf(text: &str, file: Option<&Path>, options: &LoadOptions) -> Result<MjcfRobot, MjcfError> {
    bodies::build(text, file, options).map_err(|error| MjcfError { file: file.map(Path::to_owned), ..error })
}
