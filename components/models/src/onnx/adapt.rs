//! Conversion of networks with several inputs to networks with one observation.

use prost::Message as _;

use super::proto::{GraphProto, INT64, ModelProto, TensorProto};
use super::write::{integer, node, port, tensor};
use super::{Input, Length, Model, OnnxError};

/// Mapping from one observation to the several inputs of a network, and from the network's outputs to one
/// action.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Adapter {
    /// Number of values of the observation.
    pub width: usize,
    /// For each input, the part of the observation from which the input is computed.
    pub parts: Vec<Part>,
    /// Name of the output that contains the action.
    pub action: String,
    /// Values subtracted from the action; if the list is empty, nothing is subtracted.
    pub subtract: Vec<f32>,
    /// Names of the input and output of each recurrent state.
    pub states: Vec<(String, String)>,
}

/// Source of one input in the observation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Name of the input.
    pub input: String,
    /// For each value of the input, the index of its source in the observation. With `orientation`, the
    /// indices of the three components of the direction of gravity. The list is empty for a constant input,
    /// whose values are `add`.
    pub picks: Vec<usize>,
    /// Factors of the values; empty means 1.
    pub scale: Vec<f32>,
    /// Offsets added after the factors; empty means 0.
    pub add: Vec<f32>,
    /// For an input that is a unit quaternion: the order of its values, as indices of x, y, z, w. The
    /// quaternion is the orientation with the observed direction of gravity and a heading of 0.
    pub orientation: Option<[usize; 4]>,
}

impl Part {
    /// Creates a part for the input named `input`. The part has no values yet.
    pub fn new(input: &str) -> Self {
        Self { input: input.to_owned(), ..Self::default() }
    }
}

/// Prevents a zero quaternion for an upside-down base, which becomes a rotation about x.
const UPSIDE_DOWN: f32 = 1e-6;

/// Names of added tensors.
struct Names {
    prefix: String,
    count: usize,
}

impl Names {
    fn next(&mut self) -> String {
        self.count += 1;
        format!("{}{}", self.prefix, self.count)
    }
}

/// Adds a constant, and returns its name.
fn constant(graph: &mut GraphProto, names: &mut Names, shape: &[usize], values: &[f32]) -> String {
    let name = names.next();
    graph.initializer.push(tensor(&name, shape, values));
    name
}

/// Adds constant integers, and returns their name.
fn integers(graph: &mut GraphProto, names: &mut Names, values: &[i64]) -> String {
    let name = names.next();
    graph.initializer.push(TensorProto {
        dims: vec![values.len() as i64],
        data_type: INT64,
        name: name.clone(),
        raw_data: values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        ..TensorProto::default()
    });
    name
}

/// Adds the nodes that convert a direction of gravity to a unit quaternion without heading: the shortest
/// rotation between the direction and the vertical, `(-y, x, 0, 1 - z)` before normalisation.
fn orientation(graph: &mut GraphProto, names: &mut Names, gravity: &str, order: [usize; 4]) -> String {
    let rows = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]];
    let offsets = [UPSIDE_DOWN, 0.0, 0.0, 1.0];
    let weights: Vec<f32> = order.iter().flat_map(|index| rows[*index]).collect();
    let weights = constant(graph, names, &[4, 3], &weights);
    let offsets = constant(graph, names, &[4], &order.map(|index| offsets[index]));
    let ones = constant(graph, names, &[4, 4], &[1.0; 16]);
    let [turn, squares, sums, norm, unit] = core::array::from_fn(|_| names.next());
    let mut gemm = node("Gemm", &[gravity, &weights, &offsets], &[&turn]);
    gemm.attribute.push(integer("transB", 1));
    graph.node.extend([
        gemm,
        node("Mul", &[&turn, &turn], &[&squares]),
        node("MatMul", &[&squares, &ones], &[&sums]),
        node("Sqrt", &[&sums], &[&norm]),
        node("Div", &[&turn, &norm], &[&unit]),
    ]);
    unit
}

impl Model {
    /// Returns the bytes of an equivalent network with one observation instead of several inputs.
    ///
    /// # Errors
    ///
    /// [`OnnxError::Input`] or [`OnnxError::Output`] if the adapter contains an unknown name.
    pub fn adapt(&self, adapter: &Adapter) -> Result<Vec<u8>, OnnxError> {
        adapt(&self.proto, &self.inputs(), adapter)
    }
}

