//! Operators that move elements and change shapes.

use super::compile::{Compiler, Outputs, runs};
use super::error::OnnxError;
use super::node::{Computed, Node, Value};
use super::tensor::{Constant, Numbers, count, offsets, strides};
use crate::inference::Operation;

impl Compiler {
    pub(super) fn constant(node: &Node<'_>) -> Outputs {
        let of = |name: &str| node.attribute(name);
        let constant = if let Some(value) = of("value") {
            Constant::from_proto(
                value.t.as_ref().ok_or_else(|| node.error("attribute \"value\" has no tensor"))?,
            )?
        } else if let Some(value) = of("value_float") {
            Constant::reals(Vec::new(), vec![value.f])
        } else if let Some(value) = of("value_floats") {
            Constant::reals(vec![value.floats.len()], value.floats.clone())
        } else if let Some(value) = of("value_int") {
            Constant::scalar(value.i)
        } else if let Some(value) = of("value_ints") {
            Constant::list(value.ints.clone())
        } else {
            return Err(node.error("expected one of value, value_float, value_floats, value_int, value_ints"));
        };
        Ok(vec![Value::Constant(constant)])
    }

    pub(super) fn cast(node: &Node<'_>) -> Outputs {
        let real = match node.integer("to", 0) {
            1 | 10 | 11 | 16 => true,
            2..=7 | 9 | 12 | 13 => false,
            to => return Err(node.error(format!("element type {to}, expected a real or an integer type"))),
        };
        let value = match (node.input(0)?, real) {
            (Value::Constant(constant), _) => {
                let numbers = match (&constant.numbers, real) {
                    (_, true) => Numbers::Real(constant.to_reals()),
                    (Numbers::Real(values), false) => {
                        Numbers::Whole(values.iter().map(|value| *value as i64).collect())
                    }
                    (whole, false) => whole.clone(),
                };
                Value::Constant(Constant { shape: constant.shape.clone(), numbers })
            }
            (computed, true) => computed.clone(),
            (_, false) => return Err(node.error("computed numbers cast to integers are not supported")),
        };
        Ok(vec![value])
    }

    pub(super) fn shape(node: &Node<'_>) -> Outputs {
        let shape = node.input(0)?.shape();
        let rank = shape.len() as i64;
        let end =
            |value: i64| (if value < 0 { value.saturating_add(rank) } else { value }).clamp(0, rank) as usize;
        let (start, stop) = (end(node.integer("start", 0)), end(node.integer("end", rank)));
        let lengths = shape[start..stop.max(start)].iter().map(|length| *length as i64).collect();
        Ok(vec![Value::Constant(Constant::list(lengths))])
    }

    pub(super) fn concat(&mut self, node: &Node<'_>) -> Outputs {
        let first = node.input(0)?.shape().to_vec();
        let axis = node.axis(node.integer("axis", 0), first.len())?;
        let mut shape = first.clone();
        shape[axis] = 0;
        for index in 0..node.inputs.len() {
            let other = node.input(index)?.shape();
            let differs = |k: usize| k != axis && other[k] != first[k];
            if other.len() != first.len() || (0..first.len()).any(differs) {
                return Err(
                    node.error(format!("shapes {first:?} and {other:?} differ in axes other than {axis}"))
                );
            }
            shape[axis] += other[axis];
        }
        let total = count(&shape).ok_or_else(|| node.error(format!("shape {shape:?} is too large")))?;
        self.reserve(node, total)?;
        let outer: usize = shape[..axis].iter().product();
        let widths: Vec<usize> =
            node.inputs.iter().flatten().map(|value| value.shape()[axis..].iter().product()).collect();
        // one element in the order of the output: its input, and its offset in that input
        let elements = (0..outer).flat_map(|row| {
            let part = move |(input, width): (usize, &usize)| {
                let width = *width;
                (row * width..(row + 1) * width).map(move |offset| (input, offset))
            };
            widths.iter().enumerate().flat_map(part)
        });
        let known: Option<Vec<&Constant>> = node
            .inputs
            .iter()
            .map(|value| match value {
                Some(Value::Constant(constant)) => Some(constant),
                _ => None,
            })
            .collect();
        if let Some(known) = known {
            let whole = |constant: &&Constant| match &constant.numbers {
                Numbers::Whole(values) => Some(values.clone()),
                Numbers::Real(_) => None,
            };
            let numbers = match known.iter().map(whole).collect::<Option<Vec<_>>>() {
                Some(values) => Numbers::Whole(elements.map(|(input, k)| values[input][k]).collect()),
                None => {
                    let values: Vec<_> = known.iter().map(|constant| constant.to_reals()).collect();
                    Numbers::Real(elements.map(|(input, k)| values[input][k]).collect())
                }
            };
            return Ok(vec![Value::Constant(Constant { shape, numbers })]);
        }
        let runs = runs(elements);
        let sources: Result<Vec<Computed>, OnnxError> =
            (0..node.inputs.len()).map(|index| self.operand(node, index)).collect();
        let sources = sources?;
        let runs = runs
            .into_iter()
            .map(|run| crate::inference::Run { source: sources[run.source].buffer, ..run })
            .collect();
        Ok(vec![Value::Computed(self.push(node, Operation::Copy(runs), shape)?)])
    }

