//! Compilation of a graph's nodes to a list of operations.

use std::collections::HashMap;

use super::error::OnnxError;
use super::input::{Input, Length};
use super::node::{Computed, Node, Value};
use super::proto::{FLOAT, ModelProto};
use super::tensor::{Constant, MAX_NUMBERS, Numbers, count};
use crate::inference::{Buffer, Operation, Port, Program, Run};

/// A program under construction.
#[derive(Default)]
pub(super) struct Compiler {
    pub(super) program: Program,
    numbers: usize,
}

/// Values of all outputs of a node.
pub(super) type Outputs = Result<Vec<Value>, OnnxError>;

impl Compiler {
    /// Counts allocated numbers against the limit.
    pub(super) fn reserve(&mut self, node: &Node<'_>, numbers: usize) -> Result<(), OnnxError> {
        self.numbers = self.numbers.saturating_add(numbers);
        if self.numbers > MAX_NUMBERS {
            return Err(node.error(format!("more than {MAX_NUMBERS} numbers in all buffers of the network")));
        }
        Ok(())
    }

    /// Counts the numbers of a tensor against the limit and returns their count.
    fn length(&mut self, node: &Node<'_>, shape: &[usize]) -> Result<usize, OnnxError> {
        let length =
            count(shape).ok_or_else(|| node.error(format!("a tensor of shape {shape:?} is too large")))?;
        self.reserve(node, length)?;
        Ok(length)
    }

    /// Allocates a buffer for a tensor.
    pub(super) fn buffer(&mut self, node: &Node<'_>, shape: &[usize]) -> Result<Buffer, OnnxError> {
        let length = self.length(node, shape)?;
        Ok(self.program.buffer(length))
    }

    /// Adds an operation that computes a tensor.
    pub(super) fn push(
        &mut self,
        node: &Node<'_>,
        operation: Operation,
        shape: Vec<usize>,
    ) -> Result<Computed, OnnxError> {
        let buffer = self.buffer(node, &shape)?;
        self.program.push_into(operation, buffer);
        Ok(Computed { shape, buffer })
    }

    /// Returns a value in a buffer; a constant is copied into one.
    pub(super) fn computed(&mut self, node: &Node<'_>, value: &Value) -> Result<Computed, OnnxError> {
        match value {
            Value::Computed(computed) => Ok(computed.clone()),
            Value::Constant(constant) => {
                self.length(node, &constant.shape)?;
                let buffer = self.program.constant(constant.to_reals());
                Ok(Computed { shape: constant.shape.clone(), buffer })
            }
        }
    }

    /// Returns input `index` of a node in a buffer.
    pub(super) fn operand(&mut self, node: &Node<'_>, index: usize) -> Result<Computed, OnnxError> {
        self.computed(node, node.input(index)?)
    }

    /// Adds an operation, or runs it immediately if all inputs of the node are constants.
    pub(super) fn fold(
        &mut self,
        node: &Node<'_>,
        operation: Operation,
        shape: Vec<usize>,
    ) -> Result<Value, OnnxError> {
        let known = node.inputs.iter().flatten().all(|value| matches!(value, Value::Constant(_)));
        if !known {
            return self.push(node, operation, shape).map(Value::Computed);
        }
        let length = self.length(node, &shape)?;
        let numbers = Numbers::Real(self.program.evaluate(operation, length));
        Ok(Value::Constant(Constant { shape, numbers }))
    }

    /// Returns a tensor with the elements of `value` at `offsets`.
    pub(super) fn pick(
        &mut self,
        node: &Node<'_>,
        value: &Value,
        shape: Vec<usize>,
        offsets: &[usize],
    ) -> Result<Value, OnnxError> {
        match value {
            Value::Constant(constant) => {
                self.reserve(node, offsets.len())?;
                Ok(Value::Constant(constant.pick(shape, offsets)))
            }
            Value::Computed(computed) => {
                let runs = runs(offsets.iter().map(|offset| (computed.buffer, *offset)));
                self.push(node, Operation::Copy(runs), shape).map(Value::Computed)
            }
        }
    }
}

/// Joins adjacent elements into runs.
pub(super) fn runs(elements: impl Iterator<Item = (Buffer, usize)>) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (to, (source, from)) in elements.enumerate() {
        match runs.last_mut() {
            Some(run) if run.source == source && run.from + run.length == from => run.length += 1,
            _ => runs.push(Run { source, from, to, length: 1 }),
        }
    }
    runs
}

/// Checks the shape of an input against the file.
fn input_shape(input: &Input, shape: &[usize]) -> Result<usize, OnnxError> {
    let error = |message| OnnxError::Input { name: input.name.clone(), message };
    let fits = |(length, found): (&Length, &usize)| match length {
        Length::Fixed(length) => length == found,
        Length::Free(_) => true,
    };
    if input.shape.len() != shape.len() || !input.shape.iter().zip(shape).all(fits) {
        let name = |length: &Length| match length {
            Length::Fixed(length) => length.to_string(),
            Length::Free(name) if name.is_empty() => "?".to_owned(),
            Length::Free(name) => name.clone(),
        };
        let expected: Vec<String> = input.shape.iter().map(name).collect();
        return Err(error(format!("shape {shape:?}, expected [{}]", expected.join(", "))));
    }
    count(shape).ok_or_else(|| error(format!("a tensor of shape {shape:?} is too large")))
}

