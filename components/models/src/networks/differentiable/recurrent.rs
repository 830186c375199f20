//! Gated recurrent units and long short-term memories, differentiated through time.

use super::{Backward, Forward, Layer, affine, affine_backward};
use crate::arithmetic::Real;

/// A layer of gated recurrent units over a sequence. The reset gate scales the recurrent product, as in
/// PyTorch.
///
/// A row of inputs is the initial state (hidden), then the inputs of each step. A row of outputs is the state
/// after each step. Parameters: input weights (3 hidden x inputs), state weights (3 hidden x hidden), input
/// biases and state biases (3 hidden each); gates in the order update, reset, candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gru {
    /// Number of inputs of a step, at least 1.
    pub inputs: usize,
    /// Number of units, at least 1.
    pub hidden: usize,
    /// Number of steps of the sequence.
    pub steps: usize,
}

/// A layer of long short-term memory units over a sequence.
///
/// A row of inputs is the initial state (hidden), the initial cell state (hidden), then the inputs of each
/// step. A row of outputs is the state after each step, then the last cell state. Parameters: input weights
/// (4 hidden x inputs), state weights (4 hidden x hidden), input biases and state biases (4 hidden each);
/// gates in the order input, output, forget, cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lstm {
    /// Number of inputs of a step, at least 1.
    pub inputs: usize,
    /// Number of units, at least 1.
    pub hidden: usize,
    /// Number of steps of the sequence.
    pub steps: usize,
}

/// Parameters in four parts: input weights, state weights, input biases, state biases.
fn parts<T>(parameters: &[T], gates: usize, inputs: usize, hidden: usize) -> [&[T]; 4] {
    let (input, rest) = parameters.split_at(gates * inputs);
    let (state, rest) = rest.split_at(gates * hidden);
    let (bias, rest) = rest.split_at(gates);
    [input, state, bias, &rest[..gates]]
}

fn parts_mut<T>(parameters: &mut [T], gates: usize, inputs: usize, hidden: usize) -> [&mut [T]; 4] {
    let (input, rest) = parameters.split_at_mut(gates * inputs);
    let (state, rest) = rest.split_at_mut(gates * hidden);
    let (bias, rest) = rest.split_at_mut(gates);
    [input, state, bias, &mut rest[..gates]]
}

impl Layer for Gru {
    fn inputs(&self) -> usize {
        self.hidden + self.steps * self.inputs
    }

    fn outputs(&self) -> usize {
        self.steps * self.hidden
    }

    fn parameters(&self) -> usize {
        3 * self.hidden * (self.inputs + self.hidden + 2)
    }

    /// For each step, the gates from the inputs and from the state.
    fn trace(&self) -> usize {
        6 * self.hidden * self.steps
    }

    fn forward<T: Real>(&self, pass: Forward<'_, T>) {
        let n = self.hidden;
        let [weights, products, bias, state_bias] = parts(pass.parameters, 3 * n, self.inputs, n);
        let one = T::from_f64(1.0);
        let rows = pass.input.chunks_exact(self.inputs()).zip(pass.output.chunks_exact_mut(self.outputs()));
        for ((input, output), trace) in rows.zip(pass.trace.chunks_exact_mut(self.trace())) {
            let (initial, inputs) = input.split_at(n);
            let steps = inputs.chunks_exact(self.inputs).zip(trace.chunks_exact_mut(6 * n));
            for (step, (input, trace)) in steps.enumerate() {
                let (before, now) = output.split_at_mut(step * n);
                let state = if step == 0 { initial } else { &before[(step - 1) * n..] };
                let (x, h) = trace.split_at_mut(3 * n);
                affine(weights, bias, input, x);
                affine(products, state_bias, state, h);
                for k in 0..n {
                    let update = (x[k] + h[k]).sigmoid();
                    let reset = (x[n + k] + h[n + k]).sigmoid();
                    let candidate = (x[2 * n + k] + reset * h[2 * n + k]).tanh();
                    now[k] = (one - update) * candidate + update * state[k];
                }
            }
        }
    }

