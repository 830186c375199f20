//! Gated recurrent units and long short-term memories over sequences.

use pulp::{Arch, Simd, WithSimd};

use super::Packed;
use crate::arithmetic::{Lanes, Real};

/// Sizes of the sequences that a recurrent layer processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// Number of steps of a sequence.
    pub steps: usize,
    /// Number of parallel sequences.
    pub batch: usize,
    /// Number of hidden units.
    pub hidden: usize,
}

/// Gates of a recurrent layer in one direction.
#[derive(Clone, Debug)]
pub enum Gates<T = f32> {
    /// A gated recurrent unit with the gates update, reset and candidate. The reset gate scales the recurrent
    /// product (as in PyTorch).
    Gru {
        /// Map from inputs to the three gates.
        input: Packed<T>,
        /// Map from the state to the three gates.
        state: Packed<T>,
    },
    /// A gated recurrent unit with the gates update, reset and candidate. The reset gate scales the state
    /// before the product.
    GruResetFirst {
        /// Map from inputs to the three gates.
        input: Packed<T>,
        /// Map from the state to the update and reset gates.
        state: Packed<T>,
        /// Map from the scaled state to the candidate.
        candidate: Packed<T>,
    },
    /// Long short-term memory with the gates input, output, forget and cell.
    Lstm {
        /// Map from inputs to the four gates.
        input: Packed<T>,
        /// Map from the state to the four gates.
        state: Packed<T>,
    },
}

/// One direction of a recurrent layer, with its workspace.
#[derive(Clone, Debug)]
pub struct Direction<T = f32> {
    gates: Gates<T>,
    /// `true` to run from the last step to the first.
    reversed: bool,
    /// Input contributions to the gates of all steps.
    from_input: Vec<T>,
    /// State contributions to the gates of one step.
    from_state: Vec<T>,
    /// The scaled state, and its candidate.
    scaled: Vec<T>,
    hidden: Vec<T>,
    cell: Vec<T>,
}

impl<T: Lanes> Direction<T> {
    /// Creates a direction that runs forward, from the first step to the last step, or in reverse.
    pub fn new(gates: Gates<T>, reversed: bool, sequence: Sequence) -> Self {
        let (rows, state) = (sequence.steps * sequence.batch, sequence.batch * sequence.hidden);
        let count = if matches!(gates, Gates::Lstm { .. }) { 4 } else { 3 };
        Self {
            gates,
            reversed,
            from_input: vec![T::default(); count * rows * sequence.hidden],
            from_state: vec![T::default(); count * state],
            scaled: vec![T::default(); 2 * state],
            hidden: vec![T::default(); state],
            cell: vec![T::default(); state],
        }
    }

    /// Runs over an input sequence (steps, batch, inputs). `initial` contains the initial state and the
    /// initial cell state (batch, hidden); `None` starts from 0. Calls `record` with the index of each step
    /// and the state after that step.
    pub fn run(
        &mut self,
        (arch, sequence): (Arch, Sequence),
        input: &[T],
        initial: (Option<&[T]>, Option<&[T]>),
        mut record: impl FnMut(usize, &[T]),
    ) {
        for (state, initial) in [(&mut self.hidden, initial.0), (&mut self.cell, initial.1)] {
            match initial {
                Some(initial) => state.copy_from_slice(initial),
                None => state.fill(T::default()),
            }
        }
        let (Gates::Gru { input: map, .. }
        | Gates::GruResetFirst { input: map, .. }
        | Gates::Lstm { input: map, .. }) = &self.gates;
        map.apply(input, &mut self.from_input);
        let width = self.from_state.len();
        let hidden = sequence.hidden;
        for k in 0..sequence.steps {
            let step = if self.reversed { sequence.steps - 1 - k } else { k };
            let from_input = &self.from_input[step * width..(step + 1) * width];
            match &self.gates {
                Gates::Gru { state, .. } => {
                    state.apply(&self.hidden, &mut self.from_state);
                    let (from_state, state) = (&self.from_state, &mut self.hidden);
                    arch.dispatch(Gru { hidden, from_input, from_state, state });
                }
                Gates::GruResetFirst { state, candidate, .. } => {
                    let from_state = &mut self.from_state[..2 * self.hidden.len()];
                    state.apply(&self.hidden, from_state);
                    let (scaled, product) = self.scaled.split_at_mut(self.hidden.len());
                    let state = &self.hidden;
                    arch.dispatch(Reset { hidden, from_input, from_state, state, scaled });
                    candidate.apply(scaled, product);
                    let state = &mut self.hidden;
                    arch.dispatch(ResetFirst { hidden, from_input, from_state, product, state });
                }
                Gates::Lstm { state, .. } => {
                    state.apply(&self.hidden, &mut self.from_state);
                    let from_state = &self.from_state;
                    let (state, cell) = (&mut self.hidden, &mut self.cell);
                    arch.dispatch(Lstm { hidden, from_input, from_state, state, cell });
                }
            }
            record(step, &self.hidden);
        }
    }