    pub(super) fn slice(&mut self, node: &Node<'_>) -> Outputs {
        let value = node.input(0)?.clone();
        let shape = value.shape();
        let required = |name: &str, index| {
            node.listed(name, index)?.ok_or_else(|| node.error(format!("{name} are missing")))
        };
        let (starts, ends) = (required("starts", 1)?, required("ends", 2)?);
        let axes = node.listed("axes", 3)?.unwrap_or_else(|| (0..starts.len() as i64).collect());
        let steps = node.listed("", 4)?.unwrap_or_else(|| vec![1; starts.len()]);
        if ends.len() != starts.len() || axes.len() != starts.len() || steps.len() != starts.len() {
            return Err(node.error("starts, ends, axes and steps differ in length"));
        }
        let along = strides(shape);
        let mut lines: Vec<Vec<usize>> = shape.iter().map(|length| (0..*length).collect()).collect();
        for (((start, end), axis), step) in starts.iter().zip(&ends).zip(&axes).zip(&steps) {
            let axis = node.axis(*axis, shape.len())?;
            let length = shape[axis] as i64;
            let wrapped = |value: i64| if value < 0 { value.saturating_add(length) } else { value };
            let (start, end) = match step.signum() {
                1 => (wrapped(*start).clamp(0, length), wrapped(*end).clamp(0, length)),
                -1 => (wrapped(*start).clamp(0, length - 1), wrapped(*end).clamp(-1, length - 1)),
                _ => return Err(node.error("a step of 0")),
            };
            let mut line = Vec::new();
            let mut k = start;
            while (*step > 0 && k < end) || (*step < 0 && k > end) {
                line.push(k as usize);
                k = k.saturating_add(*step);
            }
            lines[axis] = line;
        }
        let shape: Vec<usize> = lines.iter().map(Vec::len).collect();
        let mut found = vec![0];
        for (line, stride) in lines.iter().zip(&along) {
            found = found.iter().flat_map(|first| line.iter().map(move |k| first + k * stride)).collect();
        }
        Ok(vec![self.pick(node, &value, shape, &found)?])
    }

    pub(super) fn split(&mut self, node: &Node<'_>) -> Outputs {
        let value = node.input(0)?.clone();
        let shape = value.shape().to_vec();
        let axis = node.axis(node.integer("axis", 0), shape.len())?;
        let parts = node.proto.output.len();
        let lengths = match node.listed("split", 1)? {
            Some(lengths) => {
                lengths.iter().map(|length| usize::try_from(*length).unwrap_or(usize::MAX)).collect()
            }
            None => {
                let length = shape[axis].div_ceil(parts.max(1));
                let part = |k: usize| length.min(shape[axis].saturating_sub(k * length));
                (0..parts).map(part).collect::<Vec<_>>()
            }
        };
        let total = lengths.iter().try_fold(0_usize, |sum, length| sum.checked_add(*length));
        if total != Some(shape[axis]) || lengths.len() != parts {
            let message = format!(
                "parts of lengths {lengths:?} do not match {parts} outputs and an axis of length {}",
                shape[axis]
            );
            return Err(node.error(message));
        }
        let along = strides(&shape);
        let (mut outputs, mut first) = (Vec::new(), 0);
        for length in lengths {
            let mut part = shape.clone();
            part[axis] = length;
            let found = offsets(&part, &along, first * along[axis]);
            outputs.push(self.pick(node, &value, part, &found)?);
            first += length;
        }
        Ok(outputs)
    }

