//! Writes multilayer perceptrons and gated recurrent units.

use prost::Message as _;

use super::proto::{
    Attribute, Dimension, Entry, FLOAT, GraphProto, INT64, ModelProto, NodeProto, OperatorSet, TensorProto,
    TensorShape, TensorType, TypeProto, ValueInfo,
};
use crate::inference::Unary;

/// Attribute types in the format.
const REAL: i32 = 1;
const INTEGER: i32 = 2;

pub(super) fn tensor(name: &str, shape: &[usize], values: &[f32]) -> TensorProto {
    TensorProto {
        dims: shape.iter().map(|length| *length as i64).collect(),
        data_type: FLOAT,
        name: name.to_owned(),
        raw_data: values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        ..TensorProto::default()
    }
}

pub(super) fn port(name: &str, shape: &[(usize, &str)]) -> ValueInfo {
    let dimension = |(length, name): &(usize, &str)| Dimension {
        value: name.is_empty().then_some(*length as i64),
        name: (*name).to_owned(),
    };
    let shape = TensorShape { dim: shape.iter().map(dimension).collect() };
    let tensor = TensorType { elem_type: FLOAT, shape: Some(shape) };
    ValueInfo { name: name.to_owned(), kind: Some(TypeProto { tensor: Some(tensor) }) }
}

pub(super) fn node(operator: &str, inputs: &[&str], outputs: &[&str]) -> NodeProto {
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    NodeProto {
        input: owned(inputs),
        output: owned(outputs),
        name: outputs
            .iter()
            .find(|name| !name.is_empty())
            .map_or_else(String::new, |name| format!("{operator}_{name}")),
        op_type: operator.to_owned(),
        ..NodeProto::default()
    }
}

pub(super) fn integer(name: &str, i: i64) -> Attribute {
    Attribute { name: name.to_owned(), i, kind: INTEGER, ..Attribute::default() }
}

fn real(name: &str, f: f32) -> Attribute {
    Attribute { name: name.to_owned(), f, kind: REAL, ..Attribute::default() }
}

pub(super) fn model(graph: GraphProto, metadata: &[(&str, &str)]) -> Vec<u8> {
    let entry = |(key, value): &(&str, &str)| Entry { key: (*key).to_owned(), value: (*value).to_owned() };
    let model = ModelProto {
        ir_version: 8,
        producer_name: "motorium".to_owned(),
        graph: Some(graph),
        opset_import: vec![OperatorSet { domain: String::new(), version: 17 }],
        metadata_props: metadata.iter().map(entry).collect(),
    };
    model.encode_to_vec()
}

/// Adds the node of an activation; returns the name of its output.
pub(super) fn activate(graph: &mut GraphProto, activation: Unary, input: &str) -> String {
    let output = format!("{input}_activated");
    let (operator, attribute) = match activation {
        Unary::Relu => ("Relu", None),
        Unary::Elu(alpha) => ("Elu", Some(real("alpha", alpha))),
        Unary::LeakyRelu(alpha) => ("LeakyRelu", Some(real("alpha", alpha))),
        Unary::Tanh => ("Tanh", None),
        Unary::Sigmoid => ("Sigmoid", None),
        Unary::Softplus => ("Softplus", None),
        Unary::Softsign => ("Softsign", None),
        Unary::Sqrt => ("Sqrt", None),
        Unary::Square => {
            graph.node.push(node("Mul", &[input, input], &[&output]));
            return output;
        }
        Unary::Clip(low, high) => {
            let names = [format!("{output}_min"), format!("{output}_max")];
            graph.initializer.push(tensor(&names[0], &[], &[low]));
            graph.initializer.push(tensor(&names[1], &[], &[high]));
            graph.node.push(node("Clip", &[input, &names[0], &names[1]], &[&output]));
            return output;
        }
    };
    let mut node = node(operator, &[input], &[&output]);
    node.attribute.extend(attribute);
    graph.node.push(node);
    output
}

