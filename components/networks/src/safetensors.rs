//! Named tensors in a file of the safetensors format: a length, a JSON header, and numbers.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::arithmetic::Real;

/// A tensor of numbers of type `T`, by default `f32`.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor<T = f32> {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// Values of the tensor. The last axis varies fastest.
    pub values: Vec<T>,
}

/// Content of a safetensors file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tensors<T = f32> {
    /// Tensors by name.
    pub tensors: BTreeMap<String, Tensor<T>>,
    /// Text entries by name, such as the name of the task.
    pub metadata: BTreeMap<String, String>,
}

/// Error of an invalid safetensors file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SafetensorsError {
    /// The file ends within its header.
    #[error(
        "the file has {found} bytes, expected a header of {expected} bytes and 8 bytes for its length; is it a safetensors file?"
    )]
    Short {
        /// Length of the file in bytes.
        found: usize,
        /// Length of the header in bytes, as stated in the file.
        expected: u64,
    },
    /// The header is invalid.
    #[error("invalid header: {0}")]
    Header(String),
    /// The number type of a tensor is unsupported.
    #[error(
        "tensor \"{name}\" has numbers of type {found}, expected F32, F64, F16 or BF16; help: convert it with `.float()`"
    )]
    Type {
        /// Name of the tensor.
        name: String,
        /// Number type found.
        found: String,
    },
    /// The byte range of a tensor does not match its shape and number type.
    #[error("tensor \"{name}\": bytes {from} to {to} of {size}, expected {expected} bytes within the file")]
    Bytes {
        /// Name of the tensor.
        name: String,
        /// Start of the byte range.
        from: usize,
        /// End of the byte range, exclusive.
        to: usize,
        /// Length of the file's data section in bytes.
        size: usize,
        /// Number of bytes required by the tensor's shape.
        expected: usize,
    },
    /// The number of values of a tensor does not match its shape, so the tensor cannot be written.
    #[error("tensor \"{name}\" has {found} numbers, expected {expected} for its shape")]
    Shape {
        /// Name of the tensor.
        name: String,
        /// Number of values found.
        found: usize,
        /// Number of values required by the tensor's shape.
        expected: usize,
    },
}

#[derive(Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: [usize; 2],
}

/// Converts the bits of an IEEE half-precision number to `f32`.
pub fn half(bits: u16) -> f32 {
    let (sign, exponent, fraction) = (bits >> 15, (bits >> 10) & 31, bits & 1023);
    let value = match exponent {
        0 => f32::from(fraction) * 2.0_f32.powi(-24),
        31 if fraction == 0 => f32::INFINITY,
        31 => f32::NAN,
        exponent => f32::from(1024 + fraction) * 2.0_f32.powi(i32::from(exponent) - 25),
    };
    if sign == 1 { -value } else { value }
}

/// Converts the bits of a bfloat16 number to `f32`.
pub fn brain_half(bits: u16) -> f32 {
    f32::from_bits(u32::from(bits) << 16)
}

/// Reads all tensors of a file. Numbers of type `F64`, `F32`, `F16` or `BF16` are converted to `T`.
///
/// # Errors
///
/// [`SafetensorsError`] if the file is invalid.
pub fn read<T: Real>(bytes: &[u8]) -> Result<Tensors<T>, SafetensorsError> {
    let short = |expected| SafetensorsError::Short { found: bytes.len(), expected };
    let (length, rest) = bytes.split_first_chunk::<8>().ok_or(short(0))?;
    let length = u64::from_le_bytes(*length);
    let header = usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length));
    let (header, data) = header.ok_or(short(length))?;
    let invalid = |error: serde_json::Error| SafetensorsError::Header(error.to_string());
    let mut entries: BTreeMap<String, serde_json::Value> = serde_json::from_slice(header).map_err(invalid)?;
    let metadata = entries.remove("__metadata__").map(serde_json::from_value).transpose().map_err(invalid)?;
    let mut tensors = BTreeMap::new();
    for (name, entry) in entries {
        let Entry { dtype, shape, data_offsets: [from, to] } =
            serde_json::from_value(entry).map_err(invalid)?;
        let width = match &dtype[..] {
            "F16" | "BF16" => 2,
            "F32" => 4,
            "F64" => 8,
            _ => return Err(SafetensorsError::Type { name, found: dtype }),
        };
        let expected = shape.iter().try_fold(width, |size: usize, length| size.checked_mul(*length));
        let numbers = data.get(from..to).filter(|numbers| Some(numbers.len()) == expected);
        let Some(numbers) = numbers else {
            let (size, expected) = (data.len(), expected.unwrap_or(usize::MAX));
            return Err(SafetensorsError::Bytes { name, from, to, size, expected });
        };
        let pairs = || numbers.as_chunks::<2>().0.iter().map(|bytes| u16::from_le_bytes(*bytes));
        let values = match &dtype[..] {
            "F16" => pairs().map(|bits| T::from_f32(half(bits))).collect(),
            "BF16" => pairs().map(|bits| T::from_f32(brain_half(bits))).collect(),
            "F32" => {
                let (numbers, _) = numbers.as_chunks::<4>();
                numbers.iter().map(|bytes| T::from_f32(f32::from_le_bytes(*bytes))).collect()
            }
            _ => {
                let (numbers, _) = numbers.as_chunks::<8>();
                numbers.iter().map(|bytes| T::from_f64(f64::from_le_bytes(*bytes))).collect()
            }
        };
        tensors.insert(name, Tensor { shape, values });
    }
    Ok(Tensors { tensors, metadata: metadata.unwrap_or_default() })
}

