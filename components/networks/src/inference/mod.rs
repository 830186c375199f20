//! Networks as lists of operations over buffers that are allocated once: running one does not allocate.
//!
//! Sums have a fixed order (see [`Packed`]): a single row and the same row in a batch give the same bits.
//!
//! ```
//! use motorium_networks::inference::{Program, Unary};
//!
//! // 2 inputs, 2 hidden units, 1 output; weights (outputs x inputs) row by row
//! let hidden = (vec![1.0, 0.0, 0.0, -1.0], vec![0.0, 0.5]);
//! let output = (vec![1.0, 2.0], vec![0.25]);
//! let mut program = Program::<f32>::mlp(1, 2, &[hidden, output], Unary::Relu)?;
//! program.input_mut(0).copy_from_slice(&[3.0, 0.25]);
//! program.run();
//! assert_eq!(program.output(0), [3.75]);
//! # Ok::<(), motorium_networks::inference::LayerSizeError>(())
//! ```

mod convolution;
mod elementwise;
mod mlp;
mod packed;
mod recurrent;
mod reduce;

pub use convolution::{Convolution, PADDING};
pub use elementwise::{Binary, Operand, Unary};
pub use mlp::LayerSizeError;
pub use packed::Packed;
pub use recurrent::{Direction, Gates, Sequence};
pub use reduce::{Affine, Along, LayerNorm, Parts, Reduction, Softmax};

use pulp::Arch;

use crate::arithmetic::{Lanes, Real};

/// Index of a buffer of a [`Program`].
pub type Buffer = usize;

/// A run of consecutive numbers that is copied from one buffer to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// Buffer from which the numbers are read.
    pub source: Buffer,
    /// Index of the first number that is read from `source`.
    pub from: usize,
    /// Index of the first number that is written.
    pub to: usize,
    /// Count of numbers that are copied.
    pub length: usize,
}

/// Sizes and positions of matrices to be multiplied in pairs. All pairs have the same sizes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Product {
    /// Number of rows of the first matrix, number of its columns, and number of columns of the second matrix.
    pub sizes: [usize; 3],
    /// For each product, the offsets of its two matrices in their buffers.
    pub offsets: Vec<[usize; 2]>,
}

/// A layer of gated recurrent units.
#[derive(Clone, Debug)]
pub struct Recurrent<T = f32> {
    /// Forward direction, reverse direction, or both.
    pub directions: Vec<Direction<T>>,
    /// Sizes of the sequence.
    pub sequence: Sequence,
    /// Buffers of the initial state and the initial cell state; `None` starts from 0.
    pub initial: [Option<Buffer>; 2],
    /// Buffers to which the last state and the last cell state are written.
    pub last: [Buffer; 2],
}

/// An operation of a [`Program`].
#[derive(Clone, Debug)]
pub enum Operation<T = f32> {
    /// Copies runs of numbers between buffers.
    Copy(Vec<Run>),
    /// Applies a linear map to each row of a buffer.
    Linear(Buffer, Packed<T>),
    /// Multiplies pairs of matrices from two buffers.
    Product([Buffer; 2], Product),
    /// Applies a function to each number.
    Unary(Buffer, Unary),
    /// Applies a function to pairs of numbers.
    Binary([Buffer; 2], Binary, [Operand; 2]),
    /// Convolves each sample.
    Convolution(Buffer, Convolution<T>),
    /// Computes the mean or maximum of each part of a tensor.
    Reduce(Buffer, Reduction, Parts),
    /// Computes the softmax along an axis.
    Softmax(Buffer, Along),
    /// Writes 1 at the first maximum along an axis and 0 elsewhere.
    Hardmax(Buffer, Along),
    /// Normalises each row.
    LayerNorm(Buffer, LayerNorm<T>),
    /// Scales and shifts each channel.
    Affine(Buffer, Affine<T>),
    /// Runs gated recurrent units. The output is the state after each step (steps, directions, batch,
    /// hidden).
    Recurrent(Buffer, Box<Recurrent<T>>),
}

/// An input or an output of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Name of the tensor.
    pub name: String,
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// Buffer that contains the tensor.
    pub buffer: Buffer,
}

/// A network ready to run, with numbers of type `T`, by default `f32`.
#[derive(Clone, Debug, Default)]
pub struct Program<T = f32> {
    buffers: Vec<Vec<T>>,
    /// Each operation with its output buffer.
    operations: Vec<(Buffer, Operation<T>)>,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    arch: Arch,
}

impl<T: Lanes> Program<T> {
    /// Returns the inputs, in the order of the file.
    pub fn inputs(&self) -> &[Port] {
        &self.inputs
    }

    /// Returns the outputs, in the order of the file.
    pub fn outputs(&self) -> &[Port] {
        &self.outputs
    }

    /// Returns the number of operations.
    pub fn operations(&self) -> usize {
        self.operations.len()
    }

    /// Returns the buffer of an input, which must be written before [`run`](Self::run). The last axis varies
    /// fastest.
    ///
    /// # Panics
    ///
    /// If `index` is out of range.
    pub fn input_mut(&mut self, index: usize) -> &mut [T] {
        &mut self.buffers[self.inputs[index].buffer]
    }

    /// Returns the values of an output after the last run. The last axis varies fastest.
    ///
    /// # Panics
    ///
    /// If `index` is out of range.
    pub fn output(&self, index: usize) -> &[T] {
        &self.buffers[self.outputs[index].buffer]
    }

