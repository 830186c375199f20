//! Settings of the engines.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Integration method for the motion of robots and objects without contacts.
///
/// With either method, a robot or object that is in contact, at a joint stop, pushed, or driven through the
/// spring of a drivetrain uses Euler's method in that step. Drives are always implicit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Semi-implicit Euler, first order in the step length.
    #[default]
    Euler,
    /// Midpoint rule, second order in the step length. The energy drift is a small fraction of the drift of
    /// Euler's method, and free flight is exact. The forces of a robot are computed twice per step.
    Midpoint,
}

/// Settings of an engine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// Number of integration steps per simulation step, 1 to 100, default 1, for robots and objects to which
    /// `contact_iterations` does not apply. One is enough at 1 kHz: drives are implicit, so a larger number
    /// only refines the integration. Rapier accepts only 1, because it always runs `contact_iterations`
    /// integration steps.
    #[schemars(range(min = 1, max = 100))]
    pub substeps: usize,
    /// Number of integration steps per simulation step, 1 to 100, default 2, for a robot within a centimetre
    /// of a movable object or another robot, and for everything that touches such a robot. Two are enough to
    /// hold a grasp. A larger number resolves fast impacts better, but every integration step solves the
    /// contact problem.
    #[schemars(range(min = 1, max = 100))]
    pub contact_iterations: usize,
    /// `true` if links of the robot can touch each other, default true. Links that share a joint or a parent
    /// never touch each other, nor do links that start within a centimetre of each other.
    pub self_collision: bool,
    /// Rotor inertia of each drive reflected to the joint (kg m2 or kg), from 0, default 0. This inertia is
    /// added to the armature in the robot's model.
    #[schemars(range(min = 0.0))]
    pub armature: f64,
    /// Friction coefficient of the robot's surface, from 0, default 0.8. A contact uses the mean value of
    /// both surfaces, unless one surface has a friction of 0 or a `friction_combine`.
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Restitution of the robot's surface: the fraction of the approach speed kept after an impact, 0 to 1,
    /// default 0. A contact uses the mean value of both surfaces.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
    /// `true` if objects that have been at rest for half a second sleep together with everything they touch,
    /// default true. The contact forces on sleeping objects persist, and their simulation costs almost no
    /// time until something touches or moves them. Objects in rapier and MuJoCo never sleep.
    pub sleeping: bool,
    /// Integration method for robots and objects without contacts: `euler` (first order, the default) or
    /// `midpoint` (second order). Only `physics.articulated` supports `midpoint`.
    pub integrator: Integrator,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            substeps: 1,
            contact_iterations: 2,
            self_collision: true,
            armature: 0.0,
            friction: 0.8,
            restitution: 0.0,
            sleeping: true,
            integrator: Integrator::Euler,
        }
    }
}
