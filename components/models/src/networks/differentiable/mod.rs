//! Layers with backward passes, generic over the scalar type: `f32` for training, `f64` to check gradients.
//!
//! A layer contains only sizes. The parameters of a layer are one slice, which an optimiser can update, and
//! which can be stored in a file or sent in a message. The caller provides all buffers; only recurrent
//! backward passes allocate (a row of gates). Sums have a fixed order, so training is reproducible bit for
//! bit.
//!
//! ```
//! use motorium_models::networks::differentiable::{Backward, Forward, Layer, Linear};
//!
//! let layer = Linear { inputs: 2, outputs: 1 };
//! // two weights, one bias
//! let parameters = [2.0, -1.0, 0.5];
//! let (input, mut output) = ([3.0, 4.0], [0.0]);
//! layer.forward(Forward { parameters: &parameters, input: &input, output: &mut output, trace: &mut [] });
//! assert_eq!(output, [2.5]);
//! let (mut to_input, mut to_parameters) = ([0.0; 2], [0.0; 3]);
//! layer.backward(Backward {
//!     parameters: &parameters,
//!     input: &input,
//!     output: &output,
//!     trace: &[],
//!     gradient: &[1.0],
//!     input_gradient: &mut to_input,
//!     parameter_gradient: &mut to_parameters,
//! });
//! assert_eq!((to_input, to_parameters), ([2.0, -1.0], [3.0, 4.0, 1.0]));
//! ```

mod activation;
mod convolution;
mod linear;
mod normalisation;
mod recurrent;

pub use activation::{Activation, Function};
pub use convolution::Convolution;
pub use linear::Linear;
pub use normalisation::{BatchNorm, LayerNorm};
pub use recurrent::{Gru, Lstm};

use crate::arithmetic::Real;

/// Buffers of a forward pass. The number of rows is the length of `input` divided by [`Layer::inputs`].
#[derive(Debug)]
pub struct Forward<'a, T> {
    /// Parameters of the layer.
    pub parameters: &'a [T],
    /// Rows of inputs.
    pub input: &'a [T],
    /// Buffer to which the rows of outputs are written.
    pub output: &'a mut [T],
    /// Values stored for the backward pass: [`Layer::trace`] values for each row.
    pub trace: &'a mut [T],
}

/// Buffers of a backward pass.
#[derive(Debug)]
pub struct Backward<'a, T> {
    /// Parameters of the layer.
    pub parameters: &'a [T],
    /// Rows of inputs of the forward pass.
    pub input: &'a [T],
    /// Rows of outputs of the forward pass.
    pub output: &'a [T],
    /// Trace of the forward pass.
    pub trace: &'a [T],
    /// Gradient of the loss with respect to the outputs.
    pub gradient: &'a [T],
    /// Buffer to which the gradient of the loss with respect to the inputs is written.
    pub input_gradient: &'a mut [T],
    /// Buffer to which the gradient of the loss with respect to the parameters is added.
    pub parameter_gradient: &'a mut [T],
}

/// A differentiable function that is applied to rows of numbers.
pub trait Layer {
    /// Returns the number of values in a row of inputs.
    fn inputs(&self) -> usize;
    /// Returns the number of values in a row of outputs.
    fn outputs(&self) -> usize;
    /// Returns the number of parameters.
    fn parameters(&self) -> usize;
    /// Returns the number of values stored for the backward pass of each row.
    fn trace(&self) -> usize {
        0
    }
    /// Computes the outputs from the inputs and the parameters.
    fn forward<T: Real>(&self, pass: Forward<'_, T>);
    /// Computes the gradients of the loss with respect to the inputs and the parameters.
    fn backward<T: Real>(&self, pass: Backward<'_, T>);
}

/// Computes `bias + weights * input` for one row. `weights` is stored row by row (outputs x inputs), and
/// products are added in the order of the inputs.
fn affine<T: Real>(weights: &[T], bias: &[T], input: &[T], output: &mut [T]) {
    for ((row, bias), output) in weights.chunks_exact(input.len()).zip(bias).zip(output) {
        *output = row.iter().zip(input).fold(*bias, |sum, (w, x)| w.mul_add(*x, sum));
    }
}

/// Adds the gradients of one row of [`affine`] with respect to weights, bias and input.
fn affine_backward<T: Real>(
    weights: &[T],
    (input, gradient): (&[T], &[T]),
    input_gradient: &mut [T],
    (weight_gradient, bias_gradient): (&mut [T], &mut [T]),
) {
    let n = input.len();
    let rows = weights.chunks_exact(n).zip(weight_gradient.chunks_exact_mut(n));
    for ((weights, weight_gradient), (g, bias)) in rows.zip(gradient.iter().zip(bias_gradient)) {
        *bias += *g;
        for k in 0..n {
            weight_gradient[k] = g.mul_add(input[k], weight_gradient[k]);
            input_gradient[k] = g.mul_add(weights[k], input_gradient[k]);
        }
    }
}

#[cfg(test)]
mod tests;
