//! Convolutions of images among the inputs of a network.

use core::ops::Range;

use nalgebra::DMatrix;
use rand_pcg::Pcg64;

use super::dense::{Dense, orthogonal, resize};
use super::differentiable::{Convolution, Function, Layer as _};

/// Convolutions of the images among the inputs of a [`Perceptron`](super::Perceptron), with ReLU after each
/// convolution.
///
/// Each image has its own convolutions. The outputs are the values of the last convolution of each image,
/// ordered by channel, row and column, followed by all inputs that are not pixels. Sums have a fixed order,
/// as in the layers of a perceptron.
///
/// ```
/// use motorium_models::networks::differentiable::Convolution;
/// use motorium_models::networks::{ImageEncoder, ImageLayers, Perceptron};
/// use nalgebra::DMatrix;
/// use rand_pcg::Pcg64;
///
/// // an image of 6 x 5 pixels in one channel, then 2 other numbers
/// let layer = Convolution { channels: 1, filters: 4, size: [5, 6], kernel: [3, 3], stride: 2, padding: 1 };
/// let image = ImageLayers { first: 0, layers: vec![layer] };
/// let mut random = Pcg64::new(1, 2);
/// let encoder = ImageEncoder::random(32, &[image], &mut random);
/// assert_eq!(encoder.outputs(), 4 * 3 * 3 + 2);
/// let network = Perceptron::random(&[encoder.outputs(), 8, 1], 1.0, &mut random).with_encoder(encoder);
/// assert_eq!(network.forward(DMatrix::zeros(32, 1)).output().shape(), (1, 1));
/// ```
#[derive(Clone, Debug)]
pub struct ImageEncoder {
    inputs: usize,
    images: Vec<Stack>,
    /// Inputs that are not pixels.
    others: Vec<Range<usize>>,
    function: Function,
}

/// The sizes of the convolutions of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageLayers {
    /// Index of the first pixel among the inputs of the network. Pixels are ordered by channel, row and
    /// column.
    pub first: usize,
    /// Convolutions, at least one. Each reads the output of the previous one.
    pub layers: Vec<Convolution>,
}

/// An image among the inputs of a network, with its convolutions.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvolvedImage {
    /// Index of the first pixel among the inputs of the network.
    pub first: usize,
    /// Convolutions, at least one.
    pub layers: Vec<ConvolutionLayer>,
}

/// A convolution with its weights.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvolutionLayer {
    /// Sizes of the convolution.
    pub shape: Convolution,
    /// Kernels: outputs, channels, rows, columns.
    pub weights: Vec<f32>,
    /// One bias per output channel.
    pub bias: Vec<f32>,
}

/// The convolutions of one image.
#[derive(Clone, Debug)]
struct Stack {
    first: usize,
    layers: Vec<Filters>,
}

/// A convolution as a dense layer on patches. Within the encoder an image is ordered by row, column and
/// channel, and a patch likewise, so that a patch consists of one run of numbers per row of the kernel.
#[derive(Clone, Debug)]
struct Filters {
    shape: Convolution,
    dense: Dense,
}

/// Values of one convolution in a forward pass.
#[derive(Clone, Debug, Default)]
pub(super) struct FilterTrace {
    /// The image of one sample with its padding.
    padded: Vec<f32>,
    /// One column per position, all positions of the first sample first.
    patches: DMatrix<f32>,
    /// Values after the activation, one column per position.
    output: DMatrix<f32>,
}

/// Gradients with respect to the values of one convolution.
#[derive(Clone, Debug, Default)]
pub(super) struct FilterGradients {
    padded: Vec<f32>,
    patches: DMatrix<f32>,
    output: DMatrix<f32>,
}

impl Stack {
    /// Returns the number of pixels in all channels.
    fn inputs(&self) -> usize {
        self.layers[0].shape.inputs()
    }

    fn outputs(&self) -> usize {
        self.layers[self.layers.len() - 1].shape.outputs()
    }
}

