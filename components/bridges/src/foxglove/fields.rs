//! Fields that several of Foxglove's messages share.

use foxglove::messages::{Quaternion, Timestamp, Vector3};

/// A vector from its components x, y and z.
pub(super) fn vector(v: &[f64]) -> Vector3 {
    Vector3 { x: v[0], y: v[1], z: v[2] }
}

/// A quaternion from its components x, y, z and w.
pub(super) fn quaternion(q: &[f64]) -> Quaternion {
    Quaternion { x: q[0], y: q[1], z: q[2], w: q[3] }
}

/// A time in Foxglove's form.
pub(super) fn timestamp(time_ns: u64) -> Timestamp {
    let seconds = u32::try_from(time_ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (time_ns % 1_000_000_000) as u32)
}
