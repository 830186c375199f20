//! Convolutions as products of patches with packed kernels.

use super::Packed;
use crate::arithmetic::Lanes;

/// Offset that marks padding, which is read as 0.
pub const PADDING: u32 = u32::MAX;

/// A convolution with fixed sizes and a preallocated workspace.
#[derive(Clone, Debug)]
pub struct Convolution<T = f32> {
    /// One map from patches to output channels for each group.
    groups: Vec<Packed<T>>,
    /// Offsets of the patch of each output position within a group's channels; `PADDING` reads as 0.
    offsets: Vec<u32>,
    /// Size of one group of input channels.
    group_size: usize,
    /// Number of output positions of a channel.
    positions: usize,
    patches: Vec<T>,
    products: Vec<T>,
}

impl<T: Lanes> Convolution<T> {
    /// Creates a convolution with `positions` output positions. For each position, `offsets` contains the
    /// indices of the patch's inputs among the `group_size` numbers of a group's channels. [`PADDING`] reads
    /// as 0.
    pub fn new(groups: Vec<Packed<T>>, offsets: Vec<u32>, group_size: usize, positions: usize) -> Self {
        let outputs = groups.first().map_or(0, Packed::outputs);
        let (patches, products) =
            (vec![T::default(); offsets.len()], vec![T::default(); positions * outputs]);
        Self { groups, offsets, group_size, positions, patches, products }
    }

    /// Convolves each sample, from shape (samples, channels, space) to (samples, outputs, space).
    pub fn apply(&mut self, input: &[T], output: &mut [T]) {
        let Self { groups, offsets, group_size, positions, patches, products } = self;
        let outputs = groups.first().map_or(0, Packed::outputs);
        let samples = input.chunks_exact((*group_size).max(1));
        let outputs_of = output.chunks_exact_mut((outputs * *positions).max(1));
        for ((input, output), packed) in samples.zip(outputs_of).zip(groups.iter().cycle()) {
            for (patch, offset) in patches.iter_mut().zip(&*offsets) {
                *patch = if *offset == PADDING { T::default() } else { input[*offset as usize] };
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
