//! GRU and LSTM.

use super::compile::{Compiler, Outputs};
use super::node::{Computed, Node, Value};
use crate::inference::{Direction, Gates, Operation, Packed, Recurrent, Sequence};

impl Compiler {
    pub(super) fn recurrent(&mut self, node: &Node<'_>) -> Outputs {
        let lstm = node.proto.op_type == "LSTM";
        let count = if lstm { 4 } else { 3 };
        let Computed { shape, buffer } = self.operand(node, 0)?;
        let reversed: &[bool] = match &node.text("direction", "forward")[..] {
            "forward" => &[false],
            "reverse" => &[true],
            "bidirectional" => &[false, true],
            direction => return Err(node.error(format!("direction \"{direction}\""))),
        };
        let directions = reversed.len();
        if node.integer("layout", 0) != 0 {
            return Err(node.error("layout 1 (batch first) is not supported; help: export with layout 0"));
        }
        if node.optional(4).is_some() {
            return Err(
                node.error("sequence lengths (input 4) are not supported; help: pass whole sequences")
            );
        }
        if node.optional(7).is_some() {
            return Err(node.error("peephole weights (input 7) are not supported"));
        }
        if node.attribute("clip").is_some() || node.integer("input_forget", 0) != 0 {
            return Err(node.error("clip and input_forget are not supported"));
        }
        if let Some(names) = node.attribute("activations") {
            let standard: &[&str] = if lstm { &["Sigmoid", "Tanh", "Tanh"] } else { &["Sigmoid", "Tanh"] };
            let standard = standard.iter().cycle().take(standard.len() * directions);
            let names = names.strings.iter().map(|name| String::from_utf8_lossy(name).to_lowercase());
            if !names.clone().eq(standard.map(|name| name.to_lowercase())) {
                let names: Vec<_> = names.collect();
                return Err(node.error(format!("activations {names:?}, expected Sigmoid and Tanh")));
            }
        }
        let (weights, products) = (node.constant(1)?.clone(), node.constant(2)?.clone());
        let hidden = products.shape.last().copied().unwrap_or(0);
        let [steps, batch, inputs] = shape[..] else {
            return Err(node.error(format!("an input of shape {shape:?}, expected steps, batch and inputs")));
        };
        let gates = count * hidden;
        let fits = hidden > 0
            && inputs > 0
            && weights.shape == [directions, gates, inputs]
            && products.shape == [directions, gates, hidden];
        if !fits {
            let message = format!(
                "weights of shapes {:?} and {:?} do not match {directions} directions and an input of shape \
                 {shape:?}",
                weights.shape, products.shape
            );
            return Err(node.error(message));
        }
        let bias =
            if node.optional(3).is_some() { node.reals(3)? } else { vec![0.0; directions * 2 * gates] };
        if bias.len() != directions * 2 * gates {
            return Err(node.error(format!("{} biases, expected {}", bias.len(), directions * 2 * gates)));
        }
        let sequence = Sequence { steps, batch, hidden };
        let sizes = [steps, batch, gates].iter().try_fold(1_usize, |sum, n| sum.checked_mul(*n));
        let sizes = sizes.and_then(|size| size.checked_mul(2 * directions)).unwrap_or(usize::MAX);
        self.reserve(node, sizes)?;
        self.reserve(node, 2 * directions * gates * (inputs + hidden + 2))?;
        let (weights, products) = (weights.to_reals(), products.to_reals());
        let reset_first = node.integer("linear_before_reset", 0) == 0;
        let direction = |(index, reversed): (usize, &bool)| {
            let weights = &weights[index * gates * inputs..];
            let products = &products[index * gates * hidden..];
            let bias = &bias[index * 2 * gates..];
            let input = Packed::new((gates, inputs), |o, i| weights[o * inputs + i], |o| bias[o]);
            let part = |first: usize, outputs: usize| {
                let weight = move |o: usize, i: usize| products[(first + o) * hidden + i];
                Packed::new((outputs, hidden), weight, move |o| bias[gates + first + o])
            };
            let gates = match (lstm, reset_first) {
                (true, _) => Gates::Lstm { input, state: part(0, gates) },
                (false, false) => Gates::Gru { input, state: part(0, gates) },
                (false, true) => Gates::GruResetFirst {
                    input,
                    state: part(0, 2 * hidden),
                    candidate: part(2 * hidden, hidden),
                },
            };
            Direction::new(gates, *reversed, sequence)
        };
        let mut initial = [None, None];
        for (state, index) in initial.iter_mut().zip([5, 6]).take(if lstm { 2 } else { 1 }) {
            if node.optional(index).is_some() {
                let Computed { shape, buffer } = self.operand(node, index)?;
                if shape != [directions, batch, hidden] {
                    let expected = [directions, batch, hidden];
                    return Err(
                        node.error(format!("input {index} has the shape {shape:?}, expected {expected:?}"))
                    );
                }
                *state = Some(buffer);
            }
        }
        let state = vec![directions, batch, hidden];
        let last = [self.buffer(node, &state)?, self.buffer(node, &state)?];
        let directions: Vec<Direction> = reversed.iter().enumerate().map(direction).collect();
        let shape = vec![steps, directions.len(), batch, hidden];
        let recurrent = Recurrent { directions, sequence, initial, last };
        let all = self.push(node, Operation::Recurrent(buffer, Box::new(recurrent)), shape)?;
        let [hidden, cell] = last.map(|buffer| Value::Computed(Computed { shape: state.clone(), buffer }));
        Ok(vec![Value::Computed(all), hidden, cell])
    }
}
