//! A node with its attributes and its inputs.

use super::error::OnnxError;
use super::proto::{Attribute, NodeProto};
use super::tensor::{Constant, Numbers};
use crate::inference::Buffer;

/// The value of a tensor.
#[derive(Clone, Debug)]
pub(super) enum Value {
    /// A value known when the network is compiled.
    Constant(Constant),
    /// A value in a buffer when the network runs.
    Computed(Computed),
}

/// A tensor in a buffer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Computed {
    pub(super) shape: Vec<usize>,
    pub(super) buffer: Buffer,
}

impl Value {
    pub(super) fn shape(&self) -> &[usize] {
        match self {
            Self::Constant(constant) => &constant.shape,
            Self::Computed(computed) => &computed.shape,
        }
    }
}

/// A node, its position, and the values of its inputs (`None` for an omitted optional input).
pub(super) struct Node<'a> {
    pub(super) proto: &'a NodeProto,
    pub(super) index: usize,
    pub(super) opset: i64,
    pub(super) inputs: Vec<Option<Value>>,
}

impl Node<'_> {
    fn label(&self) -> String {
        if self.proto.name.is_empty() { self.index.to_string() } else { format!("\"{}\"", self.proto.name) }
    }

    /// Creates an error of this node.
    pub(super) fn error(&self, message: impl Into<String>) -> OnnxError {
        OnnxError::Node { node: self.label(), operator: self.proto.op_type.clone(), message: message.into() }
    }

    /// Creates the error for an unsupported operator.
    pub(super) fn unsupported(&self) -> OnnxError {
        let NodeProto { domain, op_type, .. } = self.proto;
        let operator = if domain.is_empty() { op_type.clone() } else { format!("{domain}.{op_type}") };
        OnnxError::Operator { node: self.label(), operator }
    }

    pub(super) fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.proto.attribute.iter().find(|attribute| attribute.name == name)
    }

    pub(super) fn integer(&self, name: &str, default: i64) -> i64 {
        self.attribute(name).map_or(default, |attribute| attribute.i)
    }

    pub(super) fn real(&self, name: &str, default: f32) -> f32 {
        self.attribute(name).map_or(default, |attribute| attribute.f)
    }

    pub(super) fn text(&self, name: &str, default: &str) -> String {
        self.attribute(name).map_or_else(
            || default.to_owned(),
            |attribute| String::from_utf8_lossy(&attribute.s).into_owned(),
        )
    }

    pub(super) fn integers(&self, name: &str) -> Option<&[i64]> {
        self.attribute(name).map(|attribute| &attribute.ints[..])
    }

    pub(super) fn optional(&self, index: usize) -> Option<&Value> {
        self.inputs.get(index).and_then(Option::as_ref)
    }

    pub(super) fn input(&self, index: usize) -> Result<&Value, OnnxError> {
        self.optional(index).ok_or_else(|| self.error(format!("input {index} is missing")))
    }

    /// Returns an input that must be known when the network is compiled.
    pub(super) fn constant(&self, index: usize) -> Result<&Constant, OnnxError> {
        match self.input(index)? {
            Value::Constant(constant) => Ok(constant),
            Value::Computed(_) => Err(self
                .error(format!("input {index} depends on the inputs of the network, expected a constant"))),
        }
    }

    /// Returns the real numbers of an input that must be known.
    pub(super) fn reals(&self, index: usize) -> Result<Vec<f32>, OnnxError> {
        Ok(self.constant(index)?.to_reals())
    }

    /// Returns the integers of an input that must be known.
    pub(super) fn whole(&self, index: usize) -> Result<Vec<i64>, OnnxError> {
        match &self.constant(index)?.numbers {
            Numbers::Whole(values) => Ok(values.clone()),
            Numbers::Real(_) => {
                Err(self.error(format!("input {index} contains real numbers, expected integers")))
            }
        }
    }

    /// Returns the integers of an attribute, or of an input in later operator sets; `None` if both are
    /// omitted.
    pub(super) fn listed(&self, name: &str, index: usize) -> Result<Option<Vec<i64>>, OnnxError> {
        match (self.integers(name), self.optional(index)) {
            (Some(values), _) => Ok(Some(values.to_vec())),
            (None, Some(_)) => self.whole(index).map(Some),
            (None, None) => Ok(None),
        }
    }

    /// Returns the index of an axis, which counts from the end if negative.
    pub(super) fn axis(&self, axis: i64, rank: usize) -> Result<usize, OnnxError> {
        let from_start = if axis < 0 { axis.checked_add(rank as i64) } else { Some(axis) };
        from_start
            .and_then(|axis| usize::try_from(axis).ok())
            .filter(|axis| *axis < rank)
            .ok_or_else(|| self.error(format!("axis {axis} of a tensor with {rank} axes")))
    }
}
