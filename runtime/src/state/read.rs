//! Reading of typed samples from bytes.

#![allow(unsafe_code)] // bytes of the right length are read as a type that is valid for every bit pattern

use super::StateBuffer;

/// Reads a value from bytes in the layout of its type, at any alignment. Returns `None` if the number of
/// bytes differs from the size of the type.
///
/// Use it for bytes from a tap or a recording. The value is not validated; use
/// [`Field::check`](super::Field::check) for this.
///
/// ```
/// use motorium::state::{JointState, StateBuffer, encode, from_bytes};
///
/// let bytes = encode(&JointState::layout(), "position=[0.5, -1.0]").unwrap();
/// assert_eq!(from_bytes::<JointState>(&bytes).unwrap().position(), [0.5, -1.0]);
/// assert!(from_bytes::<JointState>(&bytes[1..]).is_none());
/// ```
pub fn from_bytes<T: StateBuffer>(bytes: &[u8]) -> Option<T> {
    if bytes.len() != size_of::<T>() {
        return None;
    }
    // SAFETY: the length matches the size of the type, and every bit pattern is a valid value (`Field`).
    Some(unsafe { bytes.as_ptr().cast::<T>().read_unaligned() })
}
