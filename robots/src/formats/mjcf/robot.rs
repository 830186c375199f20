//! The robot of an MJCF file.

use crate::{LinkColours, Model, ModelWarning, Profile, Srdf};

/// A robot read from an MJCF text.
#[derive(Clone, Debug)]
pub struct MjcfRobot {
    /// Model of the robot, with joints in MuJoCo's order.
    pub model: Model,
    /// Warnings about defects that did not prevent loading, and about ignored elements.
    pub warnings: Vec<ModelWarning>,
    /// Pairs of bodies that cannot collide because of `<contact><exclude>`, `contype` or `conaffinity`, as
    /// rules for a [`CollisionModel`](crate::CollisionModel).
    pub exclusions: Srdf,
    /// Profile of the robot: poses from the file's keyframes, and gains and undriven joints from its
    /// actuators. `None` if the file has neither keyframes nor position actuators.
    pub profile: Option<Profile>,
    /// Colours of the model's shapes, from the `rgba` of its geoms or their materials.
    pub colours: LinkColours,
}
