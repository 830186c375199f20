//! The Lie groups SO(3) of rotations and SE(3) of rigid motions: exponential, logarithm and their Jacobians.
//!
//! # Conventions
//!
//! - A rotation vector `phi` \[rad\] is a rotation by `|phi|` about `phi`.
//! - A twist `xi` has the linear part \[m\] first, then the angular part \[rad\].
//! - The left Jacobian maps a rate of the vector to a velocity in world axes,
//!   `d/dt exp(x) = (Jl x')^ exp(x)`; the right Jacobian maps it to a velocity in body axes,
//!   `d/dt exp(x) = exp(x) (Jr x')^`. `Jr(x) = Jl(-x)`.
//!
//! Nothing allocates. Results are accurate to a few units in the last place from angle zero to pi: power
//! series replace closed forms that would subtract nearly equal numbers, and no angle is computed from its
//! cosine.
//!
//! References: Sola, Deray, Atchuthan, *A micro Lie theory for state estimation in robotics*, 2018; Barfoot,
//! *State Estimation for Robotics*, chapter 7.
//!
//! ```
//! use motorium_robots::lie::{se3, so3};
//! use nalgebra::{Vector3, Vector6};
//!
//! let phi = Vector3::new(0.1, -0.2, 3.0);
//! assert!((so3::log(&so3::exp(&phi)) - phi).norm() < 1e-14);
//!
//! let xi = Vector6::new(0.5, 0.0, -0.1, 0.1, -0.2, 3.0);
//! assert!((se3::log(&se3::exp(&xi)) - xi).norm() < 1e-14);
//! ```

mod coefficients;
mod rates;
pub mod se3;
pub mod so3;

pub use rates::{RotationRates, angular_motion, rotation_rates};
