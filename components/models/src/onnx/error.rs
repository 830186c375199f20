//! Errors of ONNX networks.

/// Error of reading or compiling a network.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OnnxError {
    /// The bytes are not a protocol buffer.
    #[error("not an ONNX file: {0}")]
    Format(String),
    /// The model has no graph.
    #[error("the file has no graph; is it an ONNX model?")]
    Empty,
    /// A constant tensor is damaged or unsupported.
    #[error("tensor \"{name}\": {message}")]
    Tensor {
        /// Name of the tensor.
        name: String,
        /// Description of the defect and of the expected value.
        message: String,
    },
    /// An operator is not supported.
    #[error(
        "node {node}: operator {operator} is not supported; help: the supported operators are listed in the docs of `motorium_models::onnx`"
    )]
    Operator {
        /// Name or index of the node.
        node: String,
        /// Name of the operator with its domain.
        operator: String,
    },
    /// A node does not match its inputs.
    #[error("node {node} ({operator}): {message}")]
    Node {
        /// Name or index of the node.
        node: String,
        /// Name of the operator.
        operator: String,
        /// Description of the defect and of the expected value.
        message: String,
    },
    /// The shape of an input is invalid.
    #[error("input \"{name}\": {message}")]
    Input {
        /// Name of the input.
        name: String,
        /// Description of the defect and of the expected shape.
        message: String,
    },
    /// No node computes this output.
    #[error("output \"{0}\" is not computed by any node")]
    Output(String),
}