    /// Returns the state (batch, hidden) after the last step.
    pub fn hidden(&self) -> &[T] {
        &self.hidden
    }

    /// Returns the cell state (batch, hidden) after the last step; 0 for gated recurrent units.
    pub fn cell(&self) -> &[T] {
        &self.cell
    }
}

struct Gru<'a, T> {
    hidden: usize,
    from_input: &'a [T],
    from_state: &'a [T],
    state: &'a mut [T],
}

impl<T: Real> WithSimd for Gru<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let n = self.hidden;
        let rows = self.from_input.chunks_exact(3 * n).zip(self.from_state.chunks_exact(3 * n));
        for ((x, h), state) in rows.zip(self.state.chunks_exact_mut(n)) {
            let ((xz, x), (hz, h)) = (x.split_at(n), h.split_at(n));
            let ((xr, xc), (hr, hc)) = (x.split_at(n), h.split_at(n));
            for k in 0..n {
                let update = Real::sigmoid(xz[k] + hz[k]);
                let reset = Real::sigmoid(xr[k] + hr[k]);
                let candidate = Real::tanh(xc[k] + reset * hc[k]);
                state[k] = (T::from_f32(1.0) - update) * candidate + update * state[k];
            }
        }
    }
}

struct Reset<'a, T> {
    hidden: usize,
    from_input: &'a [T],
    from_state: &'a [T],
    state: &'a [T],
    scaled: &'a mut [T],
}

impl<T: Real> WithSimd for Reset<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let n = self.hidden;
        let rows = self.from_input.chunks_exact(3 * n).zip(self.from_state.chunks_exact(2 * n));
        let states = self.state.chunks_exact(n).zip(self.scaled.chunks_exact_mut(n));
        for ((x, h), (state, scaled)) in rows.zip(states) {
            let (xr, hr) = (&x[n..2 * n], &h[n..]);
            for k in 0..n {
                scaled[k] = Real::sigmoid(xr[k] + hr[k]) * state[k];
            }
        }
    }
}

struct ResetFirst<'a, T> {
    hidden: usize,
    from_input: &'a [T],
    from_state: &'a [T],
    product: &'a [T],
    state: &'a mut [T],
}

impl<T: Real> WithSimd for ResetFirst<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let n = self.hidden;
        let rows = self.from_input.chunks_exact(3 * n).zip(self.from_state.chunks_exact(2 * n));
        let states = self.state.chunks_exact_mut(n).zip(self.product.chunks_exact(n));
        for ((x, h), (state, product)) in rows.zip(states) {
            let (xz, xc, hz) = (&x[..n], &x[2 * n..], &h[..n]);
            for k in 0..n {
                let update = Real::sigmoid(xz[k] + hz[k]);
                let candidate = Real::tanh(xc[k] + product[k]);
                state[k] = (T::from_f32(1.0) - update) * candidate + update * state[k];
            }
        }
    }
}

struct Lstm<'a, T> {
    hidden: usize,
    from_input: &'a [T],
    from_state: &'a [T],
    state: &'a mut [T],
    cell: &'a mut [T],
}

impl<T: Real> WithSimd for Lstm<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let n = self.hidden;
        let rows = self.from_input.chunks_exact(4 * n).zip(self.from_state.chunks_exact(4 * n));
        let states = self.state.chunks_exact_mut(n).zip(self.cell.chunks_exact_mut(n));
        for ((x, h), (state, cell)) in rows.zip(states) {
            for k in 0..n {
                let gate = |index: usize| x[index * n + k] + h[index * n + k];
                let (input, output) = (Real::sigmoid(gate(0)), Real::sigmoid(gate(1)));
                let (forget, candidate) = (Real::sigmoid(gate(2)), Real::tanh(gate(3)));
                cell[k] = forget * cell[k] + input * candidate;
                state[k] = output * Real::tanh(cell[k]);
            }
        }
    }
}
