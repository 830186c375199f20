//! Normalisation, means and softmax.

use super::compile::{Compiler, Outputs};
use super::node::{Computed, Node, Value};
use super::tensor::strides;
use crate::inference::{Affine, Along, LayerNorm, Operation, Parts, Reduction};

impl Compiler {
    pub(super) fn reduce_mean(&mut self, node: &Node<'_>) -> Outputs {
        let Computed { shape, buffer } = self.operand(node, 0)?;
        let axes = node.listed("axes", 1)?.unwrap_or_default();
        if axes.is_empty() && node.integer("noop_with_empty_axes", 0) != 0 {
            return Ok(vec![node.input(0)?.clone()]);
        }
        let mut reduced: Vec<usize> = Vec::new();
        for axis in axes {
            reduced.push(node.axis(axis, shape.len())?);
        }
        if reduced.is_empty() {
            reduced = (0..shape.len()).collect();
        }
        let keep = node.integer("keepdims", 1) != 0;
        let is_reduced = |axis: &usize| reduced.contains(axis);
        let result = (0..shape.len()).filter(|axis| keep || !is_reduced(axis));
        let result = result.map(|axis| if is_reduced(&axis) { 1 } else { shape[axis] }).collect();
        self.reserve(node, shape.iter().product())?;
        // kept axes before reduced ones: each part is then one row
        let order: Vec<usize> = (0..shape.len())
            .filter(|axis| !is_reduced(axis))
            .chain((0..shape.len()).filter(is_reduced))
            .collect();
        let along = strides(&shape);
        let lengths: Vec<usize> = order.iter().map(|axis| shape[*axis]).collect();
        let along: Vec<usize> = order.iter().map(|axis| along[*axis]).collect();
        let offsets = super::tensor::offsets(&lengths, &along, 0);
        let part: usize = (0..shape.len()).filter(is_reduced).map(|axis| shape[axis]).product();
        if part == 0 {
            return Err(node.error(format!("a tensor of shape {shape:?} has no numbers for a mean")));
        }
        let parts = Parts {
            starts: (0..=offsets.len() / part).map(|k| (k * part) as u32).collect(),
            offsets: offsets.into_iter().map(|offset| offset as u32).collect(),
        };
        Ok(vec![self.fold(node, Operation::Reduce(buffer, Reduction::Mean, parts), result)?])
    }

    pub(super) fn layer_norm(&mut self, node: &Node<'_>) -> Outputs {
        let Computed { shape, buffer } = self.operand(node, 0)?;
        let axis = node.axis(node.integer("axis", -1), shape.len())?;
        let length: usize = shape[axis..].iter().product();
        let scale = node.reals(1)?;
        let shift = if node.optional(2).is_some() { node.reals(2)? } else { vec![0.0; length] };
        if scale.len() != length || shift.len() != length || length == 0 {
            let found = [scale.len(), shift.len()];
            return Err(node.error(format!("scale and bias of lengths {found:?}, expected {length}")));
        }
        if node.proto.output.iter().skip(1).any(|name| !name.is_empty()) {
            return Err(node.error("outputs for mean and deviation are not supported"));
        }
        let norm = LayerNorm { scale, shift, epsilon: node.real("epsilon", 1e-5) };
        Ok(vec![Value::Computed(self.push(node, Operation::LayerNorm(buffer, norm), shape)?)])
    }

    pub(super) fn batch_norm(&mut self, node: &Node<'_>) -> Outputs {
        let Computed { shape, buffer } = self.operand(node, 0)?;
        if node.integer("training_mode", 0) != 0 {
            return Err(node.error("training mode; help: export the model after `.eval()`"));
        }
        let channels = shape.get(1).copied().unwrap_or(0);
        let (scale, bias, mean, variance) = (node.reals(1)?, node.reals(2)?, node.reals(3)?, node.reals(4)?);
        let inner = shape.iter().skip(2).product();
        let lengths = [&scale, &bias, &mean, &variance].map(Vec::len);
        if lengths != [channels; 4] || channels == 0 || inner == 0 {
            let message = format!(
                "scale, bias, mean and variance of lengths {lengths:?}, expected {channels} channels"
            );
            return Err(node.error(message));
        }
        let epsilon = node.real("epsilon", 1e-5);
        let scale: Vec<f32> = scale.iter().zip(&variance).map(|(s, v)| s / (v + epsilon).sqrt()).collect();
        let shift = bias.iter().zip(&mean).zip(&scale).map(|((b, m), s)| b - m * s).collect();
        let affine = Affine { scale, shift, inner };
        Ok(vec![Value::Computed(self.push(node, Operation::Affine(buffer, affine), shape)?)])
    }

    pub(super) fn softmax(&mut self, node: &Node<'_>) -> Outputs {
        let Computed { shape, buffer } = self.operand(node, 0)?;
        let flattened = node.opset < 13;
        let axis = node.axis(node.integer("axis", if flattened { 1 } else { -1 }), shape.len())?;
        let outer = shape[..axis].iter().product();
        let behind: usize = shape[axis + 1..].iter().product();
        let along = if flattened {
            Along { outer, length: shape[axis] * behind, inner: 1 }
        } else {
            Along { outer, length: shape[axis], inner: behind }
        };
        if along.length * along.inner == 0 {
            return Err(node.error(format!("a tensor of shape {shape:?} has an empty axis")));
        }
        let operation = match &node.proto.op_type[..] {
            "Hardmax" => Operation::Hardmax(buffer, along),
            _ => Operation::Softmax(buffer, along),
        };
        Ok(vec![Value::Computed(self.push(node, operation, shape)?)])
    }
}
