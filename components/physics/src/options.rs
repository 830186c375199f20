//! Choices a user of the engine has.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the rapier engine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// When the contact solver moves the robot.
    pub contacts: Contacts,
    /// Integration steps of the robot per step while it touches nothing. One is enough at 1 kHz: the drives are
    /// implicit, so more only refine the integration itself.
    #[schemars(range(min = 1, max = 100))]
    pub substeps: usize,
    /// Integration steps, each with one sweep of the contact solver, per step while the contact solver runs. They are
    /// what contact costs, since each assembles and factors the mass matrix: a Panda pressing on a block takes about 36,
    /// 46 and 68 us a step with 1, 2 and 4 of them (`examples/step_cost.rs`). Two hold a grasp and keep well inside a
    /// millisecond; more follow fast impacts better.
    #[schemars(range(min = 1, max = 100))]
    pub contact_iterations: usize,
    /// Whether the robot's own links touch one another. Links that share a joint, links on one parent (two fingers),
    /// and links that start closer than a centimetre never do.
    pub self_collision: bool,
    /// Inertia of each drive's rotor seen at the joint (kg m2 or kg), added to what the model says.
    #[schemars(range(min = 0.0))]
    pub armature: f64,
    /// Friction coefficient of the robot's surface. That of a contact is the mean of both surfaces'.
    #[schemars(range(min = 0.0))]
    pub friction: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            contacts: Contacts::WhenNear,
            substeps: 1,
            contact_iterations: 2,
            self_collision: true,
            armature: 0.0,
            friction: 0.8,
        }
    }
}

/// When the contact solver moves the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Contacts {
    /// Only while some link is within a centimetre of something it could touch. Apart from that the joint-space
    /// integrator moves the robot: the same equations, several times cheaper, and without a heap allocation.
    #[default]
    WhenNear,
    /// Always: the robot is rapier's multibody at every step.
    Always,
}
