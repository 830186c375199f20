//! Convolutions and pooling.

use super::compile::{Compiler, Outputs};
use super::error::OnnxError;
use super::node::{Computed, Node, Value};
use super::tensor::strides;
use crate::inference::{Convolution, Operation, PADDING, Packed, Parts, Reduction};

/// Positions of a window along each spatial axis.
struct Windows {
    /// Length of the output along each axis.
    output: Vec<usize>,
    /// For each output position, the input offset of each element of the window; [`PADDING`] outside.
    offsets: Vec<u32>,
}

impl Compiler {
    /// The windows of a kernel over the spatial axes of one channel.
    fn windows(&mut self, node: &Node<'_>, input: &[usize], kernel: &[usize]) -> Result<Windows, OnnxError> {
        let rank = input.len();
        let list = |name: &str, default: usize, least: i64, length: usize| match node.integers(name) {
            None => Ok(vec![default; length]),
            Some(values)
                if values.len() == length && values.iter().all(|value| (least..1 << 20).contains(value)) =>
            {
                Ok(values.iter().map(|value| *value as usize).collect())
            }
            Some(values) => {
                Err(node.error(format!("{name} {values:?} are not valid for {rank} spatial axes")))
            }
        };
        let (step, dilation) = (list("strides", 1, 1, rank)?, list("dilations", 1, 1, rank)?);
        let mut pads = list("pads", 0, 0, 2 * rank)?;
        let reach: Vec<usize> =
            (0..rank).map(|axis| (kernel[axis].max(1) - 1) * dilation[axis] + 1).collect();
        match &node.text("auto_pad", "NOTSET")[..] {
            "NOTSET" => {}
            "VALID" => pads.fill(0),
            mode @ ("SAME_UPPER" | "SAME_LOWER") => {
                for axis in 0..rank {
                    let span = (input[axis].div_ceil(step[axis]).max(1) - 1) * step[axis] + reach[axis];
                    let total = span.saturating_sub(input[axis]);
                    let low = if mode == "SAME_UPPER" { total / 2 } else { total.div_ceil(2) };
                    (pads[axis], pads[rank + axis]) = (low, total - low);
                }
            }
            mode => return Err(node.error(format!("auto_pad \"{mode}\""))),
        }
        let ceil = node.integer("ceil_mode", 0) != 0;
        let mut output = Vec::new();
        for axis in 0..rank {
            let span = (input[axis] + pads[axis] + pads[rank + axis]).checked_sub(reach[axis]);
            let span = span.ok_or_else(|| {
                node.error(format!(
                    "a kernel of shape {kernel:?} is larger than an input of shape {input:?} with its padding"
                ))
            })?;
            let mut length = if ceil { span.div_ceil(step[axis]) } else { span / step[axis] } + 1;
            // a window must start within the input or its lower padding
            if ceil && (length - 1) * step[axis] >= input[axis] + pads[axis] {
                length -= 1;
            }
            output.push(length);
        }
        let product = |lengths: &[usize]| super::tensor::count(lengths);
        let total = product(&output).zip(product(kernel)).and_then(|(a, b)| a.checked_mul(b));
        self.reserve(node, total.unwrap_or(usize::MAX))?;
        // offsets along one axis after another
        let along = strides(input);
        let (outer, inner) = (product(&output).unwrap_or(0), product(kernel).unwrap_or(0));
        let (steps_out, steps_in) = (strides(&output), strides(kernel));
        let mut offsets = Vec::with_capacity(outer * inner);
        for position in 0..outer {
            for element in 0..inner {
                let mut offset = Some(0_usize);
                for axis in 0..rank {
                    let window = position / steps_out[axis] % output[axis];
                    let within = element / steps_in[axis] % kernel[axis];
                    let place = (window * step[axis] + within * dilation[axis]).checked_sub(pads[axis]);
                    let place = place.filter(|place| *place < input[axis]);
                    offset = offset.zip(place).map(|(offset, place)| offset + place * along[axis]);
                }
                offsets.push(offset.map_or(PADDING, |offset| offset as u32));
            }
        }
        Ok(Windows { output, offsets })
    }