/// Returns the bytes of an adapted model: input `obs` (1, width), output `actions` (1, joints), and the
/// recurrent states after both, in the order of the adapter.
fn adapt(model: &ModelProto, inputs: &[Input], adapter: &Adapter) -> Result<Vec<u8>, OnnxError> {
    let mut model = model.clone();
    let Some(source) = model.graph.take() else { return Err(OnnxError::Empty) };
    let used = || {
        let nodes = source.node.iter().flat_map(|node| node.input.iter().chain(&node.output));
        let constants = source.initializer.iter().map(|tensor| &tensor.name);
        nodes.chain(constants).chain(source.input.iter().map(|input| &input.name))
    };
    let mut names = Names { prefix: "adapter_".to_owned(), count: 0 };
    while used().any(|name| name.starts_with(&names.prefix)) {
        names.prefix.push('_');
    }
    // the network may already have tensors with these names
    let free = |name: &str| {
        let mut name = name.to_owned();
        while used().any(|other| *other == name) {
            name.push('_');
        }
        name
    };
    let (observation, action) = (free("obs"), free("actions"));
    let shape = |name: &str| {
        let input = inputs.iter().find(|input| input.name == name);
        let length = |length: &Length| match length {
            Length::Fixed(length) => *length,
            Length::Free(_) => 1,
        };
        input.map(|input| input.shape.iter().map(length).collect::<Vec<usize>>()).ok_or_else(|| {
            OnnxError::Input { name: name.to_owned(), message: "not an input of the network".to_owned() }
        })
    };
    let mut graph = GraphProto { name: source.name.clone(), ..GraphProto::default() };
    graph.initializer.clone_from(&source.initializer);
    for Part { input, picks, scale, add, orientation: order } in &adapter.parts {
        let lengths: Vec<i64> = shape(input)?.into_iter().map(|length| length as i64).collect();
        if picks.is_empty() {
            let lengths = integers(&mut graph, &mut names, &lengths);
            let value = constant(&mut graph, &mut names, &[add.len()], add);
            graph.node.push(node("Reshape", &[&value, &lengths], &[input]));
            continue;
        }
        let indices: Vec<i64> = picks.iter().map(|index| *index as i64).collect();
        let indices = integers(&mut graph, &mut names, &indices);
        let mut value = names.next();
        let mut gather = node("Gather", &[&observation, &indices], &[&value]);
        gather.attribute.push(integer("axis", 1));
        graph.node.push(gather);
        if let Some(order) = order {
            value = orientation(&mut graph, &mut names, &value, *order);
        }
        for (operator, numbers) in [("Mul", scale), ("Add", add)] {
            if !numbers.is_empty() {
                let numbers = constant(&mut graph, &mut names, &[numbers.len()], numbers);
                let result = names.next();
                graph.node.push(node(operator, &[&value, &numbers], &[&result]));
                value = result;
            }
        }
        let lengths = integers(&mut graph, &mut names, &lengths);
        graph.node.push(node("Reshape", &[&value, &lengths], &[input]));
    }
    graph.node.extend(source.node.iter().cloned());
    let find = |name: &str| source.output.iter().find(|output| output.name == name).cloned();
    let missing = |name: &str| OnnxError::Output(name.to_owned());
    find(&adapter.action).ok_or_else(|| missing(&adapter.action))?;
    let mut value = names.next();
    let row = integers(&mut graph, &mut names, &[1, -1]);
    graph.node.push(node("Reshape", &[&adapter.action, &row], &[&value]));
    if !adapter.subtract.is_empty() {
        let offsets = constant(&mut graph, &mut names, &[adapter.subtract.len()], &adapter.subtract);
        let difference = names.next();
        graph.node.push(node("Sub", &[&value, &offsets], &[&difference]));
        value = difference;
    }
    graph.node.push(node("Identity", &[&value], &[&action]));
    graph.input.push(port(&observation, &[(1, ""), (adapter.width, "")]));
    graph.output.push(port(&action, &[(1, ""), (0, "joints")]));
    for (input, output) in &adapter.states {
        shape(input)?;
        graph.input.extend(source.input.iter().find(|other| other.name == *input).cloned());
        graph.output.push(find(output).ok_or_else(|| missing(output))?);
    }
    model.graph = Some(graph);
    Ok(model.encode_to_vec())
}

