//! Controllers of mobile bases for motorium: legs, wheels and rotors.
//!
//! - [`mpc`] plans the contact forces, contacts and swings of a legged robot by model-predictive control of
//!   its centroidal motion. A whole-body controller such as `control.qp` realises the plan.
//! - [`wheels`] converts velocities of a base to wheel speeds within limits, and wheel rotations to odometry.
//! - [`multirotor`] flies a rigid body with rotors to target poses.
//!
//! The algorithms work without clock, topics or threads, and do not allocate after construction. The
//! components [`MpcPlanner`] (`control.mpc`), [`WheelController`] (`control.wheels`) and
//! [`MultirotorController`] (`control.multirotor`) connect them to topics.

mod component;
pub mod mpc;
pub mod multirotor;
pub mod wheels;

pub use component::*;