/// Adds dense layers with an activation between them; returns the name and the width of the last layer.
pub(super) fn dense(
    graph: &mut GraphProto,
    input: (&str, usize),
    layers: &[(Vec<f32>, Vec<f32>)],
    activation: Unary,
) -> (String, usize) {
    let (mut name, mut width) = (input.0.to_owned(), input.1);
    for (index, (weights, bias)) in layers.iter().enumerate() {
        let [weight, offset] = [format!("{index}.weight"), format!("{index}.bias")];
        graph.initializer.push(tensor(&weight, &[bias.len(), width], weights));
        graph.initializer.push(tensor(&offset, &[bias.len()], bias));
        let output = format!("dense_{index}");
        let mut gemm = node("Gemm", &[&name, &weight, &offset], &[&output]);
        gemm.attribute.push(integer("transB", 1));
        graph.node.push(gemm);
        (name, width) = (output, bias.len());
        if index + 1 < layers.len() {
            name = activate(graph, activation, &name);
        }
    }
    (name, width)
}

/// Returns the bytes of an ONNX file with a multilayer perceptron, with the input `obs` (rows, `inputs`) and
/// the output `actions`. Each layer consists of its weights (outputs x inputs, row by row) and its biases;
/// `activation` is applied between layers.
///
/// ```
/// use motorium_models::{inference::Unary, onnx};
///
/// let layers = [(vec![1.0, 2.0], vec![0.5])];
/// let file = onnx::write_mlp(2, &layers, Unary::Tanh, &[("joint_names", "hip")]);
/// let model = onnx::Model::read(&file)?;
/// assert_eq!(model.metadata().next(), Some(("joint_names", "hip")));
/// let mut program = model.program(1)?;
/// program.input_mut(0).copy_from_slice(&[1.0, -1.0]);
/// program.run();
/// assert_eq!(program.output(0), [-0.5]);
/// # Ok::<(), onnx::OnnxError>(())
/// ```
pub fn write_mlp(
    inputs: usize,
    layers: &[(Vec<f32>, Vec<f32>)],
    activation: Unary,
    metadata: &[(&str, &str)],
) -> Vec<u8> {
    let mut graph = GraphProto { name: "mlp".to_owned(), ..GraphProto::default() };
    let (last, width) = dense(&mut graph, ("obs", inputs), layers, activation);
    graph.node.push(node("Identity", &[&last], &["actions"]));
    graph.input.push(port("obs", &[(0, "rows"), (inputs, "")]));
    graph.output.push(port("actions", &[(0, "rows"), (width, "")]));
    model(graph, metadata)
}

/// Returns the bytes of an ONNX file for a policy with discrete actions. A multilayer perceptron scores the
/// rows of `table`, and the output `actions` is the row with the largest score; the first row wins a tie.
/// Inputs and layers are as for [`write_mlp`]; `table` has one row for each output of the last layer.
///
/// ```
/// use motorium_models::{inference::Unary, onnx};
///
/// let layers = [(vec![1.0, -1.0, 0.0], vec![0.0, 0.0, 0.5])];
/// let file = onnx::write_choice(1, &layers, Unary::Tanh, &[7.0, -7.0, 0.0], &[]);
/// let mut program = onnx::Model::read(&file)?.program(1)?;
/// for (input, expected) in [(2.0, 7.0), (-2.0, -7.0), (0.1, 0.0)] {
///     program.input_mut(0).copy_from_slice(&[input]);
///     program.run();
///     assert_eq!(program.output(0), [expected]);
/// }
/// # Ok::<(), onnx::OnnxError>(())
/// ```
///
/// # Panics
///
/// If there is no layer, or the last layer has no output.
pub fn write_choice(
    inputs: usize,
    layers: &[(Vec<f32>, Vec<f32>)],
    activation: Unary,
    table: &[f32],
    metadata: &[(&str, &str)],
) -> Vec<u8> {
    let mut graph = GraphProto { name: "choice".to_owned(), ..GraphProto::default() };
    let (last, choices) = dense(&mut graph, ("obs", inputs), layers, activation);
    let width = choose(&mut graph, (&last, choices), table);
    graph.input.push(port("obs", &[(0, "rows"), (inputs, "")]));
    graph.output.push(port("actions", &[(0, "rows"), (width, "")]));
    model(graph, metadata)
}

/// Adds the output `actions`: the row of `table` with the largest of some numbers. Returns its width.
fn choose(graph: &mut GraphProto, (last, choices): (&str, usize), table: &[f32]) -> usize {
    let width = table.len() / choices;
    let mut largest = node("Hardmax", &[last], &["choice"]);
    largest.attribute.push(integer("axis", 1));
    graph.node.push(largest);
    graph.initializer.push(tensor("table", &[choices, width], table));
    graph.node.push(node("MatMul", &["choice", "table"], &["actions"]));
    width
}