impl ImageEncoder {
    /// Creates an encoder of `inputs` numbers with random weights. They are orthogonal and scaled by the
    /// square root of 2; biases are 0, as in [`Perceptron::random`](super::Perceptron::random).
    ///
    /// # Panics
    ///
    /// If an image has no convolution, the sizes of two consecutive convolutions differ, or images overlap,
    /// are unordered or exceed the inputs.
    pub fn random(inputs: usize, images: &[ImageLayers], random: &mut Pcg64) -> Self {
        let mut filters = |shape: Convolution| {
            let patch = shape.channels * shape.kernel[0] * shape.kernel[1];
            let weights = orthogonal(shape.filters, patch, random) * core::f32::consts::SQRT_2;
            Filters { shape, dense: Dense::new(&weights) }
        };
        let mut stack = |image: &ImageLayers| {
            let follows = |pair: &[Convolution]| {
                (pair[0].filters, pair[0].output_size()) == (pair[1].channels, pair[1].size)
            };
            assert!(
                !image.layers.is_empty() && image.layers.windows(2).all(follows),
                "sizes of convolutions"
            );
            Stack { first: image.first, layers: image.layers.iter().copied().map(&mut filters).collect() }
        };
        let images: Vec<Stack> = images.iter().map(&mut stack).collect();
        let (mut others, mut end) = (Vec::new(), 0);
        for image in &images {
            assert!(end <= image.first, "images in order");
            others.push(end..image.first);
            end = image.first + image.inputs();
        }
        assert!(end <= inputs, "images within the inputs");
        others.push(end..inputs);
        others.retain(|range| !range.is_empty());
        Self { inputs, images, others, function: Function::Relu }
    }

    /// Replaces the activation function after each convolution.
    #[must_use]
    pub fn with_function(self, function: Function) -> Self {
        Self { function, ..self }
    }

    /// Returns the number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Returns the number of outputs: values of the last convolution of each image, and inputs that are not
    /// pixels.
    pub fn outputs(&self) -> usize {
        let features: usize = self.images.iter().map(Stack::outputs).sum();
        features + self.others.iter().map(Range::len).sum::<usize>()
    }

    /// Returns the images with their convolutions.
    pub fn images(&self) -> Vec<ConvolvedImage> {
        let layer = |Filters { shape, dense }: &Filters| {
            let [rows, columns] = shape.kernel;
            let mut weights = Vec::with_capacity(dense.by_output.len());
            for kernel in dense.by_output.chunks_exact(dense.inputs) {
                for channel in 0..shape.channels {
                    weights.extend(kernel.iter().skip(channel).step_by(shape.channels));
                }
            }
            debug_assert_eq!(weights.len(), shape.filters * shape.channels * rows * columns);
            ConvolutionLayer { shape: *shape, weights, bias: dense.bias.clone() }
        };
        let image = |stack: &Stack| ConvolvedImage {
            first: stack.first,
            layers: stack.layers.iter().map(layer).collect(),
        };
        self.images.iter().map(image).collect()
    }

    fn filters(&self) -> impl Iterator<Item = &Filters> {
        self.images.iter().flat_map(|stack| &stack.layers)
    }

    /// Returns the number of inputs after the last image.
    pub(super) fn trailing(&self) -> usize {
        self.inputs - self.images.last().map_or(0, |stack| stack.first + stack.inputs())
    }

    pub(super) fn parameters(&self) -> usize {
        self.filters().map(|filters| filters.dense.parameters()).sum()
    }

    /// Returns the parameters of each convolution: weights by row, column, channel and output, then biases.
    pub(super) fn slices(&self) -> impl Iterator<Item = &[f32]> {
        self.filters().flat_map(|Filters { dense, .. }| [&dense.weights[..], &dense.bias])
    }

    /// Replaces all parameters, in the order of [`slices`](Self::slices).
    pub(super) fn set(&mut self, parameters: &[f32]) {
        let mut rest = parameters;
        for Filters { dense, .. } in self.images.iter_mut().flat_map(|stack| &mut stack.layers) {
            let (own, others) = rest.split_at(dense.parameters());
            dense.set(own);
            rest = others;
        }
    }

    /// Writes the outputs for inputs with one sample per column.
    pub(super) fn forward(
        &self,
        input: &DMatrix<f32>,
        trace: &mut Vec<FilterTrace>,
        output: &mut DMatrix<f32>,
    ) {
        let samples = input.ncols();
        trace.resize_with(self.filters().count(), FilterTrace::default);
        resize(output, self.outputs(), samples);
        let (mut rest, mut row) = (&mut trace[..], 0);
        for stack in &self.images {
            let (own, behind) = rest.split_at_mut(stack.layers.len());
            rest = behind;
            for (index, layer) in stack.layers.iter().enumerate() {
                let (before, now) = own.split_at_mut(index);
                let FilterTrace { padded, patches, output } = &mut now[0];
                let shape = &layer.shape;
                resize(patches, layer.dense.inputs, samples * positions(shape));
                let size = layer.dense.inputs * positions(shape);
                for (sample, patches) in patches.as_mut_slice().chunks_exact_mut(size).enumerate() {
                    padded.clear();
                    padded.resize(padded_len(shape), 0.0);
                    match before.last() {
                        None => {
                            let image = &input.as_slice()[sample * self.inputs + stack.first..];
                            interleave(shape, &image[..shape.inputs()], padded);
                        }
                        Some(previous) => {
                            let image = &previous.output.as_slice()[sample * shape.inputs()..];
                            pad(shape, &image[..shape.inputs()], padded);
                        }
                    }
                    gather(shape, padded, patches);
                }
                layer.dense.forward(patches, output);
                self.function.apply(output.as_mut_slice());
            }
            let (channels, count) = (stack.layers[own.len() - 1].shape.filters, stack.outputs());
            let features = own[own.len() - 1].output.as_slice().chunks_exact(count);
            for (features, mut column) in features.zip(output.column_iter_mut()) {
                transpose(features, channels, &mut column.as_mut_slice()[row..row + count]);
            }
            row += count;
        }
        for range in &self.others {
            output.rows_mut(row, range.len()).copy_from(&input.rows(range.start, range.len()));
            row += range.len();
        }
    }