    fn backward<T: Real>(&self, pass: Backward<'_, T>) {
        let n = self.hidden;
        let [weights, products, ..] = parts(pass.parameters, 3 * n, self.inputs, n);
        let [to_weights, to_products, to_bias, to_state_bias] =
            parts_mut(pass.parameter_gradient, 3 * n, self.inputs, n);
        let one = T::from_f64(1.0);
        let (mut from_x, mut from_h) = (vec![T::default(); 3 * n], vec![T::default(); 3 * n]);
        let mut by_state = vec![T::default(); n];
        let rows = pass.input.chunks_exact(self.inputs()).zip(pass.output.chunks_exact(self.outputs()));
        let rows = rows.zip(pass.trace.chunks_exact(self.trace()));
        let gradients = pass.gradient.chunks_exact(self.outputs());
        let gradients = gradients.zip(pass.input_gradient.chunks_exact_mut(self.inputs()));
        for (((input, output), trace), (gradient, out)) in rows.zip(gradients) {
            out.fill(T::default());
            by_state.fill(T::default());
            let (initial, inputs) = input.split_at(n);
            let (to_initial, to_inputs) = out.split_at_mut(n);
            for step in (0..self.steps).rev() {
                let state = if step == 0 { initial } else { &output[(step - 1) * n..step * n] };
                let (x, h) = trace[6 * n * step..6 * n * (step + 1)].split_at(3 * n);
                for k in 0..n {
                    let update = (x[k] + h[k]).sigmoid();
                    let reset = (x[n + k] + h[n + k]).sigmoid();
                    let candidate = (x[2 * n + k] + reset * h[2 * n + k]).tanh();
                    let g = gradient[step * n + k] + by_state[k];
                    let by_candidate = g * (one - update) * (one - candidate * candidate);
                    let by_update = g * (state[k] - candidate) * update * (one - update);
                    let by_reset = by_candidate * h[2 * n + k] * reset * (one - reset);
                    (from_x[k], from_x[n + k], from_x[2 * n + k]) = (by_update, by_reset, by_candidate);
                    (from_h[k], from_h[n + k], from_h[2 * n + k]) =
                        (by_update, by_reset, by_candidate * reset);
                    by_state[k] = g * update;
                }
                affine_backward(
                    products,
                    (state, &from_h),
                    &mut by_state,
                    (&mut *to_products, &mut *to_state_bias),
                );
                let range = step * self.inputs..(step + 1) * self.inputs;
                let row = (&inputs[range.clone()], &from_x[..]);
                affine_backward(weights, row, &mut to_inputs[range], (&mut *to_weights, &mut *to_bias));
            }
            to_initial.copy_from_slice(&by_state);
        }
    }
}

impl Layer for Lstm {
    fn inputs(&self) -> usize {
        2 * self.hidden + self.steps * self.inputs
    }

    fn outputs(&self) -> usize {
        (self.steps + 1) * self.hidden
    }

    fn parameters(&self) -> usize {
        4 * self.hidden * (self.inputs + self.hidden + 2)
    }

    /// For each step, the gates from the inputs and from the state, and the cell state.
    fn trace(&self) -> usize {
        9 * self.hidden * self.steps
    }

