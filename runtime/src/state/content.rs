//! Validation of state buffers whose type is only known at run time.

use super::{Digest, TypeLayout};

/// Validates the bytes of a state buffer by its layout. For types known at compile time, use
/// [`Field::check`](super::Field::check).
///
/// Numbers must be finite, and counts must not exceed their arrays; entries beyond a count are unused and
/// ignored. Checking does not allocate.
///
/// ```
/// use motorium::state::{ContentCheck, ContentDefect, StateBuffer, Wrench};
///
/// let check = ContentCheck::new(&Wrench::layout())?;
/// let mut bytes = [0u8; size_of::<Wrench>()];
/// assert_eq!(check.check(&bytes), Ok(()));
/// bytes[8..16].copy_from_slice(&f64::NAN.to_ne_bytes());
/// assert_eq!(check.check(&bytes), Err(ContentDefect::NotFinite { field: 0, index: 1 }));
/// # Ok::<(), motorium::state::UnknownKind>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ContentCheck {
    size: usize,
    parts: Vec<Part>,
}

/// One field, for the check and the digest.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Part {
    /// Offset from the start of the buffer, bytes.
    offset: usize,
    number: Number,
    /// Number of array entries; 1 for a single number.
    entries: usize,
    /// Offset of the `u32` that counts the entries in use; `None` if all are in use.
    count: Option<usize>,
}

/// The primitive type of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    Double,
    Single,
    /// An integer of this many bytes: any content is valid.
    Whole(usize),
}

impl Number {
    fn from_kind(kind: &str) -> Option<Self> {
        Some(match kind {
            "f64" => Self::Double,
            "f32" => Self::Single,
            "u8" | "i8" => Self::Whole(1),
            "u16" | "i16" => Self::Whole(2),
            "u32" | "i32" => Self::Whole(4),
            "u64" | "i64" => Self::Whole(8),
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Double => 8,
            Self::Single => 4,
            Self::Whole(bytes) => bytes,
        }
    }
}

/// Error of [`ContentCheck::new`]: a field has an unsupported type or extends beyond the buffer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("field `{field}` of {type_name} is {kind} at byte {offset}, expected numbers inside the buffer")]
pub struct UnknownKind {
    /// Name of the buffer's type.
    pub type_name: String,
    /// Name of the field.
    pub field: String,
    /// Type of the field in the layout.
    pub kind: String,
    /// Byte offset of the field.
    pub offset: usize,
}

/// A defect found when checking a buffer against its layout. Owns no heap memory, so it can be created on the
/// hot path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ContentDefect {
    /// The size of the buffer differs from the size of its type.
    #[error("the buffer has {found} bytes, expected {expected}")]
    Size {
        /// Number of bytes found.
        found: usize,
        /// Size of the type, bytes.
        expected: usize,
    },
    /// A number is NaN or infinite.
    #[error("entry {index} of field {field} is not a finite number")]
    NotFinite {
        /// Index of the field in [`TypeLayout::fields`].
        field: usize,
        /// Index in an array, otherwise 0.
        index: usize,
    },
    /// A count exceeds the capacity of its array.
    #[error("field {field} has {found} entries in use, expected at most {capacity}")]
    Count {
        /// Index of the array in [`TypeLayout::fields`].
        field: usize,
        /// Number of entries in use according to the count in the buffer.
        found: usize,
        /// Number of entries that fit in the array.
        capacity: usize,
    },
}

