//! Dense layers.

use super::{Backward, Forward, Layer, affine, affine_backward};
use crate::arithmetic::Real;

/// A dense layer. Parameters: weights (outputs x inputs, row by row), then one bias for each output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Linear {
    /// Number of inputs, at least 1.
    pub inputs: usize,
    /// Number of outputs, at least 1.
    pub outputs: usize,
}

impl Layer for Linear {
    fn inputs(&self) -> usize {
        self.inputs
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn parameters(&self) -> usize {
        (self.inputs + 1) * self.outputs
    }

    fn forward<T: Real>(&self, pass: Forward<'_, T>) {
        let (weights, bias) = pass.parameters.split_at(self.inputs * self.outputs);
        let rows = pass.input.chunks_exact(self.inputs).zip(pass.output.chunks_exact_mut(self.outputs));
        rows.for_each(|(input, output)| affine(weights, bias, input, output));
    }

    fn backward<T: Real>(&self, pass: Backward<'_, T>) {
        let size = self.inputs * self.outputs;
        let (weight_gradient, bias_gradient) = pass.parameter_gradient.split_at_mut(size);
        let rows = pass.input.chunks_exact(self.inputs).zip(pass.gradient.chunks_exact(self.outputs));
        for (row, input_gradient) in rows.zip(pass.input_gradient.chunks_exact_mut(self.inputs)) {
            input_gradient.fill(T::default());
            let gradients = (&mut *weight_gradient, &mut *bias_gradient);
            affine_backward(&pass.parameters[..size], row, input_gradient, gradients);
        }
    }
}
