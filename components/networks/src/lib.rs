//! Evaluation of neural networks for robots and models.
//!
//! - [`inference`]: networks as lists of operations that run without allocation.
//! - [`arithmetic`]: the scalar types of networks, `f32` and `f64`.
//! - [`safetensors`]: reads and writes files of named tensors.

pub mod arithmetic;
pub mod inference;
pub mod safetensors;
