//! Elementwise functions of one or two tensors.

use super::compile::{Compiler, Outputs};
use super::error::OnnxError;
use super::movement::{broadcast, broadcast_offsets};
use super::node::{Computed, Node, Value};
use super::tensor::{Constant, Numbers};
use crate::inference::{Binary, Operand, Operation, Unary};

impl Compiler {
    pub(super) fn unary(&mut self, node: &Node<'_>) -> Outputs {
        let function = match &node.proto.op_type[..] {
            "Relu" => Unary::Relu,
            "Elu" => Unary::Elu(node.real("alpha", 1.0)),
            "LeakyRelu" => Unary::LeakyRelu(node.real("alpha", 0.01)),
            "Tanh" => Unary::Tanh,
            "Sigmoid" => Unary::Sigmoid,
            "Softplus" => Unary::Softplus,
            "Softsign" => Unary::Softsign,
            "Sqrt" => Unary::Sqrt,
            _ => {
                let bound = |name: &str, index: usize, default: f32| match node.optional(index) {
                    Some(_) => match node.reals(index)?[..] {
                        [bound] => Ok(bound),
                        ref bounds => {
                            Err(node.error(format!("{} numbers as a bound, expected 1", bounds.len())))
                        }
                    },
                    None => Ok(node.real(name, default)),
                };
                Unary::Clip(bound("min", 1, f32::MIN)?, bound("max", 2, f32::MAX)?)
            }
        };
        let Computed { shape, buffer } = self.operand(node, 0)?;
        Ok(vec![self.fold(node, Operation::Unary(buffer, function), shape)?])
    }

    pub(super) fn neg(&mut self, node: &Node<'_>) -> Outputs {
        if let Value::Constant(Constant { numbers: Numbers::Whole(values), shape }) = node.input(0)? {
            let negated: Option<Vec<i64>> = values.iter().map(|value| value.checked_neg()).collect();
            let numbers = Numbers::Whole(negated.ok_or_else(|| node.error("integers overflow"))?);
            return Ok(vec![Value::Constant(Constant { shape: shape.clone(), numbers })]);
        }
        let Computed { shape, buffer } = self.operand(node, 0)?;
        self.reserve(node, 1)?;
        let factor = self.program.constant(vec![-1.0]);
        let operation = Operation::Binary([buffer, factor], Binary::Mul, [Operand::Aligned, Operand::Single]);
        Ok(vec![self.fold(node, operation, shape)?])
    }

    pub(super) fn binary(&mut self, node: &Node<'_>) -> Outputs {
        let function = match &node.proto.op_type[..] {
            "Add" => Binary::Add,
            "Sub" => Binary::Sub,
            "Mul" => Binary::Mul,
            "Div" => Binary::Div,
            "Min" => Binary::Min,
            "Max" => Binary::Max,
            _ => Binary::Pow,
        };
        if node.inputs.len() != 2 {
            return Err(node.error(format!("{} inputs, expected 2", node.inputs.len())));
        }
        let (a, b) = (node.input(0)?.clone(), node.input(1)?.clone());
        let shape = broadcast(node, a.shape(), b.shape())?;
        if let (
            Value::Constant(Constant { numbers: Numbers::Whole(a), shape: from_a }),
            Value::Constant(Constant { numbers: Numbers::Whole(b), shape: from_b }),
        ) = (&a, &b)
        {
            let (at_a, at_b) = (broadcast_offsets(from_a, &shape), broadcast_offsets(from_b, &shape));
            self.reserve(node, at_a.len())?;
            let pairs = at_a.iter().zip(&at_b).map(|(k, l)| whole(function, a[*k], b[*l]));
            let numbers: Option<Vec<i64>> = pairs.collect();
            let numbers = numbers.ok_or_else(|| node.error("integers overflow, or are divided by 0"))?;
            return Ok(vec![Value::Constant(Constant { shape, numbers: Numbers::Whole(numbers) })]);
        }
        if let (Binary::Pow, Value::Constant(exponent)) = (function, &b)
            && exponent.to_reals() == [2.0]
            && shape == a.shape()
        {
            let Computed { buffer, .. } = self.operand(node, 0)?;
            return Ok(vec![self.fold(node, Operation::Unary(buffer, Unary::Square), shape)?]);
        }
        let (a, b) = (self.operand(node, 0)?, self.operand(node, 1)?);
        let operands =
            [self.operand_offsets(node, &a.shape, &shape)?, self.operand_offsets(node, &b.shape, &shape)?];
        Ok(vec![self.fold(node, Operation::Binary([a.buffer, b.buffer], function, operands), shape)?])
    }

    /// Returns the layout of an operand of shape `from` for a result of shape `to`.
    pub(super) fn operand_offsets(
        &mut self,
        node: &Node<'_>,
        from: &[usize],
        to: &[usize],
    ) -> Result<Operand, OnnxError> {
        let (length, total) = (from.iter().product::<usize>(), to.iter().product::<usize>());
        if length == total {
            return Ok(Operand::Aligned);
        }
        if length == 1 {
            return Ok(Operand::Single);
        }
        self.reserve(node, total)?;
        Ok(Operand::At(broadcast_offsets(from, to).into_iter().map(|offset| offset as u32).collect()))
    }
}

fn whole(function: Binary, a: i64, b: i64) -> Option<i64> {
    match function {
        Binary::Add => a.checked_add(b),
        Binary::Sub => a.checked_sub(b),
        Binary::Mul => a.checked_mul(b),
        Binary::Div => a.checked_div(b),
        Binary::Pow => a.checked_pow(u32::try_from(b).ok()?),
        Binary::Min => Some(a.min(b)),
        Binary::Max => Some(a.max(b)),
    }
}
