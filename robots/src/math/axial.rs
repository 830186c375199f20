//! Inertias rotated about and translated along one coordinate axis, with a quarter of the arithmetic of a
//! general transform.

use super::{RigidInertia, S3, V3, fused};

/// Sine and cosine of an angle and of its double.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turn {
    pub(crate) sin: f64,
    pub(crate) cos: f64,
    pub(crate) sin2: f64,
    pub(crate) cos2: f64,
}

impl Turn {
    pub(crate) fn new(sin: f64, cos: f64) -> Self {
        Self { sin, cos, sin2: 2.0 * sin * cos, cos2: cos * cos - sin * sin }
    }

    /// Rotates the components of a vector perpendicular to the axis.
    #[inline(always)]
    pub(crate) fn across<const FUSED: bool>(&self, a: f64, b: f64) -> (f64, f64) {
        (fused::<FUSED>(self.cos, a, -(self.sin * b)), fused::<FUSED>(self.sin, a, self.cos * b))
    }

    /// Rotates the entries `aa`, `ab`, `bb` of a symmetric matrix perpendicular to the axis.
    #[inline(always)]
    fn plane<const FUSED: bool>(&self, aa: f64, ab: f64, bb: f64) -> (f64, f64, f64) {
        let (mean, half) = (0.5 * (aa + bb), 0.5 * (aa - bb));
        let turned = fused::<FUSED>(self.cos2, half, -(self.sin2 * ab));
        (mean + turned, fused::<FUSED>(self.sin2, half, self.cos2 * ab), mean - turned)
    }
}

impl RigidInertia {
    /// Returns the inertia rotated about z, then translated by `lift` along it.
    #[inline(always)]
    pub(crate) fn screwed_z<const FUSED: bool>(&self, turn: &Turn, lift: f64) -> Self {
        let (h, i) = (self.moment, &self.rotational);
        let (hx, hy) = turn.across::<FUSED>(h.x, h.y);
        let (xx, xy, yy) = turn.plane::<FUSED>(i.xx, i.xy, i.yy);
        let (xz, yz) = turn.across::<FUSED>(i.xz, i.yz);
        // Parallel axis theorem: d (2 h + m d).
        let hz = fused::<FUSED>(self.mass, lift, h.z);
        let steiner = lift * (h.z + hz);
        Self {
            mass: self.mass,
            moment: V3::new(hx, hy, hz),
            rotational: S3 {
                xx: xx + steiner,
                xy,
                xz: fused::<FUSED>(-lift, hx, xz),
                yy: yy + steiner,
                yz: fused::<FUSED>(-lift, hy, yz),
                zz: i.zz,
            },
        }
    }

    /// Returns the inertia rotated about x, then translated by `shift` along it.
    #[inline(always)]
    pub(crate) fn screwed_x<const FUSED: bool>(&self, turn: &Turn, shift: f64) -> Self {
        let (h, i) = (self.moment, &self.rotational);
        let (hy, hz) = turn.across::<FUSED>(h.y, h.z);
        let (yy, yz, zz) = turn.plane::<FUSED>(i.yy, i.yz, i.zz);
        let (xy, xz) = turn.across::<FUSED>(i.xy, i.xz);
        let hx = fused::<FUSED>(self.mass, shift, h.x);
        let steiner = shift * (h.x + hx);
        Self {
            mass: self.mass,
            moment: V3::new(hx, hy, hz),
            rotational: S3 {
                xx: i.xx,
                xy: fused::<FUSED>(-shift, hy, xy),
                xz: fused::<FUSED>(-shift, hz, xz),
                yy: yy + steiner,
                yz,
                zz: zz + steiner,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::M3;

    fn body() -> RigidInertia {
        RigidInertia {
            mass: 2.0,
            moment: V3::new(0.3, -0.7, 0.4),
            rotational: S3 { xx: 1.0, xy: 0.2, xz: -0.1, yy: 1.3, yz: 0.15, zz: 0.8 },
        }
    }

    fn assert_close(found: &RigidInertia, expected: &RigidInertia) {
        let all = |i: &RigidInertia| {
            let (h, r) = (i.moment, &i.rotational);
            [i.mass, h.x, h.y, h.z, r.xx, r.xy, r.xz, r.yy, r.yz, r.zz]
        };
        for (found, expected) in all(found).into_iter().zip(all(expected)) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }

    #[test]
    fn screws_match_the_general_placement() {
        for angle in [0.0_f64, 0.4, -2.1, 3.0] {
            let (sin, cos) = angle.sin_cos();
            let turn = Turn::new(sin, cos);
            let about_z =
                M3 { x: V3::new(cos, sin, 0.0), y: V3::new(-sin, cos, 0.0), z: V3::new(0.0, 0.0, 1.0) };
            let expected = body().moved(&about_z, V3::new(0.0, 0.0, 0.6));
            assert_close(&body().screwed_z::<false>(&turn, 0.6), &expected);
            assert_close(&body().screwed_z::<true>(&turn, 0.6), &expected);
            let about_x =
                M3 { x: V3::new(1.0, 0.0, 0.0), y: V3::new(0.0, cos, sin), z: V3::new(0.0, -sin, cos) };
            let expected = body().moved(&about_x, V3::new(-0.5, 0.0, 0.0));
            assert_close(&body().screwed_x::<false>(&turn, -0.5), &expected);
            assert_close(&body().screwed_x::<true>(&turn, -0.5), &expected);
        }
    }
}
