//! Settings of the engines.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Integration method for bodies without contacts.
///
/// Either method falls back to Euler's for a body that is in contact, at a joint stop, pushed, or behind the
/// spring of a drivetrain. Drives are implicit with both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Semi-implicit Euler, of first order in the step.
    #[default]
    Euler,
    /// The midpoint rule, of second order in the step: energy drifts by a small fraction of Euler's drift,
    /// and free flight is exact. Forces are computed twice in a step of a robot.
    Midpoint,
}

/// Settings of an engine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// Integration steps per step of bodies outside `contact_iterations`, 1 to 100, default 1. One is enough
    /// at 1 kHz: the drives are implicit, so more only refine the integration. Rapier accepts only 1: it
    /// always uses `contact_iterations` steps.
    #[schemars(range(min = 1, max = 100))]
    pub substeps: usize,
    /// Integration steps per step of a robot within a centimetre of an object that moves or of another robot,
    /// and of all that touches it then, 1 to 100, default 2. Two hold a grasp; more follow fast impacts
    /// better, at the cost of as many solutions of the contact problem.
    #[schemars(range(min = 1, max = 100))]
    pub contact_iterations: usize,
    /// Contacts between links of the robot, default true. Links that share a joint or a parent, and links
    /// that start closer than a centimetre, never touch each other.
    pub self_collision: bool,
    /// Rotor inertia of each drive at the joint (kg m2 or kg), added to the model's; from 0, default 0.
    #[schemars(range(min = 0.0))]
    pub armature: f64,
    /// Friction coefficient of the robot's surface, from 0, default 0.8. A contact has the mean of both
    /// surfaces', unless one has a friction of 0 or a `friction_combine`.
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Restitution of the robot's surface: the share of the approach speed kept after an impact, 0 to 1,
    /// default 0. A contact has the mean of both surfaces'.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
    /// Objects at rest for half a second sleep with everything they touch, default true: their forces stay,
    /// at almost no cost, until something touches them or they are moved. Objects in rapier and MuJoCo never
    /// sleep.
    pub sleeping: bool,
    /// Method of integration of robots and objects that touch nothing: `euler`, of first order, the default,
    /// or `midpoint`, of second order. `physics.articulated` alone has a choice.
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
