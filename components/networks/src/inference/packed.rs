//! Matrices packed for fast products with rows of inputs.

use std::sync::Arc;

use pulp::{Arch, Simd, WithSimd};

use crate::arithmetic::Lanes;

/// Outputs of the widest panel.
const WIDEST: usize = 64;
/// Outputs of the narrowest panel: lanes of the widest vectors.
const NARROWEST: usize = 16;

/// Weights and biases of a linear map, stored in panels of outputs for vector instructions.
///
/// An output is the bias plus the products with the inputs, added in the order of the inputs. Each addition
/// is a fused multiply-add, which rounds once. The lanes of a vector hold different outputs, so results are
/// bitwise independent of the number of rows and of the processor. Clones share the weights and biases.
#[derive(Clone, Debug)]
pub struct Packed<T = f32> {
    inputs: usize,
    outputs: usize,
    /// Bias of a panel, then one row per input.
    numbers: Arc<Vec<T>>,
    /// Index of the first number, which is aligned to a cache line.
    start: usize,
    arch: Arch,
}

/// Copies numbers to the start of a cache line.
fn aligned<T: Lanes>(numbers: &[T]) -> (Vec<T>, usize) {
    let mut copy = vec![T::default(); numbers.len() + T::LINE];
    // the offset is in numbers
    let start = copy.as_ptr().align_offset(size_of::<T>() * T::LINE).min(T::LINE);
    copy[start..start + numbers.len()].copy_from_slice(numbers);
    copy.truncate(start + numbers.len());
    (copy, start)
}

/// Widths of the panels that cover `outputs`.
fn widths(outputs: usize) -> impl Iterator<Item = usize> {
    let mut rest = outputs;
    core::iter::from_fn(move || {
        let width = match rest {
            0 => return None,
            WIDEST.. => WIDEST,
            32.. => 32,
            _ => NARROWEST,
        };
        rest = rest.saturating_sub(width);
        Some(width)
    })
}

impl<T: Lanes> Packed<T> {
    /// Packs the map from `inputs` to `outputs` numbers with the weight `weight(output, input)` and the bias
    /// `bias(output)`.
    pub fn new(
        (outputs, inputs): (usize, usize),
        weight: impl Fn(usize, usize) -> T,
        bias: impl Fn(usize) -> T,
    ) -> Self {
        let (mut numbers, mut first) = (Vec::new(), 0);
        for width in widths(outputs) {
            let columns = first..first + width;
            let padded = |column: usize, value: &dyn Fn(usize) -> T| {
                if column < outputs { value(column) } else { T::default() }
            };
            numbers.extend(columns.clone().map(|column| padded(column, &bias)));
            for input in 0..inputs {
                numbers.extend(columns.clone().map(|column| padded(column, &|output| weight(output, input))));
            }
            first += width;
        }
        let (numbers, start) = aligned(&numbers);
        Self { inputs, outputs, numbers: Arc::new(numbers), start, arch: Arch::new() }
    }

    /// Returns the number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Returns the number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Maps each row of `input` ([`inputs`](Self::inputs) numbers) to a row of `output`
    /// ([`outputs`](Self::outputs) numbers). The shorter slice determines the number of rows.
    pub fn apply(&self, input: &[T], output: &mut [T]) {
        if self.outputs == 0 {
            return;
        }
        let rows = output.len() / self.outputs;
        if self.inputs == 0 {
            let mut first = 0;
            let mut panels = &self.numbers[self.start..];
            for width in widths(self.outputs) {
                let (bias, rest) = panels.split_at(width);
                let count = width.min(self.outputs - first);
                for row in output.chunks_exact_mut(self.outputs) {
                    row[first..first + count].copy_from_slice(&bias[..count]);
                }
                (panels, first) = (rest, first + width);
            }
            return;
        }
        let rows = rows.min(input.len() / self.inputs);
        let (input, output) = (&input[..rows * self.inputs], &mut output[..rows * self.outputs]);
        self.arch.dispatch(Multiply { packed: self, input, output });
    }
}

struct Multiply<'a, T> {
    packed: &'a Packed<T>,
    input: &'a [T],
    output: &'a mut [T],
}

impl<T: Lanes> WithSimd for Multiply<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Packed { inputs, outputs, ref numbers, start, .. } = *self.packed;
        // Panels outside, rows inside: a panel stays in the L1 cache for all rows.
        let (mut panels, mut first) = (&numbers[start..], 0);
        for width in widths(outputs) {
            let (panel, rest) = panels.split_at((inputs + 1) * width);
            let columns = first..(first + width).min(outputs);
            let mut inputs_left = self.input.chunks_exact(4 * inputs);
            let mut outputs_left = self.output.chunks_exact_mut(4 * outputs);
            for (input, output) in inputs_left.by_ref().zip(outputs_left.by_ref()) {
                let (a, b) = input.split_at(2 * inputs);
                let (rows, more) = (a.split_at(inputs), b.split_at(inputs));
                let mut sums = [[T::default(); WIDEST]; 4];
                panel_rows::<S, T, 4>(simd, panel, width, [rows.0, rows.1, more.0, more.1], &mut sums);
                for (output, sums) in output.chunks_exact_mut(outputs).zip(&sums) {
                    output[columns.clone()].copy_from_slice(&sums[..columns.len()]);
                }
            }
            let rows = inputs_left.remainder().chunks_exact(inputs);
            for (input, output) in rows.zip(outputs_left.into_remainder().chunks_exact_mut(outputs)) {
                let mut sums = [[T::default(); WIDEST]; 1];
                panel_rows::<S, T, 1>(simd, panel, width, [input], &mut sums);
                output[columns.clone()].copy_from_slice(&sums[0][..columns.len()]);
            }
            (panels, first) = (rest, first + width);
        }
    }
}

