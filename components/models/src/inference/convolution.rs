//! Convolutions as products of patches with packed kernels.

use super::Packed;

/// Offset that marks padding.
pub(crate) const PADDING: u32 = u32::MAX;

/// A convolution with fixed sizes, and its patch workspace.
#[derive(Clone, Debug)]
pub struct Convolution {
    /// One map from patches to output channels for each group.
    groups: Vec<Packed>,
    /// Offsets of the patch of each output position within a group's channels; `PADDING` reads as 0.
    offsets: Vec<u32>,
    /// Size of one group of input channels.
    group_size: usize,
    /// Number of output positions of a channel.
    positions: usize,
    patches: Vec<f32>,
    products: Vec<f32>,
}

impl Convolution {
    /// Creates a convolution with `positions` outputs. The patch of each output reads the numbers at
    /// `offsets` of a group's channels (`group_size` numbers).
    pub(crate) fn new(groups: Vec<Packed>, offsets: Vec<u32>, group_size: usize, positions: usize) -> Self {
        let outputs = groups.first().map_or(0, Packed::outputs);
        let (patches, products) = (vec![0.0; offsets.len()], vec![0.0; positions * outputs]);
        Self { groups, offsets, group_size, positions, patches, products }
    }

    /// Convolves each sample: (samples, channels, space) to (samples, outputs, space).
    pub fn apply(&mut self, input: &[f32], output: &mut [f32]) {
        let Self { groups, offsets, group_size, positions, patches, products } = self;
        let outputs = groups.first().map_or(0, Packed::outputs);
        let samples = input.chunks_exact((*group_size).max(1));
        let outputs_of = output.chunks_exact_mut((outputs * *positions).max(1));
        for ((input, output), packed) in samples.zip(outputs_of).zip(groups.iter().cycle()) {
            for (patch, offset) in patches.iter_mut().zip(&*offsets) {
                *patch = if *offset == PADDING { 0.0 } else { input[*offset as usize] };
            }
            packed.apply(patches, products);
            for (position, products) in products.chunks_exact(outputs).enumerate() {
                for (channel, product) in products.iter().enumerate() {
                    output[channel * *positions + position] = *product;
                }
            }
        }
    }
}
