//! Function approximators without the runtime.
//!
//! - [`networks`]: neural networks with seeded training on the CPU.
//! - [`inference`]: networks as lists of operations that run without allocation.
//! - [`onnx`]: reads and writes networks as ONNX files.
//! - [`policy`]: the folder of a trained policy.
//! - [`safetensors`]: reads and writes named tensors.

pub mod arithmetic;
pub mod inference;
pub mod networks;
pub mod onnx;
pub mod policy;
pub mod safetensors;