/// Computes the outputs of one panel for some rows, with as many output vectors simultaneously as fit into
/// the registers.
#[inline(always)]
fn panel_rows<S: Simd, T: Lanes, const ROWS: usize>(
    simd: S,
    panel: &[T],
    width: usize,
    rows: [&[T]; ROWS],
    sums: &mut [[T; WIDEST]; ROWS],
) {
    let (panel, stride) = (T::vectors::<S>(panel), width / T::lanes::<S>());
    let mut first = 0;
    while first < stride {
        let left = stride - first;
        first += match ROWS {
            1 if left >= 8 => vectors::<S, T, ROWS, 8>(simd, panel, (stride, first), rows, sums),
            _ if left >= 4 && ROWS * 4 <= S::REGISTER_COUNT / 2 => {
                vectors::<S, T, ROWS, 4>(simd, panel, (stride, first), rows, sums)
            }
            _ if left >= 2 => vectors::<S, T, ROWS, 2>(simd, panel, (stride, first), rows, sums),
            _ => vectors::<S, T, ROWS, 1>(simd, panel, (stride, first), rows, sums),
        };
    }
}

/// Computes the outputs in `COUNT` vectors of a panel; returns `COUNT`.
#[inline(always)]
fn vectors<S: Simd, T: Lanes, const ROWS: usize, const COUNT: usize>(
    simd: S,
    panel: &[T::Vector<S>],
    (stride, first): (usize, usize),
    rows: [&[T]; ROWS],
    sums: &mut [[T; WIDEST]; ROWS],
) -> usize {
    let (bias, weights) = panel.split_at(stride);
    let bias: [T::Vector<S>; COUNT] = core::array::from_fn(|k| bias[first + k]);
    let mut totals = [bias; ROWS];
    for (input, weights) in weights.chunks_exact(stride).enumerate() {
        let weights = &weights[first..first + COUNT];
        for row in 0..ROWS {
            let x = rows[row][input].splat(simd);
            for k in 0..COUNT {
                totals[row][k] = T::mul_add_vectors(simd, weights[k], x, totals[row][k]);
            }
        }
    }
    for (sums, totals) in sums.iter_mut().zip(totals) {
        T::vectors_mut::<S>(sums)[first..first + COUNT].copy_from_slice(&totals);
    }
    COUNT
}

#[cfg(test)]
mod tests {
    use super::Packed;
    use crate::arithmetic::Lanes;

    fn number(seed: usize) -> f32 {
        let bits = (seed as u32).wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(747_796_405);
        (bits >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    /// Compares the outputs of maps of several sizes with sums in the order of the inputs. `value` returns
    /// the weight, bias or input of a seed.
    fn outputs_are_ordered_sums<T: Lanes>(value: impl Fn(usize) -> T + Copy) {
        for (inputs, outputs) in
            [(1, 1), (6, 1), (3, 15), (48, 12), (5, 16), (9, 33), (17, 64), (7, 127), (0, 20)]
        {
            let weight = |o: usize, i: usize| value(1000 * o + i);
            let bias = |o: usize| value(77 + o);
            let packed = Packed::new((outputs, inputs), weight, bias);
            for rows in [1, 2, 4, 5, 11] {
                let input: Vec<T> = (0..rows * inputs).map(|k| value(31 * k + 5)).collect();
                let mut output = vec![T::default(); rows * outputs];
                packed.clone().apply(&input, &mut output);
                for (k, found) in output.iter().enumerate() {
                    let (row, o) = (k / outputs, k % outputs);
                    let sum = (0..inputs)
                        .fold(bias(o), |sum, i| weight(o, i).mul_add(input[row * inputs + i], sum));
                    // the conversion is exact, including the sign of zero
                    let [found, sum] = [*found, sum].map(|number| number.to_f64().to_bits());
                    assert_eq!(found, sum, "{inputs} {outputs} {row} {o}");
                }
            }
        }
    }

    #[test]
    fn outputs_are_ordered_sums_of_fused_products() {
        outputs_are_ordered_sums(number);
    }

    #[test]
    fn double_precision_sums_have_the_same_order() {
        outputs_are_ordered_sums(|seed| f64::from(number(seed)) / 3.0);
    }

    #[test]
    fn row_in_a_batch_is_bitwise_equal() {
        let packed = Packed::new((70, 48), |o, i| number(64 * o + i), number);
        let mut alone = vec![0.0; 70];
        packed.apply(&(0..48).map(number).collect::<Vec<_>>(), &mut alone);
        for rows in [1, 7, 63, 64, 65, 4096] {
            for row in [0, rows / 2, rows - 1] {
                let mut input: Vec<f32> = (0..48 * rows).map(|k| number(k + 9)).collect();
                input[48 * row..48 * (row + 1)].copy_from_slice(&(0..48).map(number).collect::<Vec<_>>());
                let mut output = vec![0.0; 70 * rows];
                packed.apply(&input, &mut output);
                let found = &output[70 * row..70 * (row + 1)];
                assert!(found.iter().zip(&alone).all(|(a, b)| a.to_bits() == b.to_bits()));
            }
        }
    }
}
