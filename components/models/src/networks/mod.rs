//! Neural networks that are trained on the CPU, reproducibly from a seed. Samples are the columns of `f32`
//! matrices.
//!
//! - [`ConvolutionalNetwork`]: two convolutions and two dense layers on a grey image.
//! - [`differentiable`]: layers with backward passes, to build other networks.
//! - [`Perceptron`]: a multilayer perceptron on batches.
//! - [`Adam`]: the stochastic gradient method used for training.

mod adam;
mod convolutional;
pub mod differentiable;
mod layers;
mod perceptron;
mod products;

pub use adam::Adam;
pub use convolutional::{ConvolutionalNetwork, IMAGE_SIDE, Layer};
pub use perceptron::{Perceptron, PerceptronTrace};