impl ContentCheck {
    /// Prepares the check of buffers with this layout.
    ///
    /// # Errors
    /// A field is neither a number nor an array of numbers, or exceeds the buffer.
    pub fn new(layout: &TypeLayout) -> Result<Self, UnknownKind> {
        let parts = layout.fields.iter().map(|field| {
            let unknown = || UnknownKind {
                type_name: layout.type_name.clone(),
                field: field.name.clone(),
                kind: field.kind.clone(),
                offset: field.offset,
            };
            let primitive = field.kind.trim_start_matches('[').split(';').next().unwrap_or_default();
            let number = Number::from_kind(primitive).ok_or_else(unknown)?;
            let fits = field.offset.checked_add(field.size).is_some_and(|end| end <= layout.size);
            if !fits || !field.size.is_multiple_of(number.bytes()) {
                return Err(unknown());
            }
            let counter = |name: &String| {
                let found = layout.fields.iter().find(|other| other.name == *name);
                let found = found.filter(|other| other.kind == "u32" && other.offset + 4 <= layout.size);
                found.map(|other| other.offset).ok_or_else(unknown)
            };
            let count = field.count.as_ref().map(counter).transpose()?;
            Ok(Part { offset: field.offset, number, entries: field.size / number.bytes(), count })
        });
        Ok(Self { size: layout.size, parts: parts.collect::<Result<_, _>>()? })
    }

    /// Checks that a buffer has the size of its type, that all its numbers are finite, and that counts do not
    /// exceed their arrays.
    ///
    /// # Errors
    /// Returns the first defect, in field order.
    pub fn check(&self, bytes: &[u8]) -> Result<(), ContentDefect> {
        if bytes.len() != self.size {
            return Err(ContentDefect::Size { found: bytes.len(), expected: self.size });
        }
        for (field, part) in self.parts.iter().enumerate() {
            let used = part.used(bytes);
            if used > part.entries {
                return Err(ContentDefect::Count { field, found: used, capacity: part.entries });
            }
            if let Some(index) = part.not_finite(part.content(bytes)) {
                return Err(ContentDefect::NotFinite { field, index });
            }
        }
        Ok(())
    }

    /// Checks several consecutive buffers, each like [`check`](Self::check).
    ///
    /// # Errors
    /// Returns the first defect, with indices relative to the buffer that has the defect.
    pub fn check_all(&self, bytes: &[u8]) -> Result<(), ContentDefect> {
        if self.size == 0 || !bytes.len().is_multiple_of(self.size) {
            return Err(ContentDefect::Size { found: bytes.len(), expected: self.size });
        }
        match self.number() {
            // Images and maps are checked in one pass over all numbers.
            Some(part) => match part.not_finite(bytes) {
                Some(_) => Err(ContentDefect::NotFinite { field: 0, index: 0 }),
                None => Ok(()),
            },
            None => bytes.chunks_exact(self.size).try_for_each(|element| self.check(element)),
        }
    }

    /// Returns the only part of a layout that is a single number.
    fn number(&self) -> Option<&Part> {
        match self.parts.as_slice() {
            [part] if part.count.is_none() && part.number.bytes() == self.size => Some(part),
            _ => None,
        }
    }

    /// Adds the meaningful content of consecutive checked elements to a digest.
    pub(crate) fn digest_all(&self, bytes: &[u8], digest: &mut Digest) {
        match self.number() {
            Some(_) => digest.write(bytes),
            None => bytes.chunks_exact(self.size.max(1)).for_each(|element| self.digest(element, digest)),
        }
    }

    /// Adds the meaningful content of a checked buffer to a digest.
    pub(crate) fn digest(&self, bytes: &[u8], digest: &mut Digest) {
        self.parts.iter().for_each(|part| digest.write(part.content(bytes)));
    }
}

impl Part {
    /// Returns the number of entries in use.
    fn used(&self, bytes: &[u8]) -> usize {
        let Some(place) = self.count else { return self.entries };
        let count = bytes.get(place..).and_then(|rest| rest.first_chunk());
        count.map_or(usize::MAX, |count| u32::from_ne_bytes(*count) as usize)
    }

