//! Products of matrices.

use super::compile::{Compiler, Outputs};
use super::error::OnnxError;
use super::movement::{broadcast, broadcast_offsets};
use super::node::{Computed, Node, Value};
use super::tensor::{Constant, count};
use crate::inference::{Binary, Operand, Operation, Packed, Product};

impl Compiler {
    /// `alpha A' B' + beta C`.
    pub(super) fn gemm(&mut self, node: &Node<'_>) -> Outputs {
        let (alpha, beta) = (node.real("alpha", 1.0), node.real("beta", 1.0));
        let mut sides = Vec::new();
        for (index, name) in ["transA", "transB"].into_iter().enumerate() {
            let value = node.input(index)?.clone();
            if value.shape().len() != 2 {
                let message = format!("input {index} has the shape {:?}, expected a matrix", value.shape());
                return Err(node.error(message));
            }
            let transposed = node.integer(name, 0) != 0;
            sides.push(if transposed { self.permuted(node, &value, &[1, 0])? } else { value });
        }
        let [a, b] = [sides[0].clone(), sides[1].clone()];
        let (rows, inner) = (a.shape()[0], a.shape()[1]);
        let columns = b.shape()[1];
        if b.shape()[0] != inner {
            return Err(node.error(format!("matrices {:?} and {:?} do not fit", a.shape(), b.shape())));
        }
        let shape = vec![rows, columns];
        let a = self.computed(node, &a)?;
        let mut rest = node.optional(2).cloned();
        let computed = if let Value::Constant(weights) = &b {
            let weights = weights.to_reals();
            let bias = match &rest {
                // equal for each row, so the bias becomes part of the map
                Some(Value::Constant(bias)) if rows_agree(&bias.shape) => {
                    broadcast(node, &bias.shape, &shape)?;
                    let values = bias.to_reals();
                    let at = broadcast_offsets(&bias.shape, &[1, columns]);
                    rest = None;
                    at.iter().map(|offset| beta * values[*offset]).collect()
                }
                _ => vec![0.0; columns],
            };
            self.linear(node, (a.buffer, [inner, columns]), (&weights, alpha), &bias, shape.clone())?
        } else {
            let b = self.computed(node, &b)?;
            let product = Product { sizes: [rows, inner, columns], offsets: vec![[0, 0]] };
            let product =
                self.push(node, Operation::Product([a.buffer, b.buffer], product), shape.clone())?;
            self.scaled(node, product, alpha)?
        };
        let Some(rest) = rest else { return Ok(vec![Value::Computed(computed)]) };
        if broadcast(node, rest.shape(), &shape)? != shape {
            return Err(node.error(format!("input 2 has the shape {:?}, expected {shape:?}", rest.shape())));
        }
        let rest = self.computed(node, &rest)?;
        let rest = self.scaled(node, rest, beta)?;
        let operands = [Operand::Aligned, self.operand_offsets(node, &rest.shape, &shape)?];
        let sum = Operation::Binary([computed.buffer, rest.buffer], Binary::Add, operands);
        Ok(vec![Value::Computed(self.push(node, sum, shape)?)])
    }

    fn scaled(&mut self, node: &Node<'_>, value: Computed, factor: f32) -> Result<Computed, OnnxError> {
        if factor.to_bits() == 1.0_f32.to_bits() {
            return Ok(value);
        }
        let constant = self.computed(node, &Value::Constant(Constant::reals(Vec::new(), vec![factor])))?;
        let operands = [Operand::Aligned, Operand::Single];
        let product = Operation::Binary([value.buffer, constant.buffer], Binary::Mul, operands);
        self.push(node, product, value.shape)
    }

    /// Returns a packed map with weights (inputs x outputs, row by row).
    fn linear(
        &mut self,
        node: &Node<'_>,
        (input, [inputs, outputs]): (usize, [usize; 2]),
        (weights, alpha): (&[f32], f32),
        bias: &[f32],
        shape: Vec<usize>,
    ) -> Result<Computed, OnnxError> {
        self.reserve(node, (inputs + 1).saturating_mul(outputs.next_multiple_of(16)))?;
        let packed = Packed::new((outputs, inputs), |o, i| alpha * weights[i * outputs + o], |o| bias[o]);
        self.push(node, Operation::Linear(input, packed), shape)
    }

    pub(super) fn mat_mul(&mut self, node: &Node<'_>) -> Outputs {
        let (a, b) = (node.input(0)?.clone(), node.input(1)?.clone());
        let (mut left, mut right) = (a.shape().to_vec(), b.shape().to_vec());
        if left.is_empty() || right.is_empty() {
            return Err(node.error("a scalar, expected tensors with axes"));
        }
        // vectors are matrices of one row or one column, whose axis is dropped from the result
        let (row, column) = (left.len() == 1, right.len() == 1);
        if row {
            left.insert(0, 1);
        }
        if column {
            right.push(1);
        }
        let (batch_a, matrix_a) = left.split_at(left.len() - 2);
        let (batch_b, matrix_b) = right.split_at(right.len() - 2);
        let ([rows, inner], [other, columns]) = ([matrix_a[0], matrix_a[1]], [matrix_b[0], matrix_b[1]]);
        if inner != other {
            return Err(node.error(format!("tensors {:?} and {:?} do not fit", a.shape(), b.shape())));
        }
        let batch = broadcast(node, batch_a, batch_b)?;
        let mut shape = batch.clone();
        shape.extend((!row).then_some(rows));
        shape.extend((!column).then_some(columns));
        let a = self.computed(node, &a)?;
        if let (Value::Constant(weights), true) = (&b, batch_b.iter().all(|length| *length == 1)) {
            let (weights, bias) = (weights.to_reals(), vec![0.0; columns]);
            let linear = self.linear(node, (a.buffer, [inner, columns]), (&weights, 1.0), &bias, shape)?;
            return Ok(vec![Value::Computed(linear)]);
        }
        let b = self.computed(node, &b)?;
        let products = count(&batch).unwrap_or(0);
        self.reserve(node, 4 * products)?;
        let offsets = broadcast_offsets(batch_a, &batch).into_iter().zip(broadcast_offsets(batch_b, &batch));
        let offsets = offsets.map(|(k, l)| [k * rows * inner, l * inner * columns]).collect();
        let product = Product { sizes: [rows, inner, columns], offsets };
        Ok(vec![Value::Computed(self.push(
            node,
            Operation::Product([a.buffer, b.buffer], product),
            shape,
        )?)])
    }
}

/// Returns `true` if a tensor that broadcasts over rows has the same numbers in each row.
fn rows_agree(shape: &[usize]) -> bool {
    shape.len() < 2 || (shape.len() == 2 && shape[0] == 1)
}
