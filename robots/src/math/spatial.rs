//! Spatial vectors and inertias (Featherstone 2008, chapter 2), linear part first.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

use nalgebra::{Matrix3, Vector3};

use super::{M3, S3, V3};

/// A motion (velocity of the origin, angular velocity) or a wrench (force, moment about the origin).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spatial {
    pub(crate) linear: V3,
    pub(crate) angular: V3,
}

impl Spatial {
    pub(crate) const ZERO: Self = Self { linear: V3::ZERO, angular: V3::ZERO };

    #[inline(always)]
    pub(crate) const fn new(linear: V3, angular: V3) -> Self {
        Self { linear, angular }
    }

    #[inline(always)]
    pub(crate) fn from_slice(values: &[f64]) -> Self {
        Self::new(V3::from_slice(&values[..3]), V3::from_slice(&values[3..6]))
    }

    #[inline(always)]
    pub(crate) fn array(self) -> [f64; 6] {
        let (l, a) = (self.linear, self.angular);
        [l.x, l.y, l.z, a.x, a.y, a.z]
    }

    /// Returns the power of a wrench along a motion.
    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> f64 {
        self.linear.dot(other.linear) + self.angular.dot(other.angular)
    }

    /// `self x motion`
    #[inline(always)]
    pub(crate) fn cross_motion(self, motion: Self) -> Self {
        Self {
            linear: self.angular.cross(motion.linear) + self.linear.cross(motion.angular),
            angular: self.angular.cross(motion.angular),
        }
    }

    /// `self x* wrench`
    #[inline(always)]
    pub(crate) fn cross_wrench(self, wrench: Self) -> Self {
        Self {
            linear: self.angular.cross(wrench.linear),
            angular: self.angular.cross(wrench.angular) + self.linear.cross(wrench.linear),
        }
    }
}

impl Add for Spatial {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.linear + other.linear, self.angular + other.angular)
    }
}

impl AddAssign for Spatial {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Spatial {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.linear - other.linear, self.angular - other.angular)
    }
}

impl SubAssign for Spatial {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Neg for Spatial {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.linear, -self.angular)
    }
}

impl Mul<f64> for Spatial {
    type Output = Self;
    #[inline(always)]
    fn mul(self, scale: f64) -> Self {
        Self::new(self.linear * scale, self.angular * scale)
    }
}

/// Inertia of a rigid body about the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RigidInertia {
    pub(crate) mass: f64,
    /// First moment of mass: mass times centre of mass.
    pub(crate) moment: V3,
    /// Second moment, about the origin.
    pub(crate) rotational: S3,
}

impl RigidInertia {
    pub(crate) const ZERO: Self = Self { mass: 0.0, moment: V3::ZERO, rotational: S3::ZERO };

    /// Returns the inertia in another frame, in which this one is at rotation `r` and position `p`.
    #[inline(always)]
    pub(crate) fn moved(&self, r: &M3, p: V3) -> Self {
        let moment = *r * self.moment;
        let half = moment + p * (0.5 * self.mass);
        Self {
            mass: self.mass,
            moment: moment + p * self.mass,
            rotational: self.rotational.rotated(r) + S3::between(p, half),
        }
    }

    /// Rotational inertia about the centre of mass.
    pub(crate) fn about_centre(&self) -> Matrix3<f64> {
        let S3 { xx, xy, xz, yy, yz, zz } = self.rotational;
        let moment: Vector3<f64> = self.moment.into();
        let shift = Matrix3::from_diagonal_element(moment.norm_squared()) - moment * moment.transpose();
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - shift * (1.0 / self.mass)
    }

    /// Returns the momentum of a body with velocity `motion`, or the wrench that causes the acceleration
    /// `motion`.
    #[inline(always)]
    pub(crate) fn apply(&self, motion: Spatial) -> Spatial {
        Spatial {
            linear: motion.linear * self.mass + motion.angular.cross(self.moment),
            angular: self.rotational * motion.angular + self.moment.cross(motion.linear),
        }
    }
}