    /// Propagates the gradient with respect to the outputs. Writes the gradients with respect to the
    /// parameters and to the inputs, if requested.
    pub(super) fn backward(
        &self,
        (trace, gradient): (&[FilterTrace], &DMatrix<f32>),
        scratch: &mut Vec<FilterGradients>,
        mut parameters: Option<&mut [f32]>,
        mut input: Option<&mut DMatrix<f32>>,
    ) {
        scratch.resize_with(trace.len(), FilterGradients::default);
        if let Some(input) = &mut input {
            resize(input, self.inputs, gradient.ncols());
        }
        let (mut first, mut row) = (0, 0);
        for stack in &self.images {
            let count = stack.layers.len();
            let (own_trace, own) = (&trace[first..first + count], &mut scratch[first..first + count]);
            first += count;
            let (values, features) = (&own_trace[count - 1].output, &mut own[count - 1].output);
            resize(features, values.nrows(), values.ncols());
            let columns = features.as_mut_slice().chunks_exact_mut(stack.outputs());
            for (features, column) in columns.zip(gradient.column_iter()) {
                let rows = &column.as_slice()[row..row + stack.outputs()];
                transpose(rows, rows.len() / values.nrows(), features);
            }
            row += stack.outputs();
            if let Some(rest) = parameters.take() {
                let size = stack.layers.iter().map(|layer| layer.dense.parameters()).sum();
                let (own_parameters, others) = rest.split_at_mut(size);
                parameters = Some(others);
                stack.backward(
                    self.function,
                    (own_trace, own),
                    Some(own_parameters),
                    pixels(&mut input, stack),
                );
            } else {
                stack.backward(self.function, (own_trace, own), None, pixels(&mut input, stack));
            }
        }
        if let Some(input) = input {
            for range in &self.others {
                input.rows_mut(range.start, range.len()).copy_from(&gradient.rows(row, range.len()));
                row += range.len();
            }
        }
    }
}

/// Returns the gradient with respect to the inputs and the index of the first pixel of an image.
fn pixels<'a>(
    input: &'a mut Option<&mut DMatrix<f32>>,
    stack: &Stack,
) -> Option<(&'a mut DMatrix<f32>, usize)> {
    input.as_deref_mut().map(|input| (input, stack.first))
}

impl Stack {
    /// Propagates the gradient with respect to the values of the last convolution.
    fn backward(
        &self,
        function: Function,
        (trace, scratch): (&[FilterTrace], &mut [FilterGradients]),
        mut parameters: Option<&mut [f32]>,
        mut input: Option<(&mut DMatrix<f32>, usize)>,
    ) {
        for (index, layer) in self.layers.iter().enumerate().rev() {
            let (before, now) = scratch.split_at_mut(index);
            let FilterGradients { padded, patches, output } = &mut now[0];
            let shape = &layer.shape;
            function.scale_by_slopes(output.as_mut_slice(), trace[index].output.as_slice());
            if let Some(rest) = parameters.take() {
                let (others, own) = rest.split_at_mut(rest.len() - layer.dense.parameters());
                layer.dense.gradients(&trace[index].patches, output, own);
                parameters = Some(others);
            }
            if index == 0 && input.is_none() {
                return;
            }
            layer.dense.backward(output, patches);
            let samples = output.ncols() / positions(shape);
            if let Some(previous) = before.last_mut() {
                resize(&mut previous.output, shape.channels, samples * shape.inputs() / shape.channels);
            }
            let size = layer.dense.inputs * positions(shape);
            for (sample, patches) in patches.as_slice().chunks_exact(size).enumerate() {
                padded.clear();
                padded.resize(padded_len(shape), 0.0);
                scatter(shape, patches, padded);
                if let Some(previous) = before.last_mut() {
                    let image = &mut previous.output.as_mut_slice()[sample * shape.inputs()..];
                    crop(shape, padded, &mut image[..shape.inputs()]);
                } else if let Some((input, first)) = &mut input {
                    let mut column = input.column_mut(sample);
                    separate(shape, padded, &mut column.as_mut_slice()[*first..][..shape.inputs()]);
                }
            }
        }
    }
}