/// Compiles a model for inputs with the given shapes.
pub(super) fn compile(
    model: &ModelProto,
    inputs: &[Input],
    shapes: &[Vec<usize>],
) -> Result<Program, OnnxError> {
    let graph = model.graph.as_ref().ok_or(OnnxError::Empty)?;
    let standard = model.opset_import.iter().find(|set| set.domain.is_empty() || set.domain == "ai.onnx");
    let opset = standard.map_or(1, |set| set.version);
    let mut compiler = Compiler::default();
    let mut values: HashMap<&str, Value> = HashMap::new();
    for tensor in &graph.initializer {
        values.insert(&tensor.name, Value::Constant(Constant::from_proto(tensor)?));
    }
    let mut shapes = shapes.iter();
    for input in inputs {
        let error = |message| OnnxError::Input { name: input.name.clone(), message };
        let info = graph.input.iter().find(|info| info.name == input.name);
        let kind = info.and_then(|info| info.kind.as_ref()).and_then(|kind| kind.tensor.as_ref());
        let kind = kind.map_or(0, |tensor| tensor.elem_type);
        if kind != FLOAT {
            return Err(error(format!("element type {kind}, expected float (1)")));
        }
        let shape = shapes.next().ok_or_else(|| error("no shape is given".to_owned()))?.clone();
        let length = input_shape(input, &shape)?;
        compiler.numbers += length;
        if compiler.numbers > MAX_NUMBERS {
            return Err(error(format!("more than {MAX_NUMBERS} numbers in all inputs")));
        }
        let buffer = compiler.program.buffer(length);
        compiler.program.push_input(Port { name: input.name.clone(), shape: shape.clone(), buffer });
        let name = info.map_or("", |info| &info.name);
        values.insert(name, Value::Computed(Computed { shape, buffer }));
    }
    for (index, proto) in graph.node.iter().enumerate() {
        let mut node = Node { proto, index, opset, inputs: Vec::new() };
        for name in &proto.input {
            let value = match &name[..] {
                "" => None,
                name => {
                    let value = values.get(name).cloned();
                    Some(value.ok_or_else(|| {
                        node.error(format!("input \"{name}\" is not computed by a previous node"))
                    })?)
                }
            };
            node.inputs.push(value);
        }
        let outputs = operator(&mut compiler, &node)?;
        for (name, value) in proto.output.iter().zip(outputs) {
            if !name.is_empty() {
                values.insert(name, value);
            }
        }
    }
    for output in &graph.output {
        let value = values.get(&output.name[..]).ok_or_else(|| OnnxError::Output(output.name.clone()))?;
        let (shape, buffer) = match value {
            Value::Computed(computed) => (computed.shape.clone(), computed.buffer),
            Value::Constant(constant) => {
                (constant.shape.clone(), compiler.program.constant(constant.to_reals()))
            }
        };
        compiler.program.push_output(Port { name: output.name.clone(), shape, buffer });
    }
    Ok(compiler.program)
}

fn operator(compiler: &mut Compiler, node: &Node<'_>) -> Outputs {
    if !matches!(&node.proto.domain[..], "" | "ai.onnx") {
        return Err(node.unsupported());
    }
    match &node.proto.op_type[..] {
        "Gemm" => compiler.gemm(node),
        "MatMul" => compiler.mat_mul(node),
        "Add" | "Sub" | "Mul" | "Div" | "Pow" | "Min" | "Max" => compiler.binary(node),
        "Neg" => compiler.neg(node),
        "Relu" | "Elu" | "LeakyRelu" | "Tanh" | "Sigmoid" | "Softplus" | "Softsign" | "Clip" | "Sqrt" => {
            compiler.unary(node)
        }
        "Constant" => Compiler::constant(node),
        "Identity" => Ok(vec![node.input(0)?.clone()]),
        "Cast" => Compiler::cast(node),
        "Shape" => Compiler::shape(node),
        "Concat" => compiler.concat(node),
        "Slice" => compiler.slice(node),
        "Split" => compiler.split(node),
        "Gather" => compiler.gather(node),
        "Reshape" | "Flatten" | "Squeeze" | "Unsqueeze" => Compiler::reshape(node),
        "Transpose" => compiler.transpose(node),
        "Expand" => compiler.expand(node),
        "ReduceMean" => compiler.reduce_mean(node),
        "LayerNormalization" => compiler.layer_norm(node),
        "BatchNormalization" => compiler.batch_norm(node),
        "Softmax" | "Hardmax" => compiler.softmax(node),
        "Conv" => compiler.conv(node),
        "MaxPool" => compiler.max_pool(node),
        "GlobalAveragePool" => compiler.global_average_pool(node),
        "GRU" | "LSTM" => compiler.recurrent(node),
        _ => Err(node.unsupported()),
    }
}
