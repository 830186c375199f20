//! Tensors in a file of the safetensors format: a length, a header in JSON, and numbers.

use std::collections::BTreeMap;

use serde::Deserialize;

/// A tensor, its numbers in rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// The numbers, the last axis fastest.
    pub values: Vec<f64>,
}

/// The file is not a valid safetensors file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SafetensorsError {
    /// The file ends before its header does.
    #[error(
        "{found} bytes, expected a header of {expected} bytes and eight for its length; is it a safetensors file?"
    )]
    Short {
        /// Bytes of the file.
        found: usize,
        /// Number of bytes announced by the first eight.
        expected: u64,
    },
    /// The header is not valid.
    #[error("the header is not that of a safetensors file: {0}")]
    Header(String),
    /// Numbers of another kind.
    #[error("tensor \"{name}\" has numbers of type {found}, expected F32 or F64; convert it with `.float()`")]
    Type {
        /// Name of the tensor.
        name: String,
        /// Type found.
        found: String,
    },
    /// The byte range does not match the tensor.
    #[error("tensor \"{name}\": bytes {from} to {to} of {size}, expected {expected} bytes within the file")]
    Bytes {
        /// Name of the tensor.
        name: String,
        /// First byte.
        from: usize,
        /// One past the last.
        to: usize,
        /// Bytes of numbers in the file.
        size: usize,
        /// Bytes that its shape needs.
        expected: usize,
    },
}

#[derive(Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: [usize; 2],
}

/// Reads all tensors of a file.
///
/// # Errors
///
/// [`SafetensorsError`].
///
/// ```
/// use motorium_robots::safetensors;
///
/// let header = br#"{"a":{"dtype":"F32","shape":[1,2],"data_offsets":[0,8]}}"#;
/// let mut file = (header.len() as u64).to_le_bytes().to_vec();
/// file.extend(header);
/// file.extend([1.5_f32, -2.0].iter().flat_map(|value| value.to_le_bytes()));
/// let tensors = safetensors::read(&file)?;
/// assert_eq!((&tensors["a"].shape[..], &tensors["a"].values[..]), (&[1, 2][..], &[1.5, -2.0][..]));
/// # Ok::<(), safetensors::SafetensorsError>(())
/// ```
pub fn read(bytes: &[u8]) -> Result<BTreeMap<String, Tensor>, SafetensorsError> {
    let short = |expected| SafetensorsError::Short { found: bytes.len(), expected };
    let (length, rest) = bytes.split_first_chunk::<8>().ok_or(short(0))?;
    let length = u64::from_le_bytes(*length);
    let header = usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length));
    let (header, data) = header.ok_or(short(length))?;
    let wrong = |error: serde_json::Error| SafetensorsError::Header(error.to_string());
    let mut entries: BTreeMap<String, serde_json::Value> = serde_json::from_slice(header).map_err(wrong)?;
    entries.remove("__metadata__");
    let tensor = |(name, entry): (String, serde_json::Value)| {
        let Entry { dtype, shape, data_offsets: [from, to] } =
            serde_json::from_value(entry).map_err(wrong)?;
        let width = match dtype.as_str() {
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
        let values = if width == 4 {
            let (numbers, _) = numbers.as_chunks::<4>();
            numbers.iter().map(|number| f64::from(f32::from_le_bytes(*number))).collect()
        } else {
            let (numbers, _) = numbers.as_chunks::<8>();
            numbers.iter().map(|number| f64::from_le_bytes(*number)).collect()
        };
        Ok((name, Tensor { shape, values }))
    };
    entries.into_iter().map(tensor).collect()
}