/// Returns the number of positions of a kernel.
fn positions(shape: &Convolution) -> usize {
    shape.output_size().iter().product()
}

/// Returns the numbers in a row of a padded image.
fn padded_row(shape: &Convolution) -> usize {
    (shape.size[1] + 2 * shape.padding) * shape.channels
}

fn padded_len(shape: &Convolution) -> usize {
    (shape.size[0] + 2 * shape.padding) * padded_row(shape)
}

/// Returns the index of the first number of an image's row in its padded image.
fn inner_row(shape: &Convolution, row: usize) -> usize {
    (row + shape.padding) * padded_row(shape) + shape.padding * shape.channels
}

/// Copies an image ordered by channel into a padded image.
fn interleave(shape: &Convolution, image: &[f32], padded: &mut [f32]) {
    let (channels, [_, columns]) = (shape.channels, shape.size);
    for (line, pixels) in image.chunks_exact(columns).enumerate() {
        let (channel, row) = (line / shape.size[0], line % shape.size[0]);
        let target = &mut padded[inner_row(shape, row)..][..columns * channels];
        for (slot, pixel) in target.iter_mut().skip(channel).step_by(channels).zip(pixels) {
            *slot = *pixel;
        }
    }
}

/// Copies a padded image into an image ordered by channel.
fn separate(shape: &Convolution, padded: &[f32], image: &mut [f32]) {
    let (channels, [_, columns]) = (shape.channels, shape.size);
    for (line, pixels) in image.chunks_exact_mut(columns).enumerate() {
        let (channel, row) = (line / shape.size[0], line % shape.size[0]);
        let source = &padded[inner_row(shape, row)..][..columns * channels];
        for (pixel, value) in pixels.iter_mut().zip(source.iter().skip(channel).step_by(channels)) {
            *pixel = *value;
        }
    }
}

/// Copies an image ordered by row, column and channel into a padded image.
fn pad(shape: &Convolution, image: &[f32], padded: &mut [f32]) {
    let length = shape.size[1] * shape.channels;
    for (row, pixels) in image.chunks_exact(length).enumerate() {
        padded[inner_row(shape, row)..][..length].copy_from_slice(pixels);
    }
}

/// Copies a padded image into an image ordered by row, column and channel.
fn crop(shape: &Convolution, padded: &[f32], image: &mut [f32]) {
    let length = shape.size[1] * shape.channels;
    for (row, pixels) in image.chunks_exact_mut(length).enumerate() {
        pixels.copy_from_slice(&padded[inner_row(shape, row)..][..length]);
    }
}

/// Returns, for each row of each patch, its index in the padded image.
fn runs(shape: &Convolution) -> impl Iterator<Item = usize> {
    let Convolution { channels, kernel, stride, .. } = *shape;
    let ([rows, columns], width) = (shape.output_size(), padded_row(shape));
    (0..rows * columns).flat_map(move |position| {
        let corner = position / columns * stride * width + position % columns * stride * channels;
        (0..kernel[0]).map(move |line| corner + line * width)
    })
}

/// Copies the patches of a padded image, one after the other.
fn gather(shape: &Convolution, padded: &[f32], patches: &mut [f32]) {
    let length = shape.kernel[1] * shape.channels;
    for (run, from) in patches.chunks_exact_mut(length).zip(runs(shape)) {
        run.copy_from_slice(&padded[from..from + length]);
    }
}

/// Adds patches to a padded image.
fn scatter(shape: &Convolution, patches: &[f32], padded: &mut [f32]) {
    let length = shape.kernel[1] * shape.channels;
    for (run, to) in patches.chunks_exact(length).zip(runs(shape)) {
        padded[to..to + length].iter_mut().zip(run).for_each(|(sum, value)| *sum += value);
    }
}

/// Writes the transpose of a matrix that is stored row by row, with `columns` columns.
fn transpose(matrix: &[f32], columns: usize, out: &mut [f32]) {
    let rows = matrix.len() / columns;
    for (column, line) in out.chunks_exact_mut(rows).enumerate() {
        let values = matrix.iter().skip(column).step_by(columns);
        line.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
    }
}

#[cfg(test)]
mod tests;