/// Returns the bytes of a safetensors file. The tensors are stored as `F32`, sorted by name.
///
/// # Errors
///
/// [`SafetensorsError::Shape`] if the number of values does not match a tensor's shape.
///
/// ```
/// use motorium_networks::safetensors::{self, Tensor, Tensors};
///
/// let mut file = Tensors::default();
/// file.tensors.insert("0.weight".into(), Tensor { shape: vec![1, 2], values: vec![1.5, -2.0] });
/// file.metadata.insert("task".into(), "trot".into());
/// assert_eq!(safetensors::read::<f32>(&safetensors::write(&file)?)?, file);
/// # Ok::<(), safetensors::SafetensorsError>(())
/// ```
pub fn write(file: &Tensors) -> Result<Vec<u8>, SafetensorsError> {
    let mut header = serde_json::Map::new();
    if !file.metadata.is_empty() {
        header.insert("__metadata__".to_owned(), serde_json::json!(file.metadata));
    }
    let mut data = Vec::new();
    for (name, Tensor { shape, values }) in &file.tensors {
        let expected = shape.iter().try_fold(1_usize, |size, length| size.checked_mul(*length));
        if expected != Some(values.len()) {
            let (found, expected) = (values.len(), expected.unwrap_or(usize::MAX));
            return Err(SafetensorsError::Shape { name: name.clone(), found, expected });
        }
        let from = data.len();
        data.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        let entry = serde_json::json!({ "dtype": "F32", "shape": shape, "data_offsets": [from, data.len()] });
        header.insert(name.clone(), entry);
    }
    let mut text = serde_json::Value::Object(header).to_string();
    // the numbers start at a multiple of eight bytes
    text.push_str(&" ".repeat(text.len().next_multiple_of(8) - text.len()));
    let mut bytes = (text.len() as u64).to_le_bytes().to_vec();
    bytes.extend(text.into_bytes());
    bytes.extend(data);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::{SafetensorsError, Tensor, Tensors, half, read, write};

    #[test]
    fn halves_widen_exactly() {
        let pairs = [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x0001, 5.960_464_5e-8),
            (0x7bff, 65504.0),
            (0x3555, 0.333_251_95),
        ];
        assert!(pairs.iter().all(|(bits, value)| half(*bits) == *value));
        assert!(half(0x7c00).is_infinite() && half(0x7e00).is_nan());
    }

    #[test]
    fn numbers_keep_their_precision() {
        let header = br#"{"a":{"dtype":"F64","shape":[1],"data_offsets":[0,8]}}"#;
        let mut file = (header.len() as u64).to_le_bytes().to_vec();
        file.extend(header);
        file.extend(0.1_f64.to_le_bytes());
        let (wide, narrow) = (read::<f64>(&file).expect("a file"), read::<f32>(&file).expect("a file"));
        assert_eq!((wide.tensors["a"].values[0], narrow.tensors["a"].values[0]), (0.1, 0.1));
    }

    #[test]
    fn damaged_files_are_errors() {
        let mut file = Tensors::default();
        file.tensors.insert("a".into(), Tensor { shape: vec![3], values: vec![1.0, 2.0, 3.0] });
        let bytes = write(&file).expect("a file");
        for length in 0..bytes.len() {
            assert!(read::<f32>(&bytes[..length]).is_err(), "{length}");
        }
        file.tensors.insert("b".into(), Tensor { shape: vec![2, 2], values: vec![1.0] });
        let error = write(&file).expect_err("a wrong shape");
        assert_eq!(error, SafetensorsError::Shape { name: "b".into(), found: 1, expected: 4 });
    }
}
