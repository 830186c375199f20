//! Neural networks that are trained on the CPU, reproducibly from a seed. Samples are the columns of `f32`
//! matrices.
//!
//! - [`ConvolutionalNetwork`]: two convolutions and two dense layers on a grey image.
//! - [`differentiable`]: layers with backward passes, to build other networks.
//! - [`Perceptron`]: a multilayer perceptron on batches, with an [`ImageEncoder`] for its images.
//! - [`Adam`]: the stochastic gradient method used for training.

mod adam;
mod convolutional;
mod dense;
pub mod differentiable;
mod encoder;
mod layers;
mod perceptron;
mod products;

pub use adam::Adam;
pub use convolutional::{ConvolutionalNetwork, IMAGE_SIDE, Layer};
pub use encoder::{ConvolutionLayer, ConvolvedImage, ImageEncoder, ImageLayers};
pub use perceptron::{Perceptron, PerceptronTrace};
