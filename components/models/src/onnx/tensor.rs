//! Constant tensors of a file, and shapes.

use super::error::OnnxError;
use super::proto::TensorProto;

/// Maximum total size of all buffers of a network, in numbers.
pub(super) const MAX_NUMBERS: usize = 1 << 24;

/// Numbers of a constant.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Numbers {
    Real(Vec<f32>),
    Whole(Vec<i64>),
}

/// A tensor whose value is known when the network is compiled.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Constant {
    pub(super) shape: Vec<usize>,
    pub(super) numbers: Numbers,
}

/// Number of elements of a shape; `None` above [`MAX_NUMBERS`].
pub(super) fn count(shape: &[usize]) -> Option<usize> {
    let product = shape.iter().try_fold(1_usize, |product, length| product.checked_mul(*length));
    product.filter(|product| *product <= MAX_NUMBERS)
}

/// Returns the distance between neighbours along each axis.
pub(super) fn strides(shape: &[usize]) -> Vec<usize> {
    let mut strides = vec![1; shape.len()];
    for axis in (1..shape.len()).rev() {
        strides[axis - 1] = strides[axis] * shape[axis];
    }
    strides
}

/// Returns the offsets of all elements of `shape`, in order, in a tensor with these strides.
pub(super) fn offsets(shape: &[usize], strides: &[usize], first: usize) -> Vec<usize> {
    let mut found = vec![first];
    for (length, stride) in shape.iter().zip(strides) {
        found = found.iter().flat_map(|start| (0..*length).map(move |k| start + k * stride)).collect();
    }
    found
}

impl Constant {
    pub(super) fn scalar(value: i64) -> Self {
        Self { shape: Vec::new(), numbers: Numbers::Whole(vec![value]) }
    }

    pub(super) fn list(values: Vec<i64>) -> Self {
        Self { shape: vec![values.len()], numbers: Numbers::Whole(values) }
    }

    pub(super) fn reals(shape: Vec<usize>, values: Vec<f32>) -> Self {
        Self { shape, numbers: Numbers::Real(values) }
    }

    /// Returns the numbers as `f32`.
    pub(super) fn to_reals(&self) -> Vec<f32> {
        match &self.numbers {
            Numbers::Real(values) => values.clone(),
            Numbers::Whole(values) => values.iter().map(|value| *value as f32).collect(),
        }
    }

    /// Returns the elements at `offsets` in a new shape.
    pub(super) fn pick(&self, shape: Vec<usize>, offsets: &[usize]) -> Self {
        let numbers = match &self.numbers {
            Numbers::Real(values) => Numbers::Real(offsets.iter().map(|k| values[*k]).collect()),
            Numbers::Whole(values) => Numbers::Whole(offsets.iter().map(|k| values[*k]).collect()),
        };
        Self { shape, numbers }
    }

    pub(super) fn from_proto(tensor: &TensorProto) -> Result<Self, OnnxError> {
        let error = |message: String| OnnxError::Tensor { name: tensor.name.clone(), message };
        if !tensor.external_data.is_empty() {
            let message =
                "its numbers are in another file; help: save the model with `save_as_external_data=False`";
            return Err(error(message.to_owned()));
        }
        let shape: Option<Vec<usize>> = tensor.dims.iter().map(|dim| usize::try_from(*dim).ok()).collect();
        let expected = shape.as_deref().and_then(count);
        let (Some(shape), Some(expected)) = (shape, expected) else {
            return Err(error(format!("shape {:?} is negative or too large", tensor.dims)));
        };
        let raw = &tensor.raw_data[..];
        let halves = |wide: fn(u16) -> f32| -> Vec<f32> {
            let raws = raw.as_chunks::<2>().0.iter().map(|bytes| u16::from_le_bytes(*bytes));
            let listed = tensor.int32_data.iter().map(|bits| *bits as u16);
            if raw.is_empty() { listed.map(wide).collect() } else { raws.map(wide).collect() }
        };
        let numbers = match tensor.data_type {
            1 if raw.is_empty() => Numbers::Real(tensor.float_data.clone()),
            1 => {
                Numbers::Real(raw.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect())
            }
            11 if raw.is_empty() => {
                Numbers::Real(tensor.double_data.iter().map(|value| *value as f32).collect())
            }
            11 => Numbers::Real(
                raw.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes) as f32).collect(),
            ),
            10 => Numbers::Real(halves(crate::safetensors::half)),
            16 => Numbers::Real(halves(crate::safetensors::brain_half)),
            7 if raw.is_empty() => Numbers::Whole(tensor.int64_data.clone()),
            7 => Numbers::Whole(
                raw.as_chunks::<8>().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect(),
            ),
            2 | 3 | 6 | 9 if raw.is_empty() => {
                Numbers::Whole(tensor.int32_data.iter().map(|value| i64::from(*value)).collect())
            }
            6 => Numbers::Whole(
                raw.as_chunks::<4>().0.iter().map(|bytes| i32::from_le_bytes(*bytes).into()).collect(),
            ),
            2 | 9 => Numbers::Whole(raw.iter().map(|byte| i64::from(*byte)).collect()),
            3 => Numbers::Whole(raw.iter().map(|byte| i64::from(byte.cast_signed())).collect()),
            other => {
                return Err(error(format!(
                    "element type {other}, expected float (1), double (11), half (10), bfloat16 (16) or an integer"
                )));
            }
        };
        let found = match &numbers {
            Numbers::Real(values) => values.len(),
            Numbers::Whole(values) => values.len(),
        };
        if found != expected {
            return Err(error(format!("{found} numbers, expected {expected} for the shape {shape:?}")));
        }
        Ok(Self { shape, numbers })
    }
}