    fn forward<T: Real>(&self, pass: Forward<'_, T>) {
        let n = self.hidden;
        let [weights, products, bias, state_bias] = parts(pass.parameters, 4 * n, self.inputs, n);
        let rows = pass.input.chunks_exact(self.inputs()).zip(pass.output.chunks_exact_mut(self.outputs()));
        for ((input, output), trace) in rows.zip(pass.trace.chunks_exact_mut(self.trace())) {
            let (initial, inputs) = input.split_at(2 * n);
            let (output, last) = output.split_at_mut(self.steps * n);
            last.copy_from_slice(&initial[n..]);
            let steps = inputs.chunks_exact(self.inputs).zip(trace.chunks_exact_mut(9 * n));
            for (step, (input, trace)) in steps.enumerate() {
                let (before, now) = output.split_at_mut(step * n);
                let state = if step == 0 { &initial[..n] } else { &before[(step - 1) * n..] };
                let (x, rest) = trace.split_at_mut(4 * n);
                let (h, cell) = rest.split_at_mut(4 * n);
                affine(weights, bias, input, x);
                affine(products, state_bias, state, h);
                for k in 0..n {
                    let gate = |index: usize| x[index * n + k] + h[index * n + k];
                    let (input, output) = (gate(0).sigmoid(), gate(1).sigmoid());
                    cell[k] = gate(2).sigmoid() * last[k] + input * gate(3).tanh();
                    now[k] = output * cell[k].tanh();
                }
                last.copy_from_slice(cell);
            }
        }
    }

    fn backward<T: Real>(&self, pass: Backward<'_, T>) {
        let n = self.hidden;
        let [weights, products, ..] = parts(pass.parameters, 4 * n, self.inputs, n);
        let [to_weights, to_products, to_bias, to_state_bias] =
            parts_mut(pass.parameter_gradient, 4 * n, self.inputs, n);
        let one = T::from_f64(1.0);
        let (mut by_gates, mut by_state) = (vec![T::default(); 4 * n], vec![T::default(); n]);
        let mut by_cell = vec![T::default(); n];
        let rows = pass.input.chunks_exact(self.inputs()).zip(pass.output.chunks_exact(self.outputs()));
        let rows = rows.zip(pass.trace.chunks_exact(self.trace()));
        let gradients = pass.gradient.chunks_exact(self.outputs());
        let gradients = gradients.zip(pass.input_gradient.chunks_exact_mut(self.inputs()));
        for (((input, output), trace), (gradient, out)) in rows.zip(gradients) {
            out.fill(T::default());
            by_state.fill(T::default());
            by_cell.copy_from_slice(&gradient[self.steps * n..]);
            let (initial, inputs) = input.split_at(2 * n);
            let (to_initial, to_inputs) = out.split_at_mut(2 * n);
            for step in (0..self.steps).rev() {
                let part = |step: usize| &trace[9 * n * step..9 * n * (step + 1)];
                let (state, before) = if step == 0 {
                    initial.split_at(n)
                } else {
                    (&output[(step - 1) * n..step * n], &part(step - 1)[8 * n..])
                };
                let (x, h, cell) = (&part(step)[..4 * n], &part(step)[4 * n..8 * n], &part(step)[8 * n..]);
                for k in 0..n {
                    let gate = |index: usize| x[index * n + k] + h[index * n + k];
                    let (input, output) = (gate(0).sigmoid(), gate(1).sigmoid());
                    let (forget, candidate) = (gate(2).sigmoid(), gate(3).tanh());
                    let g = gradient[step * n + k] + by_state[k];
                    let curved = cell[k].tanh();
                    let by = by_cell[k] + g * output * (one - curved * curved);
                    by_gates[k] = by * candidate * input * (one - input);
                    by_gates[n + k] = g * curved * output * (one - output);
                    by_gates[2 * n + k] = by * before[k] * forget * (one - forget);
                    by_gates[3 * n + k] = by * input * (one - candidate * candidate);
                    by_cell[k] = by * forget;
                }
                by_state.fill(T::default());
                affine_backward(
                    products,
                    (state, &by_gates),
                    &mut by_state,
                    (&mut *to_products, &mut *to_state_bias),
                );
                let range = step * self.inputs..(step + 1) * self.inputs;
                let row = (&inputs[range.clone()], &by_gates[..]);
                affine_backward(weights, row, &mut to_inputs[range], (&mut *to_weights, &mut *to_bias));
            }
            to_initial[..n].copy_from_slice(&by_state);
            to_initial[n..].copy_from_slice(&by_cell);
        }
    }
}
