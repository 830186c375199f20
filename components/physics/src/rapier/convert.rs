//! Conversions between nalgebra, used by motorium, and glam, used by rapier.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::math::{Pose, Rotation, Vector};

pub(crate) use crate::shapes::vector;

pub(crate) fn vector_back(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

pub(super) fn point_back(v: Vector) -> Point3<f64> {
    Point3::new(v.x, v.y, v.z)
}

pub(crate) fn pose(p: &Isometry3<f64>) -> Pose {
    let r = &p.rotation;
    Pose::from_parts(vector(&p.translation.vector), Rotation::from_xyzw(r.i, r.j, r.k, r.w))
}

pub(super) fn pose_back(p: &Pose) -> Isometry3<f64> {
    let r = p.rotation;
    Isometry3::from_parts(
        Translation3::from(vector_back(p.translation)),
        // Normalised again, so that a state that is read and written back does not drift off the unit sphere.
        UnitQuaternion::new_normalize(Quaternion::new(r.w, r.x, r.y, r.z)),
    )
}
