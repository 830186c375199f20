//! Policies for motorium: movement primitives.
//!
//! - [`dmp`]: discrete dynamic movement primitives for any number of dimensions, and for orientations.
//! - [`rotation`]: the exponential map they stand on.
//!
//! The models are plain libraries: construct, start, [`step`](dmp::DiscreteDmp::step). Stepping never allocates.

pub mod dmp;
pub mod rotation;
