//! Settings, solutions and errors of inverse dynamics.

use nalgebra::{DVector, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::JointAccelerationLimits;
use super::names::Conflicting;
use crate::solver::{SolveError, UpdateError};

/// Settings of [`InverseDynamics`](super::InverseDynamics).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseDynamicsSettings {
    /// Acceleration of free fall in the world \[m/s2\]. Default (0, 0, -9.81).
    pub gravity: Vector3<f64>,
    /// Tikhonov regularisation: cost of any acceleration \[1/(rad/s2)^2\] and of any contact force \[1/N^2\]. Default 1e-7.
    pub damping: f64,
    /// Cost of a contact force \[1/N\] in every level: spreads the load over the contact points, and closes no motion to the levels
    /// below. Default 1e-3.
    pub force_weight: f64,
    /// Rate at which the velocity of a contact that slips decays \[1/s\]. Default 20.
    pub contact_damping: f64,
    /// Form of the friction of the contacts. Default a pyramid.
    pub friction_model: FrictionModel,
    /// Quantities that the problem decides. Default both accelerations and contact forces.
    pub unknowns: Unknowns,
    /// Limits of the joints.
    pub joints: JointAccelerationLimits,
    /// Share of the viscous damping of the joints, as the robot's file has it, that belongs to the bias: their drives then overcome
    /// it. Default 0: files often state a damping that no joint has.
    pub joint_damping: f64,
    /// Rate at which the room between a velocity and its [limit](super::InverseDynamics::add_row_limit) may be used up \[1/s\]; at most
    /// the tick rate is taken. Default 100.
    pub barrier_rate: f64,
    /// Fraction of the torque limits that may be used. Default 1.
    pub torque_fraction: f64,
    /// Weight with which contacts at rest and limits of the joints are kept where not all constraints can be: cost of an
    /// acceleration beyond them \[1/(m/s2) or 1/(rad/s2)\]. Equations of motion, torque limits and friction are never relaxed:
    /// they are what physics and drives can do, and always leave a solution. `None`: such a tick has no solution. Default 100.
    pub relaxation: Option<f64>,
    /// Largest number of iterations of all solvers in a tick together, the bound of its time. With a relaxation half of them are left to it;
    /// what is left after the first level is for the levels below. Default 500.
    pub max_iterations: u32,
}

impl Default for InverseDynamicsSettings {
    fn default() -> Self {
        Self {
            gravity: Vector3::new(0.0, 0.0, -9.81),
            damping: 1e-7,
            force_weight: 1e-3,
            contact_damping: 20.0,
            friction_model: FrictionModel::Pyramid,
            unknowns: Unknowns::AccelerationsAndForces,
            joints: JointAccelerationLimits::default(),
            joint_damping: 0.0,
            barrier_rate: 100.0,
            torque_fraction: 1.0,
            relaxation: Some(100.0),
            max_iterations: 500,
        }
    }
}

/// Quantities that a problem decides: the level at which it controls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Unknowns {
    /// Accelerations and contact forces: inverse dynamics, in which motions and forces depend on one another.
    #[default]
    AccelerationsAndForces,
    /// Accelerations of base and joints alone: contacts stay at rest, joints and velocities keep their limits, and nothing limits forces
    /// and torques. Contact forces for the accelerations that were decided are chosen after it, within friction, and the torques by the
    /// model: `tau = M_a a - J_a' f + h_a`.
    Accelerations,
    /// Contact forces alone, by which the base of a robot moves whose joints rest: `M_b a_b = J_b' f - h_b`. Friction, forces that only push,
    /// wrenches of soles and torque limits hold. A task on a motion of the body is a task on the forces; as a
    /// [constraint](super::InverseDynamics::constrain) it is an equality of the floating base. Torques are `tau = M_ab a_b - J_a' f + h_a`.
    Forces,
}

/// Form of Coulomb's friction `|f_t| <= mu f_n` in the problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrictionModel {
    /// Four faces inside the cone, `|f_x|, |f_y| <= mu / sqrt(2) f_n`: along the tangents it gives away 29 % of the friction,
    /// between them nothing. Solved by the active-set method.
    #[default]
    Pyramid,
    /// The cone itself, solved by Clarabel: all of the friction in every direction, at tens of times the time of a pyramid, and
    /// with one allocation a level and tick. Where constraints conflict and give way, it is a pyramid again.
    Cone,
}

/// A tick without a solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InverseDynamicsError {
    /// The state, a target or a setting is not a number, or limits cross.
    #[error("inverse dynamics cannot be posed: {0}")]
    Pose(#[from] UpdateError),
    /// The constraints contradict each other.
    #[error("no motion satisfies all constraints; relax one of those that conflict")]
    Infeasible(Conflicting),
    /// The solver found no solution.
    #[error("inverse dynamics has no solution: {0}")]
    Solve(SolveError),
}

/// Amounts by which a relaxed tick misses its constraints.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slack {
    /// Largest acceleration of a contact beyond the one it was to have \[m/s2 or rad/s2\].
    pub contact: f64,
    /// Largest acceleration of a joint beyond its limits \[rad/s2 or m/s2\].
    pub joint: f64,
    /// Largest acceleration beyond a limit of velocities \[m/s2 or rad/s2\].
    pub limit: f64,
    /// Largest residual of a task that is a constraint, in the units of its rows with their weights.
    pub task: f64,
    /// The constraints that conflict.
    pub conflict: Conflicting,
}

impl Slack {
    /// The larger amount of each, with the conflict of the first.
    pub(super) fn worse(&self, other: &Self) -> Self {
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
    /// Generalised accelerations, nv \[as `a` of [`motorium_robots`]\].
    pub acceleration: DVector<f64>,
    /// Torques of the drives, one per independent joint \[Nm or N\].
    pub torque: DVector<f64>,
    /// Contact forces: for each point of each contact two tangential components and the normal one \[N\].
    pub forces: DVector<f64>,
    /// Limits that were relaxed, if any had to be.
    pub slack: Option<Slack>,
    /// Iterations of all solvers in the tick, whatever it took: those of the first level, each time that it was solved, relaxed or not, and
    /// those of the levels below it.
    pub iterations: u32,
    /// Levels below the first that were left undecided, for their solver reached its limit: they move nothing.
    pub undecided: u32,
    /// Constraints with a force on the solution: torque limits, faces of friction pyramids, bounds.
    pub active: usize,
}