    /// Returns the bytes in use.
    fn content<'a>(&self, bytes: &'a [u8]) -> &'a [u8] {
        let used = self.used(bytes).min(self.entries) * self.number.bytes();
        bytes.get(self.offset..self.offset + used).unwrap_or_default()
    }

    /// Returns the index of the first number that is not finite.
    fn not_finite(&self, content: &[u8]) -> Option<usize> {
        match self.number {
            Number::Double => {
                content.as_chunks().0.iter().position(|number| !f64::from_ne_bytes(*number).is_finite())
            }
            Number::Single => {
                content.as_chunks().0.iter().position(|number| !f32::from_ne_bytes(*number).is_finite())
            }
            Number::Whole(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{FieldLayout, JointCommand, PoseTarget, StateBuffer, built_in};

    fn check<T: StateBuffer>() -> ContentCheck {
        ContentCheck::new(&T::layout()).unwrap()
    }

    fn bytes<T: StateBuffer>(value: &T) -> Vec<u8> {
        let layout = T::layout();
        let mut bytes = vec![0; layout.size];
        // SAFETY: a state buffer of the runtime has no padding, so all its bytes are initialised.
        #[allow(unsafe_code)]
        bytes
            .copy_from_slice(unsafe { core::slice::from_raw_parts((value as *const T).cast(), layout.size) });
        bytes
    }

    #[test]
    fn all_runtime_states_are_checkable_and_zeros_valid() {
        for layout in built_in() {
            let check = ContentCheck::new(&layout).unwrap();
            assert_eq!(check.check(&vec![0; layout.size]), Ok(()), "{layout}");
            assert!(matches!(check.check(&[]), Err(ContentDefect::Size { found: 0, .. })), "{layout}");
        }
    }

    #[test]
    fn only_counted_joints_are_checked() {
        let mut command = JointCommand::default();
        command.set_count(3);
        command.kd_mut()[2] = f64::INFINITY;
        let check = check::<JointCommand>();
        assert_eq!(check.check(&bytes(&command)), Err(ContentDefect::NotFinite { field: 6, index: 2 }));
        command.set_count(2);
        assert_eq!(check.check(&bytes(&command)), Ok(()));
    }

    #[test]
    fn elements_are_checked_singly_and_numbers_in_one_pass() {
        let numbers = [1.0_f32, -2.0, f32::NAN];
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_ne_bytes()).collect();
        let check = check::<f32>();
        assert_eq!(check.check_all(&bytes[..8]), Ok(()));
        assert_eq!(check.check_all(&[]), Ok(()));
        assert_eq!(check.check_all(&bytes), Err(ContentDefect::NotFinite { field: 0, index: 0 }));
        assert_eq!(check.check_all(&bytes[..7]), Err(ContentDefect::Size { found: 7, expected: 4 }));
        let mut target = PoseTarget::default();
        let good = super::tests::bytes(&target);
        target.position[1] = f64::INFINITY;
        let both = [good, super::tests::bytes(&target)].concat();
        let defect = ContentDefect::NotFinite { field: 0, index: 1 };
        assert_eq!(self::check::<PoseTarget>().check_all(&both), Err(defect));
    }

    #[test]
    fn count_beyond_its_array_is_a_defect() {
        let mut bytes = bytes(&JointCommand::default());
        bytes[..4].copy_from_slice(&65u32.to_ne_bytes());
        let defect = ContentDefect::Count { field: 2, found: 65, capacity: 64 };
        assert_eq!(check::<JointCommand>().check(&bytes), Err(defect));
    }

    #[test]
    fn checks_by_layout_and_by_type_agree() {
        use crate::state::Field as _;
        for place in 0..13 {
            let mut target = PoseTarget::default();
            let numbers = [
                &mut target.position[..],
                &mut target.orientation[..],
                &mut target.linear_velocity[..],
                &mut target.angular_velocity[..],
            ];
            *numbers.into_iter().flatten().nth(place).unwrap() = f64::NAN;
            assert!(target.check().is_err());
            assert!(check::<PoseTarget>().check(&bytes(&target)).is_err(), "number {place}");
        }
    }

    #[test]
    fn layout_with_a_field_beyond_the_buffer_is_refused() {
        let mut layout = PoseTarget::layout();
        layout.fields.push(FieldLayout::new("beyond", layout.size, "f64", 8));
        assert_eq!(ContentCheck::new(&layout).unwrap_err().field, "beyond");
    }
}
