//! Model-predictive control of the centroidal motion of a legged robot.
//!
//! The state `s = (t, c, k, v)` of the whole robot consists of the rotation vector `t` of its base relative
//! to the reference, the position `c` and velocity `v` of its centre of mass, and the angular momentum `k`
//! about the centre of mass, all in world axes. This state depends only on the contact forces `f_i` at the
//! points `p_i`, not on the joints. With the mass `m`, the inertia `I` about the centre of mass in the
//! current posture, and the angular velocity `w*` of the reference,
//!
//! ```text
//! t' = I^-1 k - w*          c' = v          k' = sum (p_i - c) x f_i          v' = sum f_i / m + g
//! ```
//!
//! A horizon of `N` steps of `h` seconds, with constant forces per step and the lever arms `p_i - c` of the
//! last prediction, is one quadratic program in the forces:
//!
//! ```text
//! minimise   sum_k 1/2 |Q (s_k - s*_k)|^2 + sum_k,i 1/2 (r / m g)^2 |f_k,i - f*_k,i|^2
//! subject to |f_x|, |f_y| <= friction / sqrt(2) f_z,   0 <= f_z <= max_force,   of points on the ground
//! ```
//!
//! with a share `f*` of the weight for each contact point. The states are eliminated. Forces at points
//! without contact are zero.
//!
//! - [`Gait`] and [`Stepping`] define the contact schedule.
//! - [`CentroidalMpc`] solves the program.
//! - [`LegPlanner`] combines gait and program for a legged robot that follows a velocity.
//! - [`Swing`] moves a foot from its lift-off position to its [foothold](foothold).
//!
//! Di Carlo, Wensing, Katz, Bledt and Kim, *Dynamic locomotion in the MIT Cheetah 3 through convex
//! model-predictive control*, IROS 2018 (the program); Orin, Goswami and Lee, *Centroidal dynamics of a
//! humanoid robot*, 2013 (the state); Diehl, Bock and Schlöder, *A real-time iteration scheme for nonlinear
//! optimization in optimal feedback control*, 2005 (arms of the last prediction).
//!
//! # Example
//!
//! A block of 10 kg on two points settles above their midpoint:
//!
//! ```
//! use motorium_locomotion::mpc::{CentroidalMpc, CentroidalState, MpcSettings};
//! use nalgebra::{Matrix3, Vector3};
//!
//! let settings = MpcSettings { mass: 10.0, steps: 8, ..MpcSettings::default() };
//! let mut mpc = CentroidalMpc::new(settings, &[0.6, 0.6]);
//! for step in mpc.horizon_mut() {
//!     step.position = Vector3::new(0.0, 0.0, 0.3);
//!     step.points[0] = Some(Vector3::new(0.2, 0.0, 0.0));
//!     step.points[1] = Some(Vector3::new(-0.2, 0.0, 0.0));
//! }
//! let state = CentroidalState { position: Vector3::new(0.0, 0.0, 0.3), ..CentroidalState::default() };
//! mpc.solve(&state, (&(Matrix3::identity() * 0.2), 0.0), 0.0)?;
//! assert!((mpc.force(0, 0) - Vector3::new(0.0, 0.0, 5.0 * 9.81)).norm() < 1e-6);
//! # Ok::<(), motorium_qp::SolveError>(())
//! ```

mod centroidal;
mod foothold;
mod gait;
mod ground;
mod horizon;
mod leg;
mod planner;
mod reference;

pub use centroidal::CentroidalMpc;
pub use foothold::{FootPlan, Swing, foothold};
pub use gait::{Gait, GaitError, Stepping};
pub use ground::{GroundModel, GroundPlane};
pub use horizon::{CentroidalState, HorizonStep, MpcSettings, MpcWeights};
pub use leg::{Landing, PlannedFoot};
pub use planner::{LegPlanner, PlannerSettings};
pub use reference::{PlanarVelocity, Reference};
