//! Settings, solutions and errors of inverse dynamics.

use motorium_qp::{SolveError, UpdateError};
use nalgebra::{DVector, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::JointAccelerationLimits;
use crate::conflict::Conflicting;

with_defaults! {
    /// Settings of [`InverseDynamics`](super::InverseDynamics).
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct InverseDynamicsSettings;

    /// Gravitational acceleration in the world \[m/s2\]. Default (0, 0, -9.81).
    pub gravity: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
    /// Tikhonov regularisation: cost of any acceleration \[1/(rad/s2)^2\] and of any contact force \[1/N^2\].
    /// Default 1e-7.
    pub damping: f64 = 1e-7;
    /// Cost of a contact force \[1/N\] in every level. This cost spreads the load over the contact points and
    /// blocks no motion of lower levels. Default 1e-3.
    pub force_weight: f64 = 1e-3;
    /// Decay rate of the velocity of a slipping contact \[1/s\]. Default 20.
    pub contact_damping: f64 = 20.0;
    /// Friction model of the contacts. Default: a pyramid.
    pub friction_model: FrictionModel = FrictionModel::Pyramid;
    /// Quantities that the problem decides. Default: both accelerations and contact forces.
    pub unknowns: Unknowns = Unknowns::AccelerationsAndForces;
    /// Acceleration limits of the joints.
    pub joints: JointAccelerationLimits = JointAccelerationLimits::default();
    /// Fraction of the viscous joint damping in the robot's file that is included in the bias and compensated
    /// by the drives, 0 to 1. Default 0, because files often specify damping that the joint does not have.
    pub joint_damping: f64 = 0.0;
    /// Maximum decay rate of the margin between a velocity and its
    /// [limit](super::InverseDynamics::add_row_limit) \[1/s\]; limited to the tick rate. Default 100.
    pub barrier_rate: f64 = 100.0;
    /// Fraction of the torque limits that may be used. Default 1.
    pub torque_fraction: f64 = 1.0;
    /// Weight of contacts at rest and joint limits if constraints are contradictory: cost of violating them
    /// \[1/(m/s2) or 1/(rad/s2)\]. Equations of motion, torque limits and friction are physical constraints:
    /// they are never relaxed and always admit a solution. With `None`, a tick with contradictory constraints
    /// has no solution. Default 100.
    pub relaxation: Option<f64> = Some(100.0);
    /// Maximum total number of iterations in a tick, which bounds its duration. If relaxation is enabled,
    /// half of the iterations are reserved for it. The iterations that the first level does not use are
    /// available to lower levels. Default 500.
    pub max_iterations: u32 = 500;
}

/// The decision variables of a problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Unknowns {
    /// Accelerations and contact forces: inverse dynamics, which couples motions and forces.
    #[default]
    AccelerationsAndForces,
    /// Accelerations of base and joints only. Contacts stay at rest, and joints and velocities keep their
    /// limits; forces and torques are not limited. Contact forces within friction are then chosen for these
    /// accelerations, and torques are computed from the model: `tau = M_a a - J_a' f + h_a`.
    Accelerations,
    /// Contact forces only. The forces move the base of a robot whose joints rest: `M_b a_b = J_b' f - h_b`.
    /// Friction, unilateral forces, wrenches of soles and torque limits apply. A motion task of the body
    /// becomes a task on the forces; as a [constraint](super::InverseDynamics::constrain) it is an equality
    /// of the floating base. Torques are `tau = M_ab a_b - J_a' f + h_a`.
    Forces,
}

/// Form of the Coulomb friction constraint `|f_t| <= mu f_n` in the problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrictionModel {
    /// Four faces inscribed in the cone, `|f_x|, |f_y| <= mu / sqrt(2) f_n`. Compared with the cone, friction
    /// is 29 % smaller along the two tangents, and exact halfway between them. Solved by the active-set
    /// method.
    #[default]
    Pyramid,
    /// The exact cone, solved by Clarabel. Friction is exact in every direction, at tens of times the cost of
    /// a pyramid and with one allocation per level and tick. Relaxed ticks use a pyramid.
    Cone,
}

/// Error returned when a tick has no solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InverseDynamicsError {
    /// The state, a target or a setting is not finite, or a lower limit exceeds an upper limit.
    #[error("the inverse dynamics problem is invalid: {0}")]
    Pose(#[from] UpdateError),
    /// The constraints contradict each other.
    #[error("no motion satisfies all constraints; relax one of the conflicting constraints")]
    Infeasible(Conflicting),
    /// The solver found no solution.
    #[error("inverse dynamics has no solution: {0}")]
    Solve(SolveError),
}

/// Violations of the constraints in a relaxed tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slack {
    /// Largest violation of a contact's acceleration \[m/s2 or rad/s2\].
    pub contact: f64,
    /// Largest excess of a joint's acceleration over its limits \[rad/s2 or m/s2\].
    pub joint: f64,
    /// Largest excess of an acceleration over a bound derived from a velocity limit \[m/s2 or rad/s2\].
    pub limit: f64,
    /// Largest weighted residual of a constraint task, in the units of its rows.
    pub task: f64,
    /// The contradictory constraints.
    pub conflict: Conflicting,
}

impl Slack {
    /// Returns the larger violation of each kind, with the conflict of the first.
    pub(crate) fn worse(&self, other: &Self) -> Self {
        Self {
            contact: self.contact.max(other.contact),
            joint: self.joint.max(other.joint),
            limit: self.limit.max(other.limit),
            task: self.task.max(other.task),
            conflict: self.conflict,
        }
    }
}

/// Accelerations, torques and contact forces of one tick.
#[derive(Clone, Debug)]
pub struct InverseDynamicsSolution {
    /// Generalised accelerations, of length nv, in the convention of [`motorium_robots`].
    pub acceleration: DVector<f64>,
    /// Torques of the drives, one per independent joint \[Nm or N\].
    pub torque: DVector<f64>,
    /// Contact forces: for each point of each contact, two tangential components and the normal component
    /// \[N\].
    pub forces: DVector<f64>,
    /// Violations of relaxed constraints; `None` if nothing was relaxed.
    pub slack: Option<Slack>,
    /// Total number of iterations in the tick: all solutions of the first level, relaxed or not, and of the
    /// levels below.
    pub iterations: u32,
    /// Number of levels below the first that were left undecided because their solver reached its iteration
    /// limit. Undecided levels cause no motion.
    pub undecided: u32,
    /// Number of constraints that are active at the solution: torque limits, faces of friction pyramids,
    /// bounds.
    pub active: usize,
}
