//! Convolutions of images.

use super::{Backward, Forward, Layer};
use crate::arithmetic::Real;

/// A convolution layer. A row is an image (channels, height, width). Parameters: kernels (outputs, channels,
/// kernel height, kernel width), then one bias for each output channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Convolution {
    /// Number of input channels.
    pub channels: usize,
    /// Number of output channels.
    pub filters: usize,
    /// Height and width of the input \[px\].
    pub size: [usize; 2],
    /// Height and width of the kernel \[px\]. Must not exceed the padded input.
    pub kernel: [usize; 2],
    /// Stride of the kernel \[px\], at least 1.
    pub stride: usize,
    /// Width of the zero padding around the image \[px\].
    pub padding: usize,
}

impl Convolution {
    /// Returns the height and width of the output \[px\].
    pub fn output_size(&self) -> [usize; 2] {
        [0, 1].map(|axis| (self.size[axis] + 2 * self.padding - self.kernel[axis]) / self.stride + 1)
    }

    fn weights(&self) -> usize {
        self.filters * self.channels * self.kernel[0] * self.kernel[1]
    }

    /// Calls `visit(output, weight, input)` with the offsets of each product, in the order of the sums.
    fn products(&self, mut visit: impl FnMut(usize, usize, usize)) {
        let ([height, width], [rows, columns]) = (self.output_size(), self.kernel);
        let inside = |window: usize, within: usize, length: usize| {
            (window * self.stride + within).checked_sub(self.padding).filter(|k| *k < length)
        };
        for filter in 0..self.filters {
            for row in 0..height {
                for column in 0..width {
                    let output = (filter * height + row) * width + column;
                    for channel in 0..self.channels {
                        for y in 0..rows {
                            let Some(line) = inside(row, y, self.size[0]) else { continue };
                            for x in 0..columns {
                                let Some(pixel) = inside(column, x, self.size[1]) else { continue };
                                let weight = ((filter * self.channels + channel) * rows + y) * columns + x;
                                visit(output, weight, (channel * self.size[0] + line) * self.size[1] + pixel);
                            }
                        }
                    }
                }
            }
        }
    }
}

impl Layer for Convolution {
    fn inputs(&self) -> usize {
        self.channels * self.size[0] * self.size[1]
    }

    fn outputs(&self) -> usize {
        self.filters * self.output_size().iter().product::<usize>()
    }

    fn parameters(&self) -> usize {
        self.weights() + self.filters
    }

    fn forward<T: Real>(&self, pass: Forward<'_, T>) {
        let (weights, bias) = pass.parameters.split_at(self.weights());
        let positions: usize = self.output_size().iter().product();
        let rows = pass.input.chunks_exact(self.inputs()).zip(pass.output.chunks_exact_mut(self.outputs()));
        for (input, output) in rows {
            output.chunks_exact_mut(positions).zip(bias).for_each(|(output, bias)| output.fill(*bias));
            self.products(|o, w, i| output[o] = weights[w].mul_add(input[i], output[o]));
        }
    }

    fn backward<T: Real>(&self, pass: Backward<'_, T>) {
        let weights = &pass.parameters[..self.weights()];
        let (to_weights, to_bias) = pass.parameter_gradient.split_at_mut(self.weights());
        let positions: usize = self.output_size().iter().product();
        let rows = pass.input.chunks_exact(self.inputs()).zip(pass.gradient.chunks_exact(self.outputs()));
        for ((input, gradient), out) in rows.zip(pass.input_gradient.chunks_exact_mut(self.inputs())) {
            out.fill(T::default());
            for (bias, gradient) in to_bias.iter_mut().zip(gradient.chunks_exact(positions)) {
                gradient.iter().for_each(|g| *bias += *g);
            }
            self.products(|o, w, i| {
                to_weights[w] = gradient[o].mul_add(input[i], to_weights[w]);
                out[i] = gradient[o].mul_add(weights[w], out[i]);
            });
        }
    }
}
