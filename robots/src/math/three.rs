//! Vectors, matrices and symmetric matrices of three dimensions.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

use nalgebra::{Matrix3, Vector3};

/// A vector with three components.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct V3 {
    /// Component along x.
    pub x: f64,
    /// Component along y.
    pub y: f64,
    /// Component along z.
    pub z: f64,
}

impl V3 {
    /// The zero vector.
    pub const ZERO: Self = Self::new(0.0, 0.0, 0.0);

    /// Creates a vector from three components.
    #[inline(always)]
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }

    /// Creates a vector from the first three numbers of a slice.
    ///
    /// # Panics
    /// If the slice has fewer than three numbers.
    #[inline(always)]
    pub fn from_slice(values: &[f64]) -> Self {
        Self::new(values[0], values[1], values[2])
    }

    /// Returns the components.
    #[inline(always)]
    pub fn array(self) -> [f64; 3] {
        [self.x, self.y, self.z]
    }

    /// Returns the scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Returns the vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }
}

impl From<Vector3<f64>> for V3 {
    #[inline(always)]
    fn from(v: Vector3<f64>) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl From<V3> for Vector3<f64> {
    #[inline(always)]
    fn from(v: V3) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl Add for V3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl AddAssign for V3 {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for V3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl SubAssign for V3 {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Neg for V3 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

impl Mul<f64> for V3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, scale: f64) -> Self {
        Self::new(self.x * scale, self.y * scale, self.z * scale)
    }
}

/// A 3 x 3 matrix, stored by columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct M3 {
    /// First column.
    pub x: V3,
    /// Second column.
    pub y: V3,
    /// Third column.
    pub z: V3,
}

impl M3 {
    /// The identity matrix.
    pub const IDENTITY: Self =
        Self { x: V3::new(1.0, 0.0, 0.0), y: V3::new(0.0, 1.0, 0.0), z: V3::new(0.0, 0.0, 1.0) };
    /// The zero matrix.
    pub const ZERO: Self = Self { x: V3::ZERO, y: V3::ZERO, z: V3::ZERO };

    /// Returns the matrix with `skew(a) * b == a x b`.
    #[inline(always)]
    pub fn skew(a: V3) -> Self {
        Self { x: V3::new(0.0, a.z, -a.y), y: V3::new(-a.z, 0.0, a.x), z: V3::new(a.y, -a.x, 0.0) }
    }

    /// Returns the outer product `a b'`.
    #[inline(always)]
    pub fn outer(a: V3, b: V3) -> Self {
        Self { x: a * b.x, y: a * b.y, z: a * b.z }
    }

    /// Returns the transpose.
    #[inline(always)]
    pub fn transpose(&self) -> Self {
        Self {
            x: V3::new(self.x.x, self.y.x, self.z.x),
            y: V3::new(self.x.y, self.y.y, self.z.y),
            z: V3::new(self.x.z, self.y.z, self.z.z),
        }
    }

    /// Returns the product of the transpose and a vector, `self' v`.
    #[inline(always)]
    pub fn tr_mul(&self, v: V3) -> V3 {
        V3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// Returns `self * Rz`, where Rz rotates about z by the angle with this sine and cosine.
    #[inline(always)]
    pub fn turned(&self, sin: f64, cos: f64) -> Self {
        Self { x: self.x * cos + self.y * sin, y: self.y * cos - self.x * sin, z: self.z }
    }

    /// Returns the trace: the sum of the diagonal.
    #[inline(always)]
    pub fn trace(&self) -> f64 {
        self.x.x + self.y.y + self.z.z
    }
}

impl Mul<V3> for M3 {
    type Output = V3;
    #[inline(always)]
    fn mul(self, v: V3) -> V3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

impl Mul for M3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { x: self * other.x, y: self * other.y, z: self * other.z }
    }
}

impl Add for M3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl AddAssign for M3 {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for M3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl From<Matrix3<f64>> for M3 {
    fn from(m: Matrix3<f64>) -> Self {
        Self {
            x: m.column(0).into_owned().into(),
            y: m.column(1).into_owned().into(),
            z: m.column(2).into_owned().into(),
        }
    }
}

impl From<M3> for Matrix3<f64> {
    #[inline(always)]
    fn from(m: M3) -> Self {
        Self::new(m.x.x, m.y.x, m.z.x, m.x.y, m.y.y, m.z.y, m.x.z, m.y.z, m.z.z)
    }
}

/// A symmetric matrix with six entries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct S3 {
    pub(crate) xx: f64,
    pub(crate) xy: f64,
    pub(crate) xz: f64,
    pub(crate) yy: f64,
    pub(crate) yz: f64,
    pub(crate) zz: f64,
}

impl S3 {
    pub(crate) const ZERO: Self = Self { xx: 0.0, xy: 0.0, xz: 0.0, yy: 0.0, yz: 0.0, zz: 0.0 };