/// Adds the output `actions`: the last layer, or the row of `table` with the largest output. Returns its
/// width.
pub(super) fn act(graph: &mut GraphProto, last: (&str, usize), table: Option<&[f32]>) -> usize {
    match table {
        Some(table) => choose(graph, last, table),
        None => {
            graph.node.push(node("Identity", &[last.0], &["actions"]));
            last.1
        }
    }
}

/// A layer of gated recurrent units (update, reset, candidate; the reset gate scales the recurrent product,
/// as in PyTorch).
#[derive(Clone, Debug, PartialEq)]
pub struct GruLayer {
    /// Number of inputs.
    pub inputs: usize,
    /// Number of units.
    pub hidden: usize,
    /// Weights of the inputs, 3 hidden x inputs, row by row, in the order update, reset, candidate.
    pub input_weights: Vec<f32>,
    /// Weights of the state, 3 hidden x hidden, row by row, in the order update, reset, candidate.
    pub state_weights: Vec<f32>,
    /// Biases: 3 hidden for the inputs, then 3 hidden for the state.
    pub bias: Vec<f32>,
}

/// Returns the bytes of an ONNX file with a GRU followed by dense layers. Each run of the network computes
/// one step. Inputs are `obs` (rows, inputs) and `h_in` (1, rows, hidden), outputs are `actions` and `h_out`.
pub fn write_gru(
    gru: &GruLayer,
    layers: &[(Vec<f32>, Vec<f32>)],
    activation: Unary,
    metadata: &[(&str, &str)],
) -> Vec<u8> {
    gru_model(gru, layers, (activation, None), metadata)
}

/// Returns the bytes of an ONNX file with a GRU followed by a discrete choice: the output `actions` is the
/// row of `table` that corresponds to the largest output of the dense layers; the first row wins a tie. The
/// inputs and the recurrent state are as for [`write_gru`].
///
/// # Panics
///
/// If there is no layer, or the last layer has no output.
pub fn write_gru_choice(
    gru: &GruLayer,
    layers: &[(Vec<f32>, Vec<f32>)],
    activation: Unary,
    table: &[f32],
    metadata: &[(&str, &str)],
) -> Vec<u8> {
    gru_model(gru, layers, (activation, Some(table)), metadata)
}

fn gru_model(
    gru: &GruLayer,
    layers: &[(Vec<f32>, Vec<f32>)],
    (activation, table): (Unary, Option<&[f32]>),
    metadata: &[(&str, &str)],
) -> Vec<u8> {
    let GruLayer { inputs, hidden, .. } = *gru;
    let mut graph = GraphProto { name: "gru".to_owned(), ..GraphProto::default() };
    graph.initializer.push(TensorProto {
        dims: vec![1],
        data_type: INT64,
        name: "first".to_owned(),
        raw_data: 0_i64.to_le_bytes().to_vec(),
        ..TensorProto::default()
    });
    graph.initializer.push(tensor("gru.weight_ih", &[1, 3 * hidden, inputs], &gru.input_weights));
    graph.initializer.push(tensor("gru.weight_hh", &[1, 3 * hidden, hidden], &gru.state_weights));
    graph.initializer.push(tensor("gru.bias", &[1, 6 * hidden], &gru.bias));
    graph.node.push(node("Unsqueeze", &["obs", "first"], &["sequence"]));
    let names = ["sequence", "gru.weight_ih", "gru.weight_hh", "gru.bias", "", "h_in"];
    let mut unit = node("GRU", &names, &["", "h_out"]);
    unit.attribute.extend([integer("hidden_size", hidden as i64), integer("linear_before_reset", 1)]);
    graph.node.push(unit);
    graph.node.push(node("Squeeze", &["h_out", "first"], &["state"]));
    let (last, outputs) = dense(&mut graph, ("state", hidden), layers, activation);
    let width = act(&mut graph, (&last, outputs), table);
    graph.input.push(port("obs", &[(0, "rows"), (inputs, "")]));
    graph.input.push(port("h_in", &[(1, ""), (0, "rows"), (hidden, "")]));
    graph.output.push(port("actions", &[(0, "rows"), (width, "")]));
    graph.output.push(port("h_out", &[(1, ""), (0, "rows"), (hidden, "")]));
    model(graph, metadata)
}
