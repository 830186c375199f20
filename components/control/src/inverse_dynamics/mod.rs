//! Whole-body inverse dynamics: tasks at acceleration level, contacts and torque limits, for fixed-base and
//! floating-base robots.
//!
//! Each control tick is one quadratic program in the generalised accelerations `a` and the contact forces
//! `f`:
//!
//! ```text
//! minimise   sum_tasks 1/2 |W (A x - b)|^2 + 1/2 damping |x|^2 + 1/2 force_weight^2 |f|^2,   x = (a, f)
//! subject to M_u a - J_u' f = -h_u                             the rows without a drive: a floating base
//!            J_c a = -drift_c - kd v_c                         contacts stay where they are
//!            tau_min <= M_a a - J_a' f + h_a <= tau_max        torques of the drives
//!            |f_t| <= mu / sqrt(2) f_n,   0 <= f_n <= f_max    friction pyramid, unilateral contact
//!            a_min <= a <= a_max                               position and velocity limits of the joints
//!            G a <= rate (upper - G v)                         limits of velocities, in control-barrier form
//!            C w <= 0                                          limits of the whole wrench w of a sole
//! ```
//!
//! with the mass matrix `M`, the bias `h = C(q, v) v + g(q)`, and the Jacobian `J` of the contact points. The
//! torques `tau = M_a a - J_a' f + h_a` are eliminated and computed from the solution. The default friction
//! pyramid is inscribed in Coulomb's cone; [`FrictionModel::Cone`] selects the exact cone.
//!
//! - [Tasks](crate::tasks) are costs on `a` or `f`, with weights or in [levels](InverseDynamics::levels).
//! - [`Contact`] is a point, a ball or a sole on the ground.
//! - [`WrenchCone`] limits the total wrench of a sole: normal force, friction, centre of pressure, yaw
//!   torque.
//! - [Limits of velocities](InverseDynamics::add_row_limit) are second-order barriers. A
//!   [task](InverseDynamics::constrain) can be a constraint.
//! - [`JointAccelerationLimits`] convert position and velocity limits to acceleration bounds.
//! - [`Unknowns`] selects accelerations and forces, accelerations only, or forces only.
//! - [`InverseDynamics`] assembles and solves. If the constraints are infeasible, it returns the conflicting
//!   constraints as [`ConstraintName`], and can [relax](InverseDynamicsSettings::relaxation) constraints that
//!   are not physical laws.
//!
//! Del Prete, Mansard, Ramos, Stasse and Nori, *Implementing torque control with high-ratio gear boxes and
//! without joint-torque sensors*, 2016 (the formulation in `(a, f)`); Wieber, Tedrake and Kuindersma,
//! *Modeling and control of legged robots*, 2016.
//!
//! # Example
//!
//! A humanoid standing on two soles:
//!
//! ```
//! use motorium_control::inverse_dynamics::{
//!     Contact, InverseDynamics, MotionState,
//! };
//! use motorium_control::tasks::{CentreOfMassSettings, CentreOfMassTask, PostureSettings, PostureTask};
//! use motorium_robots::{Kinematics, load};
//!
//! let robot = load("humanoid", std::path::Path::new("."))?;
//! let (model, profile) = (&robot.model, robot.profile.as_ref().expect("a catalogue robot has a profile"));
//! let mut q = model.neutral();
//! q[..3].copy_from_slice(&profile.base_poses["standing"].position);
//! q[7..].copy_from_slice(profile.home(model)?.as_slice());
//! let v = vec![0.0; model.nv()];
//! let mut kinematics = Kinematics::new(model);
//! kinematics.update_with_velocity(model, &q, &v);
//! let state = MotionState { model, kinematics: &kinematics, q: &q, v: &v };
//!
//! let contacts = profile.feet.iter().map(|(name, foot)| Contact::of_foot(model, name, foot)).collect::<Result<Vec<_>, _>>()?;
//! let mut control = InverseDynamics::new(model, contacts);
//! let settings = CentreOfMassSettings { gain: 5.0, ..CentreOfMassSettings::default() };
//! let mut balance = CentreOfMassTask::new(model).with(settings);
//! balance.set_target(kinematics.centre_of_mass(model).position);
//! let mut posture = PostureTask::new(model, &q[7..]).with(PostureSettings { gain: 5.0, weight: 0.1 });
//!
//! control.begin(&state, 0.001);
//! control.add_task(&state, 0, &mut balance);
//! control.add_task(&state, 0, &mut posture);
//! let solution = control.solve()?;
//! assert!(solution.acceleration.amax() < 0.1, "it stands");
//! let weight = model.mass() * 9.81;
//! let carried: f64 = (0..2).map(|foot| control.wrench(foot).linear.z).sum();
//! assert!((carried - weight).abs() < 1e-2 * weight);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assemble;
mod cone_level;
pub(crate) mod contact;
mod contact_forces;
mod control;
mod holding;
mod joints;
mod limits;
pub(crate) mod order;
mod outcome;
mod predicted;
mod reduced;
mod solve;
mod solver;

pub use control::{AccelerationTask, InverseDynamics};
pub use joints::JointAccelerationLimits;
pub use outcome::{
    FrictionModel, InverseDynamicsError, InverseDynamicsSettings, InverseDynamicsSolution, Slack, Unknowns,
};
pub use predicted::DynamicsRows;

pub use crate::conflict::{Conflicting, ConstraintName};
pub use crate::contact::{Contact, ContactError, ContactShape, WrenchCone};
pub use crate::state::MotionState;