    pub(super) fn conv(&mut self, node: &Node<'_>) -> Outputs {
        let Computed { shape, buffer } = self.operand(node, 0)?;
        let weights = node.constant(1)?.clone();
        let numbers = weights.to_reals();
        let groups = usize::try_from(node.integer("group", 1)).unwrap_or(0);
        let fits = shape.len() >= 3
            && weights.shape.len() == shape.len()
            && groups > 0
            && weights.shape[0].is_multiple_of(groups)
            && weights.shape[1].checked_mul(groups) == Some(shape[1])
            && weights.shape.iter().chain(&shape).all(|length| *length > 0);
        if !fits {
            let message = format!(
                "weights of shape {:?} in {groups} groups do not match an input of shape {shape:?}",
                weights.shape
            );
            return Err(node.error(message));
        }
        let (outputs, channels, kernel) = (weights.shape[0], weights.shape[1], &weights.shape[2..]);
        let bias = if node.optional(2).is_some() { node.reals(2)? } else { vec![0.0; outputs] };
        if bias.len() != outputs {
            return Err(node.error(format!("{} biases, expected {outputs}", bias.len())));
        }
        let space: usize = shape[2..].iter().product();
        let Windows { output, offsets } = self.windows(node, &shape[2..], kernel)?;
        let size: usize = kernel.iter().product();
        let positions = offsets.len() / size;
        self.reserve(node, (offsets.len() * 2).saturating_mul(channels).saturating_add(numbers.len() * 2))?;
        let mut patches = Vec::with_capacity(offsets.len() * channels);
        for window in offsets.chunks_exact(size) {
            for channel in 0..channels {
                let shifted = |offset: &u32| match *offset {
                    PADDING => PADDING,
                    offset => offset + (channel * space) as u32,
                };
                patches.extend(window.iter().map(shifted));
            }
        }
        let (each, inputs) = (outputs / groups, channels * size);
        let packed = |group: usize| {
            let weight = |o: usize, i: usize| numbers[(group * each + o) * inputs + i];
            Packed::new((each, inputs), weight, |o| bias[group * each + o])
        };
        let convolution =
            Convolution::new((0..groups).map(packed).collect(), patches, channels * space, positions);
        self.reserve(node, positions.saturating_mul(each))?;
        let mut result = vec![shape[0], outputs];
        result.extend(output);
        Ok(vec![Value::Computed(self.push(node, Operation::Convolution(buffer, convolution), result)?)])
    }

    pub(super) fn max_pool(&mut self, node: &Node<'_>) -> Outputs {
        let Computed { shape, buffer } = self.operand(node, 0)?;
        let kernel = node.integers("kernel_shape").unwrap_or_default();
        let kernel: Vec<usize> = kernel.iter().map(|length| usize::try_from(*length).unwrap_or(0)).collect();
        if shape.len() < 3
            || kernel.len() + 2 != shape.len()
            || kernel.iter().chain(&shape).any(|length| !(1..1 << 20).contains(length))
        {
            return Err(node
                .error(format!("a kernel of shape {kernel:?} does not match an input of shape {shape:?}")));
        }
        if node.proto.output.iter().skip(1).any(|name| !name.is_empty()) {
            return Err(node.error("the output of indices is not supported"));
        }
        let Windows { output, offsets } = self.windows(node, &shape[2..], &kernel)?;
        let channels = shape[0] * shape[1];
        let space: usize = shape[2..].iter().product();
        let size: usize = kernel.iter().product();
        self.reserve(node, offsets.len().saturating_mul(channels))?;
        let mut parts = Parts { starts: vec![0], offsets: Vec::new() };
        for channel in 0..channels {
            for window in offsets.chunks_exact(size) {
                let within = window.iter().filter(|offset| **offset != PADDING);
                parts.offsets.extend(within.map(|offset| offset + (channel * space) as u32));
                parts.starts.push(parts.offsets.len() as u32);
            }
        }
        let mut result = shape[..2].to_vec();
        result.extend(output);
        Ok(vec![Value::Computed(self.push(
            node,
            Operation::Reduce(buffer, Reduction::Max, parts),
            result,
        )?)])
    }

    pub(super) fn global_average_pool(&mut self, node: &Node<'_>) -> Outputs {
        let Computed { shape, buffer } = self.operand(node, 0)?;
        if shape.len() < 3 || shape.contains(&0) {
            return Err(
                node.error(format!("an input of shape {shape:?}, expected samples, channels and space"))
            );
        }
        let (channels, space) = (shape[0] * shape[1], shape[2..].iter().product::<usize>());
        self.reserve(node, channels * space)?;
        let parts = Parts {
            starts: (0..=channels).map(|channel| (channel * space) as u32).collect(),
            offsets: (0..(channels * space) as u32).collect(),
        };
        let mut result = shape[..2].to_vec();
        result.resize(shape.len(), 1);
        Ok(vec![Value::Computed(self.push(
            node,
            Operation::Reduce(buffer, Reduction::Mean, parts),
            result,
        )?)])
    }
}
