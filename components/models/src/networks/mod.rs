//! Neural networks on matrices of `f32`, one sample a column, with seeded training on the CPU.
//!
//! - [`ConvolutionalNetwork`]: two convolutions and two dense layers on a grey image.
//! - [`differentiable`]: layers with backward passes, for any network.
//! - [`Adam`]: the stochastic gradient method that trains it.

mod adam;
mod convolutional;
pub mod differentiable;
mod layers;

pub use adam::Adam;
pub use convolutional::{ConvolutionalNetwork, IMAGE_SIDE, Layer};