    /// Returns `true` if an output has the same values in every run.
    ///
    /// # Panics
    ///
    /// If `output` is out of range.
    pub fn is_constant(&self, output: usize) -> bool {
        let buffer = self.outputs[output].buffer;
        let is_input = self.inputs.iter().any(|input| input.buffer == buffer);
        let is_computed = self.operations.iter().any(|(target, operation)| match operation {
            Operation::Recurrent(_, recurrent) => *target == buffer || recurrent.last.contains(&buffer),
            _ => *target == buffer,
        });
        !is_input && !is_computed
    }

    /// Copies an output into an input of the same length, such as a recurrent state.
    ///
    /// # Panics
    ///
    /// If either index is out of range, or the lengths differ.
    pub fn feed_back(&mut self, output: usize, input: usize) {
        let (from, to) = (self.outputs[output].buffer, self.inputs[input].buffer);
        if from != to {
            let mut target = core::mem::take(&mut self.buffers[to]);
            target.copy_from_slice(&self.buffers[from]);
            self.buffers[to] = target;
        }
    }

    /// Computes the outputs of the network from its inputs. Does not allocate.
    pub fn run(&mut self) {
        let Self { buffers, operations, arch, .. } = self;
        for (target, operation) in operations {
            let mut output = core::mem::take(&mut buffers[*target]);
            operation.run(*arch, buffers, &mut output);
            buffers[*target] = output;
        }
    }

    /// Adds a buffer of `length` zeros and returns its index.
    pub fn buffer(&mut self, length: usize) -> Buffer {
        self.constant(vec![T::default(); length])
    }

    /// Adds a buffer with these values and returns its index.
    pub fn constant(&mut self, numbers: Vec<T>) -> Buffer {
        self.buffers.push(numbers);
        self.buffers.len() - 1
    }

    /// Adds an operation that writes to an existing buffer. Each buffer that the operation reads must have
    /// the length that the operation expects.
    pub fn push_into(&mut self, operation: Operation<T>, buffer: Buffer) {
        self.operations.push((buffer, operation));
    }

    /// Adds an operation and a new buffer for its output of `length` numbers. Returns the index of this
    /// buffer.
    pub fn push(&mut self, operation: Operation<T>, length: usize) -> Buffer {
        let buffer = self.buffer(length);
        self.push_into(operation, buffer);
        buffer
    }

    /// Adds an input.
    pub fn push_input(&mut self, input: Port) {
        self.inputs.push(input);
    }

    /// Adds an output.
    pub fn push_output(&mut self, output: Port) {
        self.outputs.push(output);
    }

    /// Runs an operation on the current content of the buffers without adding it to the program. Returns the
    /// `length` outputs of the operation.
    pub fn evaluate(&mut self, mut operation: Operation<T>, length: usize) -> Vec<T> {
        let mut output = vec![T::default(); length];
        operation.run(self.arch, &mut self.buffers, &mut output);
        output
    }
}

impl<T: Lanes> Operation<T> {
    fn run(&mut self, arch: Arch, buffers: &mut [Vec<T>], output: &mut [T]) {
        match self {
            Self::Copy(runs) => {
                for Run { source, from, to, length } in runs {
                    output[*to..*to + *length].copy_from_slice(&buffers[*source][*from..*from + *length]);
                }
            }
            Self::Linear(input, packed) => packed.apply(&buffers[*input], output),
            Self::Product([a, b], product) => product.run(&buffers[*a], &buffers[*b], output),
            Self::Unary(input, unary) => unary.apply(arch, &buffers[*input], output),
            Self::Binary([a, b], binary, operands) => {
                binary.apply(arch, (&buffers[*a], &operands[0]), (&buffers[*b], &operands[1]), output);
            }
            Self::Convolution(input, convolution) => convolution.apply(&buffers[*input], output),
            Self::Reduce(input, reduction, parts) => reduction.apply(parts, &buffers[*input], output),
            Self::Softmax(input, along) => {
                arch.dispatch(Softmax { along: *along, input: &buffers[*input], output });
            }
            Self::Hardmax(input, along) => along.hardmax(&buffers[*input], output),
            Self::LayerNorm(input, norm) => norm.apply(arch, &buffers[*input], output),
            Self::Affine(input, affine) => affine.apply(&buffers[*input], output),
            Self::Recurrent(input, recurrent) => recurrent.run(arch, *input, buffers, output),
        }
    }
}

impl Product {
    fn run<T: Real>(&self, a: &[T], b: &[T], output: &mut [T]) {
        let [rows, inner, columns] = self.sizes;
        for ([from_a, from_b], output) in self.offsets.iter().zip(output.chunks_exact_mut(rows * columns)) {
            let (a, b) = (&a[*from_a..from_a + rows * inner], &b[*from_b..from_b + inner * columns]);
            output.fill(T::default());
            for (row, output) in output.chunks_exact_mut(columns).enumerate() {
                for k in 0..inner {
                    let factor = a[row * inner + k];
                    for (output, b) in output.iter_mut().zip(&b[k * columns..]) {
                        *output += factor * *b;
                    }
                }
            }
        }
    }
}

impl<T: Lanes> Recurrent<T> {
    fn run(&mut self, arch: Arch, input: Buffer, buffers: &mut [Vec<T>], output: &mut [T]) {
        let Self { directions, sequence, initial, last } = self;
        let (state, count) = (sequence.batch * sequence.hidden, directions.len());
        for (index, direction) in directions.iter_mut().enumerate() {
            let range = index * state..(index + 1) * state;
            let initial = initial.map(|buffer| buffer.map(|buffer| &buffers[buffer][range.clone()]));
            direction.run((arch, *sequence), &buffers[input], (initial[0], initial[1]), |step, values| {
                let first = (step * count + index) * state;
                output[first..first + state].copy_from_slice(values);
            });
            buffers[last[0]][range.clone()].copy_from_slice(direction.hidden());
            buffers[last[1]][range].copy_from_slice(direction.cell());
        }
    }
}