    pub(super) fn gather(&mut self, node: &Node<'_>) -> Outputs {
        let value = node.input(0)?.clone();
        let shape = value.shape();
        let axis = node.axis(node.integer("axis", 0), shape.len())?;
        let indices = node.whole(1)?;
        let indices: Result<Vec<usize>, OnnxError> =
            indices.iter().map(|index| node.axis(*index, shape[axis])).collect();
        let indices = indices.map_err(|_| {
            node.error(format!("indices are beyond the end of axis {axis}, which has length {}", shape[axis]))
        })?;
        let inner: usize = shape[axis + 1..].iter().product();
        let mut result = shape[..axis].to_vec();
        result.extend(&node.constant(1)?.shape);
        result.extend(&shape[axis + 1..]);
        let total = count(&result).ok_or_else(|| node.error(format!("shape {result:?} is too large")))?;
        self.reserve(node, total)?;
        let outer: usize = shape[..axis].iter().product();
        let block = shape[axis] * inner;
        let found: Vec<usize> = (0..outer)
            .flat_map(|row| {
                indices.iter().flat_map(move |index| (0..inner).map(move |k| row * block + index * inner + k))
            })
            .collect();
        Ok(vec![self.pick(node, &value, result, &found)?])
    }

    pub(super) fn reshape(node: &Node<'_>) -> Outputs {
        let value = node.input(0)?.clone();
        let old = value.shape();
        let total: usize = old.iter().product();
        let shape = match &node.proto.op_type[..] {
            "Flatten" => {
                let axis = match node.integer("axis", 1) {
                    axis if axis == old.len() as i64 => old.len(),
                    axis => node.axis(axis, old.len())?,
                };
                vec![old[..axis].iter().product(), old[axis..].iter().product()]
            }
            "Squeeze" => {
                let axes = match node.listed("axes", 1)? {
                    Some(axes) => {
                        axes.iter().map(|axis| node.axis(*axis, old.len())).collect::<Result<_, _>>()?
                    }
                    None => (0..old.len()).filter(|axis| old[*axis] == 1).collect::<Vec<_>>(),
                };
                if let Some(axis) = axes.iter().find(|axis| old[**axis] != 1) {
                    return Err(node.error(format!("axis {axis} has length {}, expected 1", old[*axis])));
                }
                (0..old.len()).filter(|axis| !axes.contains(axis)).map(|axis| old[axis]).collect()
            }
            "Unsqueeze" => {
                let axes = node.listed("axes", 1)?.ok_or_else(|| node.error("axes are missing"))?;
                let rank = old.len() + axes.len();
                let axes: Vec<usize> =
                    axes.iter().map(|axis| node.axis(*axis, rank)).collect::<Result<_, _>>()?;
                let mut rest = old.iter();
                let length = |axis: usize| if axes.contains(&axis) { Some(1) } else { rest.next().copied() };
                let shape: Option<Vec<usize>> = (0..rank).map(length).collect();
                shape.ok_or_else(|| node.error(format!("axes {axes:?} repeat")))?
            }
            _ => {
                let wanted = node.listed("shape", 1)?.ok_or_else(|| node.error("the shape is missing"))?;
                let keep = node.integer("allowzero", 0) == 0;
                let mut free = None;
                let mut shape = Vec::new();
                for (axis, length) in wanted.iter().enumerate() {
                    shape.push(match length {
                        -1 if free.is_none() => {
                            free = Some(axis);
                            1
                        }
                        0 if keep && axis < old.len() => old[axis],
                        0.. => *length as usize,
                        _ => return Err(node.error(format!("shape {wanted:?}"))),
                    });
                }
                if let Some(axis) = free {
                    let rest = count(&shape).filter(|rest| *rest > 0 && total.is_multiple_of(*rest));
                    let rest =
                        rest.ok_or_else(|| node.error(format!("shape {old:?} cannot become {wanted:?}")))?;
                    shape[axis] = total / rest;
                }
                shape
            }
        };
        if count(&shape) != Some(total) {
            return Err(node.error(format!("shape {old:?} cannot become {shape:?}")));
        }
        Ok(vec![match value {
            Value::Constant(constant) => Value::Constant(Constant { shape, ..constant }),
            Value::Computed(computed) => Value::Computed(Computed { shape, ..computed }),
        }])
    }