    #[inline(always)]
    pub(crate) fn diagonal(value: f64) -> Self {
        Self { xx: value, yy: value, zz: value, ..Self::ZERO }
    }

    /// Reads the upper triangle.
    pub(crate) fn from_upper(m: &Matrix3<f64>) -> Self {
        Self { xx: m[(0, 0)], xy: m[(0, 1)], xz: m[(0, 2)], yy: m[(1, 1)], yz: m[(1, 2)], zz: m[(2, 2)] }
    }

    /// `r self r'`
    #[inline(always)]
    pub(crate) fn rotated(&self, r: &M3) -> Self {
        // The columns of r * self, then the upper triangle of their product with r'.
        let a = r.x * self.xx + r.y * self.xy + r.z * self.xz;
        let b = r.x * self.xy + r.y * self.yy + r.z * self.yz;
        let c = r.x * self.xz + r.y * self.yz + r.z * self.zz;
        Self {
            xx: a.x * r.x.x + b.x * r.y.x + c.x * r.z.x,
            xy: a.x * r.x.y + b.x * r.y.y + c.x * r.z.y,
            xz: a.x * r.x.z + b.x * r.y.z + c.x * r.z.z,
            yy: a.y * r.x.y + b.y * r.y.y + c.y * r.z.y,
            yz: a.y * r.x.z + b.y * r.y.z + c.y * r.z.z,
            zz: a.z * r.x.z + b.z * r.y.z + c.z * r.z.z,
        }
    }

    /// `2 (a . b) 1 - (a b' + b a')`
    #[inline(always)]
    pub(crate) fn between(a: V3, b: V3) -> Self {
        let (x, y, z) = (2.0 * a.x * b.x, 2.0 * a.y * b.y, 2.0 * a.z * b.z);
        Self {
            xx: y + z,
            yy: x + z,
            zz: x + y,
            xy: -(a.x * b.y + a.y * b.x),
            xz: -(a.x * b.z + a.z * b.x),
            yz: -(a.y * b.z + a.z * b.y),
        }
    }

    #[inline(always)]
    pub(crate) fn columns(&self) -> M3 {
        M3 {
            x: V3::new(self.xx, self.xy, self.xz),
            y: V3::new(self.xy, self.yy, self.yz),
            z: V3::new(self.xz, self.yz, self.zz),
        }
    }
}

impl Mul<V3> for S3 {
    type Output = V3;
    #[inline(always)]
    fn mul(self, v: V3) -> V3 {
        V3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }
}

impl Add for S3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            xx: self.xx + other.xx,
            xy: self.xy + other.xy,
            xz: self.xz + other.xz,
            yy: self.yy + other.yy,
            yz: self.yz + other.yz,
            zz: self.zz + other.zz,
        }
    }
}

impl AddAssign for S3 {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for S3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            xx: self.xx - other.xx,
            xy: self.xy - other.xy,
            xz: self.xz - other.xz,
            yy: self.yy - other.yy,
            yz: self.yz - other.yz,
            zz: self.zz - other.zz,
        }
    }
}
