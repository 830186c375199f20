//! Function approximators and policies, independent of the runtime.
//!
//! - [`approximator`]: the common interface of models, and the properties of each kind of model.
//! - [`networks`]: neural networks with seeded training on the CPU.
//! - [`inference`], [`arithmetic`]: networks as lists of operations, which run without allocation.
//! - [`onnx`]: reads and writes networks as ONNX files.
//! - [`policy`]: the folder of a trained policy: its description and its network.
//! - [`safetensors`]: reads and writes files of named tensors.
//! - [`sha256`]: SHA-256 digests of files and weights.
//! - [`kernel`], [`gp`]: covariance functions and Gaussian processes.
//! - [`gplvm`]: latent spaces shared by several robots and a human.
//! - [`hmm`]: hidden Markov models.
//! - [`optimise`]: minimisation of smooth functions by L-BFGS.

pub use motorium_networks::{arithmetic, inference, safetensors};

pub mod approximator;
pub mod gp;
pub mod gplvm;
pub mod hmm;
pub mod kernel;
pub mod networks;
pub mod onnx;
pub mod optimise;
pub mod policy;
pub mod sha256;
