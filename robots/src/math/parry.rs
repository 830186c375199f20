//! Conversion to and from parry's vector type.

use parry3d_f64::math::Vector;

use super::V3;

#[inline(always)]
pub(crate) fn vector(v: V3) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

#[inline(always)]
pub(crate) fn v3(v: Vector) -> V3 {
    V3::new(v.x, v.y, v.z)
}
