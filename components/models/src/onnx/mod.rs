//! Networks in the ONNX format.
//!
//! A file is read into a [`Model`], which [compiles](Model::program) into a
//! [`Program`](crate::inference::Program) for given input shapes: shapes are folded, weights packed, and all
//! buffers allocated.
//!
//! Operators: Add, BatchNormalization, Cast, Clip, Concat, Constant, Conv, Div, Elu, Expand, Flatten, GRU,
//! Gather, Gemm, GlobalAveragePool, Hardmax, Identity, LSTM, LayerNormalization, LeakyRelu, MatMul, Max,
//! MaxPool, Min, Mul, Neg, Pow, ReduceMean, Relu, Reshape, Shape, Sigmoid, Slice, Softmax, Softplus,
//! Softsign, Split, Sqrt, Squeeze, Sub, Tanh, Transpose, Unsqueeze. An operator that is not in this list is
//! an error, which names the node. Source: the ONNX operator specification, operator sets 7 to 23.

mod adapt;
mod compile;
mod elementwise;
mod error;
mod input;
mod matrix;
mod movement;
mod node;
mod normal;
mod proto;
mod recurrent;
mod spatial;
mod tensor;
mod write;
mod write_convolutions;

use prost::Message as _;

use crate::inference::Program;
#[cfg(test)]
pub(crate) use adapt::split_input;
pub use adapt::{Adapter, Part};
pub use error::OnnxError;
pub use input::{Input, Length};
use proto::ModelProto;
pub use write::{GruLayer, write_choice, write_gru, write_gru_choice, write_mlp};
pub use write_convolutions::{ImageInput, write_convolutions};

/// A network as stored in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    proto: ModelProto,
}

impl Model {
    /// Reads a network from the bytes of an ONNX file.
    ///
    /// # Errors
    ///
    /// [`OnnxError`] if the bytes are not a model with a graph.
    pub fn read(bytes: &[u8]) -> Result<Self, OnnxError> {
        let proto = ModelProto::decode(bytes).map_err(|error| OnnxError::Format(error.to_string()))?;
        if proto.graph.is_none() { Err(OnnxError::Empty) } else { Ok(Self { proto }) }
    }

    /// Returns the entries of `metadata_props` as pairs of key and value, such as joint names written by
    /// exporters.
    pub fn metadata(&self) -> impl Iterator<Item = (&str, &str)> {
        self.proto.metadata_props.iter().map(|entry| (&entry.key[..], &entry.value[..]))
    }

    /// Returns the inputs to be provided by the caller, excluding inputs for which the file has a constant of
    /// the same name.
    pub fn inputs(&self) -> Vec<Input> {
        let graph = self.proto.graph.iter();
        let provided = graph.flat_map(|graph| {
            graph
                .input
                .iter()
                .filter(|input| graph.initializer.iter().all(|tensor| tensor.name != input.name))
        });
        let shape = |input: &proto::ValueInfo| {
            let tensor = input.kind.as_ref().and_then(|kind| kind.tensor.as_ref());
            let dims = tensor.and_then(|tensor| tensor.shape.as_ref()).map_or(&[][..], |shape| &shape.dim);
            let length =
                |dim: &proto::Dimension| match dim.value.and_then(|value| usize::try_from(value).ok()) {
                    Some(value) if dim.name.is_empty() => Length::Fixed(value),
                    _ => Length::Free(dim.name.clone()),
                };
            dims.iter().map(length).collect()
        };
        provided.map(|input| Input { name: input.name.clone(), shape: shape(input) }).collect()
    }

    /// Returns the names of the outputs.
    pub fn outputs(&self) -> Vec<String> {
        let graph = self.proto.graph.iter();
        graph.flat_map(|graph| graph.output.iter().map(|output| output.name.clone())).collect()
    }

    /// Compiles the network with length `rows` for every free axis.
    ///
    /// # Errors
    ///
    /// [`OnnxError`] with the name of the unsupported or mismatched node.
    pub fn program(&self, rows: usize) -> Result<Program, OnnxError> {
        let length = |length: &Length| match length {
            Length::Fixed(length) => *length,
            Length::Free(_) => rows,
        };
        let shapes: Vec<Vec<usize>> =
            self.inputs().iter().map(|input| input.shape.iter().map(length).collect()).collect();
        self.program_with(&shapes)
    }

    /// Compiles the network for inputs of these shapes, in the order of [`inputs`](Self::inputs).
    ///
    /// # Errors
    ///
    /// [`OnnxError`] with the name of the mismatched input, or of the unsupported or mismatched node.
    pub fn program_with(&self, shapes: &[Vec<usize>]) -> Result<Program, OnnxError> {
        compile::compile(&self.proto, &self.inputs(), shapes)
    }
}