/// Returns the bytes of a network with inputs of these names and shapes in place of its observation, which is
/// their concatenation.
#[cfg(test)]
pub(crate) fn split_input(bytes: &[u8], inputs: &[(&str, &[usize])]) -> Vec<u8> {
    let mut model = ModelProto::decode(bytes).expect("a model");
    let mut graph = model.graph.take().expect("a graph");
    let observation = core::mem::take(&mut graph.input).swap_remove(0).name;
    let mut names = Names { prefix: "split_".to_owned(), count: 0 };
    let (mut nodes, mut rows) = (Vec::new(), Vec::new());
    for (name, shape) in inputs {
        let shape: Vec<(usize, &str)> = shape.iter().map(|length| (*length, "")).collect();
        graph.input.push(port(name, &shape));
        let lengths = integers(&mut graph, &mut names, &[1, -1]);
        let row = names.next();
        nodes.push(node("Reshape", &[name, &lengths], &[&row]));
        rows.push(row);
    }
    let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
    let mut concat = node("Concat", &rows, &[&observation]);
    concat.attribute.push(integer("axis", 1));
    nodes.push(concat);
    nodes.append(&mut graph.node);
    graph.node = nodes;
    model.graph = Some(graph);
    model.encode_to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inference::Unary;
    use crate::onnx::{Model, write_mlp};

    /// Runs a network with one input and one output.
    fn run(bytes: &[u8], input: &[f32]) -> Vec<f32> {
        let mut program = Model::read(bytes).and_then(|model| model.program(1)).expect("a network");
        program.input_mut(0).copy_from_slice(input);
        program.run();
        program.output(0).to_vec()
    }

    /// A network that returns its inputs.
    fn identity(width: usize) -> Model {
        let weights = (0..width * width).map(|k| f32::from(u8::from(k % (width + 1) == 0))).collect();
        Model::read(&write_mlp(width, &[(weights, vec![0.0; width])], Unary::Relu, &[])).expect("a model")
    }

    fn adapter(width: usize, part: Part) -> Adapter {
        Adapter { width, parts: vec![part], action: "actions".to_owned(), ..Adapter::default() }
    }

    #[test]
    fn inputs_are_picked_and_shifted() {
        let (scale, add) = (vec![2.0, 1.0], vec![10.0, 20.0]);
        let part = Part { picks: vec![3, 0], scale, add, ..Part::new("obs") };
        let adapter = Adapter { subtract: vec![1.0, 2.0], ..adapter(4, part) };
        let bytes = identity(2).adapt(&adapter).expect("a network");
        assert_eq!(run(&bytes, &[0.5, 7.0, 7.0, -0.25]), [8.5, 18.5]);
        let names: Vec<String> =
            Model::read(&bytes).expect("a model").inputs().into_iter().map(|input| input.name).collect();
        assert_eq!(names, ["obs_"], "the name of the old input is taken");
    }

    #[test]
    fn inputs_without_picks_are_constant() {
        let bytes = identity(2).adapt(&adapter(1, Part { add: vec![3.0, -4.0], ..Part::new("obs") }));
        assert_eq!(run(&bytes.expect("a network"), &[7.0]), [3.0, -4.0]);
    }

    #[test]
    fn orientations_have_the_direction_of_gravity() {
        for (order, [x, y, z, w]) in [([0, 1, 2, 3], [0, 1, 2, 3]), ([3, 0, 1, 2], [1, 2, 3, 0])] {
            let part = Part { picks: vec![0, 1, 2], orientation: Some(order), ..Part::new("obs") };
            let bytes = identity(4).adapt(&adapter(3, part)).expect("a network");
            for gravity in [[0.0, 0.0, -1.0], [0.6, 0.0, -0.8], [-0.48, 0.6, 0.64], [0.0, 0.0, 1.0]] {
                let q = run(&bytes, &gravity).into_iter().map(f64::from).collect::<Vec<_>>();
                let found =
                    crate::policy::projected_gravity([q[x], q[y], q[z], q[w]]).expect("a unit quaternion");
                for (found, expected) in found.iter().zip(gravity) {
                    assert!((found - f64::from(expected)).abs() < 1e-5, "{gravity:?} {q:?}");
                }
            }
        }
    }

    #[test]
    fn unknown_tensors_are_named() {
        let unknown = adapter(2, Part { picks: vec![0, 1], ..Part::new("observation") });
        assert!(
            matches!(identity(2).adapt(&unknown), Err(OnnxError::Input { name, .. }) if name == "observation")
        );
        let part = Part { picks: vec![0, 1], ..Part::new("obs") };
        let unknown = Adapter { action: "targets".to_owned(), ..adapter(2, part) };
        assert_eq!(identity(2).adapt(&unknown), Err(OnnxError::Output("targets".to_owned())));
    }
}
