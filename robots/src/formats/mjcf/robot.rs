//! The robot of an MJCF file.

use crate::{LinkColours, Model, ModelWarning, Profile, Srdf};

/// A robot read from an MJCF text.
#[derive(Clone, Debug)]
pub struct MjcfRobot {
    /// The robot, with joints in MuJoCo's order.
    pub model: Model,
    /// Defects that did not prevent loading, and ignored elements.
    pub warnings: Vec<ModelWarning>,
    /// Pairs of bodies excluded by `<contact><exclude>` or by `contype` and `conaffinity`, as rules for a
    /// [`CollisionModel`](crate::CollisionModel).
    pub exclusions: Srdf,
    /// Poses from keyframes, and gains and undriven joints from actuators; `None` without keyframes and
    /// position actuators.
    pub profile: Option<Profile>,
    /// Colours of the model's shapes, from its geoms (`rgba`) or their materials.
    pub colours: LinkColours,
}