    pub(super) fn transpose(&mut self, node: &Node<'_>) -> Outputs {
        let value = node.input(0)?.clone();
        let rank = value.shape().len();
        let order = match node.integers("perm") {
            Some(order) => order.iter().map(|axis| node.axis(*axis, rank)).collect::<Result<_, _>>()?,
            None => (0..rank).rev().collect::<Vec<_>>(),
        };
        if order.len() != rank || (0..rank).any(|axis| !order.contains(&axis)) {
            return Err(node.error(format!("perm {order:?} does not list each of {rank} axes once")));
        }
        Ok(vec![self.permuted(node, &value, &order)?])
    }

    /// Returns a tensor with permuted axes.
    pub(super) fn permuted(
        &mut self,
        node: &Node<'_>,
        value: &Value,
        order: &[usize],
    ) -> Result<Value, OnnxError> {
        let old = value.shape();
        let along = strides(old);
        let shape: Vec<usize> = order.iter().map(|axis| old[*axis]).collect();
        let along: Vec<usize> = order.iter().map(|axis| along[*axis]).collect();
        let found = offsets(&shape, &along, 0);
        self.pick(node, value, shape, &found)
    }

    pub(super) fn expand(&mut self, node: &Node<'_>) -> Outputs {
        let value = node.input(0)?.clone();
        let wanted: Option<Vec<usize>> =
            node.whole(1)?.iter().map(|length| usize::try_from(*length).ok()).collect();
        let wanted = wanted.ok_or_else(|| node.error("a negative length"))?;
        let shape = broadcast(node, value.shape(), &wanted)?;
        let found = broadcast_offsets(value.shape(), &shape);
        Ok(vec![self.pick(node, &value, shape, &found)?])
    }
}

/// Returns the broadcast shape of two tensors: lengths of 1 are expanded.
pub(super) fn broadcast(node: &Node<'_>, a: &[usize], b: &[usize]) -> Result<Vec<usize>, OnnxError> {
    let rank = a.len().max(b.len());
    let length = |shape: &[usize], axis: usize| match (axis + shape.len()).checked_sub(rank) {
        Some(axis) => shape[axis],
        None => 1,
    };
    let shape: Option<Vec<usize>> = (0..rank)
        .map(|axis| match (length(a, axis), length(b, axis)) {
            (1, other) | (other, 1) => Some(other),
            (a, b) if a == b => Some(a),
            _ => None,
        })
        .collect();
    shape
        .filter(|shape| count(shape).is_some())
        .ok_or_else(|| node.error(format!("shapes {a:?} and {b:?} do not broadcast")))
}

/// Returns, for each element of `to`, the offset in a tensor of shape `from` that is broadcast to it.
pub(super) fn broadcast_offsets(from: &[usize], to: &[usize]) -> Vec<usize> {
    let along = strides(from);
    let missing = to.len() - from.len();
    let stride = |axis: usize| match axis.checked_sub(missing) {
        Some(axis) if from[axis] != 1 => along[axis],
        _ => 0,
    };
    let along: Vec<usize> = (0..to.len()).map(stride).collect();
    offsets(to, &along, 0)
}