impl AddAssign for RigidInertia {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.moment += other.moment;
        self.rotational += other.rotational;
    }
}

/// Articulated inertia: the inertia of a body whose outer joints are free to move. It is a symmetric 6 x 6
/// matrix in blocks, `force = mass u + coupling w`, `moment = coupling' u + rotational w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ArticulatedInertia {
    pub(crate) mass: S3,
    pub(crate) coupling: M3,
    pub(crate) rotational: S3,
}

impl ArticulatedInertia {
    pub(crate) const ZERO: Self = Self { mass: S3::ZERO, coupling: M3::ZERO, rotational: S3::ZERO };

    #[inline(always)]
    pub(crate) fn apply(&self, motion: Spatial) -> Spatial {
        Spatial {
            linear: self.mass * motion.linear + self.coupling * motion.angular,
            angular: self.coupling.tr_mul(motion.linear) + self.rotational * motion.angular,
        }
    }

    /// Adds a rigid body.
    #[inline(always)]
    pub(crate) fn add_rigid(&mut self, body: &RigidInertia) {
        self.mass += S3::diagonal(body.mass);
        // w x h = -h x w
        self.coupling += M3::skew(-body.moment);
        self.rotational += body.rotational;
    }

    /// Adds `other - u u' / d`: the inertia transmitted by a joint that is free along the motion with the
    /// wrench `u`.
    #[inline(always)]
    pub(crate) fn add_yielding(&mut self, other: &Self, u: Spatial, inverse_d: f64) {
        let s = u * inverse_d;
        let (l, a) = (u.linear, u.angular);
        self.mass += other.mass
            - S3 {
                xx: s.linear.x * l.x,
                xy: s.linear.x * l.y,
                xz: s.linear.x * l.z,
                yy: s.linear.y * l.y,
                yz: s.linear.y * l.z,
                zz: s.linear.z * l.z,
            };
        self.coupling += other.coupling - M3::outer(s.linear, a);
        self.rotational += other.rotational
            - S3 {
                xx: s.angular.x * a.x,
                xy: s.angular.x * a.y,
                xz: s.angular.x * a.z,
                yy: s.angular.y * a.y,
                yz: s.angular.y * a.z,
                zz: s.angular.z * a.z,
            };
    }

    /// Returns the motion caused by `wrench`, by Cholesky factorisation of the 6 x 6 matrix; `None` if it is
    /// singular.
    pub(crate) fn solve(&self, wrench: Spatial) -> Option<Spatial> {
        let (m, r) = (self.mass.columns(), self.rotational.columns());
        let c = &self.coupling;
        let column = |top: V3, bottom: V3| Spatial::new(top, bottom).array();
        let t = c.transpose();
        // Lower triangle, by rows; row i of the matrix is its column i.
        let mut l = [
            column(m.x, t.x),
            column(m.y, t.y),
            column(m.z, t.z),
            column(c.x, r.x),
            column(c.y, r.y),
            column(c.z, r.z),
        ];
        let mut x = wrench.array();
        for j in 0..6 {
            let scale = l[j][j];
            for k in 0..j {
                l[j][j] -= l[j][k] * l[j][k];
            }
            if l[j][j].is_nan() || l[j][j] <= scale * 1e-14 {
                return None;
            }
            l[j][j] = l[j][j].sqrt();
            for i in j + 1..6 {
                for k in 0..j {
                    l[i][j] -= l[i][k] * l[j][k];
                }
                l[i][j] /= l[j][j];
            }
        }
        for i in 0..6 {
            for k in 0..i {
                x[i] -= l[i][k] * x[k];
            }
            x[i] /= l[i][i];
        }
        for i in (0..6).rev() {
            for k in i + 1..6 {
                x[i] -= l[k][i] * x[k];
            }
            x[i] /= l[i][i];
        }
        Some(Spatial::from_slice(&x))
    }
}
