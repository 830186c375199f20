//! The configuration manifold: integration, differences, interpolation, and conversion to the coordinates of
//! Pinocchio and MuJoCo.
//!
//! On a floating base `q` starts with the base's position in the world and its orientation as a quaternion x
//! y z w, and `v` with the velocity of the base's origin and its angular velocity, both in the base's axes.
//! All other entries are one number per joint; a continuous joint is one unbounded angle.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::math::lie::se3;
use crate::{JointKind, Model};

impl Model {
    /// Returns the neutral configuration (nq): all joints at zero and a floating base at its pose in the
    /// file.
    pub fn neutral(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.nq()];
        if self.base().floating {
            write_pose(&self.base().neutral, &mut q);
        }
        q
    }

    /// Moves `q` (nq) for unit time with the constant velocity `v` (nv) and writes the result to `q_out`
    /// (nq). For a time `dt`, pass `v dt`.
    ///
    /// A floating base follows the screw motion of its velocity, `T exp(v)`. The resulting quaternion is
    /// normalised.
    pub fn integrate(&self, q: &[f64], v: &[f64], q_out: &mut [f64]) {
        assert!(
            q.len() == self.nq() && q_out.len() == self.nq() && v.len() == self.nv(),
            "length of q and v"
        );
        let joints = self.joints_of_q(q).iter().zip(self.joints_of_v(v));
        let offset = self.nq() - self.joint_count();
        for (out, (q, v)) in q_out[offset..].iter_mut().zip(joints) {
            *out = q + v;
        }
        if self.base().floating {
            write_pose(&(base_pose(q) * se3::exp(&Vector6::from_column_slice(&v[..6]))), q_out);
        }
    }

    /// Computes the velocity `v_out` (nv) that moves `from` to `to` in unit time, with the smallest rotation:
    /// `integrate(from, v_out) = to`.
    pub fn difference(&self, from: &[f64], to: &[f64], v_out: &mut [f64]) {
        assert!(
            from.len() == self.nq() && to.len() == self.nq() && v_out.len() == self.nv(),
            "length of q and v"
        );
        let joints = self.joints_of_q(from).iter().zip(self.joints_of_q(to));
        let offset = self.nv() - self.joint_count();
        for (out, (from, to)) in v_out[offset..].iter_mut().zip(joints) {
            *out = to - from;
        }
        if self.base().floating {
            let way = se3::log(&base_pose(from).inv_mul(&base_pose(to)));
            v_out[..6].copy_from_slice(way.as_slice());
        }
    }

    /// Interpolates between `from` (`share` 0) and `to` (`share` 1) along [`difference`](Self::difference)
    /// and writes the result to `q_out` (nq).
    pub fn interpolate(&self, from: &[f64], to: &[f64], share: f64, q_out: &mut [f64]) {
        assert!(from.len() == self.nq() && to.len() == self.nq() && q_out.len() == self.nq(), "length of q");
        let offset = self.nq() - self.joint_count();
        for (out, (from, to)) in q_out[offset..].iter_mut().zip(from[offset..].iter().zip(&to[offset..])) {
            *out = from + share * (to - from);
        }
        if self.base().floating {
            let way = se3::log(&base_pose(from).inv_mul(&base_pose(to))) * share;
            write_pose(&(base_pose(from) * se3::exp(&way)), q_out);
        }
    }

    /// Converts `q` to Pinocchio's layout. The angle of a continuous joint is replaced by its cosine and
    /// sine, so a planar joint has the entries x, y, cosine and sine. The entries of the base and the order
    /// of the joints are unchanged.
    pub fn to_pinocchio(&self, q: &[f64]) -> Vec<f64> {
        let mut out = q[..self.nq() - self.joint_count()].to_vec();
        for (index, &angle) in self.joints_of_q(q).iter().enumerate() {
            match self.joint(index).kind {
                JointKind::Continuous => out.extend([angle.cos(), angle.sin()]),
                JointKind::Revolute | JointKind::Prismatic => out.push(angle),
            }
        }
        out
    }

    /// Converts `q` from Pinocchio's layout, the inverse of [`to_pinocchio`](Self::to_pinocchio). Angles of
    /// continuous joints are in -pi .. pi. `None` if the length of `q` does not match the layout.
    pub fn from_pinocchio(&self, q: &[f64]) -> Option<Vec<f64>> {
        let start = self.nq() - self.joint_count();
        let mut out = q.get(..start)?.to_vec();
        let mut rest = q[start..].iter();
        for index in 0..self.joint_count() {
            let first = *rest.next()?;
            out.push(match self.joint(index).kind {
                JointKind::Continuous => rest.next()?.atan2(first),
                JointKind::Revolute | JointKind::Prismatic => first,
            });
        }
        rest.next().is_none().then_some(out)
    }

    /// Converts a velocity `v` at `q` to Pinocchio's axes. Only the entries of planar joints differ:
    /// Pinocchio uses the axes of the body, whereas this crate uses the axes of the plane. Efforts `tau` are
    /// converted in the same way.
    ///
    /// Pinocchio puts every planar joint in the x-y plane and ignores the axis in the file. In this crate,
    /// the plane is normal to the axis in the file.
    pub fn velocity_to_pinocchio(&self, q: &[f64], v: &[f64]) -> Vec<f64> {
        self.turned_planes(q, v, -1.0)
    }

    /// Converts a velocity from Pinocchio's axes, the inverse of
    /// [`velocity_to_pinocchio`](Self::velocity_to_pinocchio). `q` is in this crate's layout.
    pub fn velocity_from_pinocchio(&self, q: &[f64], v: &[f64]) -> Vec<f64> {
        self.turned_planes(q, v, 1.0)
    }

    /// Returns `v` with the slides of planar joints rotated by their yaw times `sign`.
    fn turned_planes(&self, q: &[f64], v: &[f64], sign: f64) -> Vec<f64> {
        assert!(q.len() == self.nq() && v.len() == self.nv(), "length of q and v");
        let mut out = v.to_vec();
        let (angles, offset) = (self.joints_of_q(q), self.nv() - self.joint_count());
        for (index, joint) in self.joint_names().windows(3).enumerate() {
            let part = |place: usize, suffix: &str| joint[place].strip_suffix(suffix);
            let planar =
                part(0, "/x").is_some() && part(0, "/x") == part(1, "/y") && part(0, "/x") == part(2, "/yaw");
            if planar {
                let (sin, cos) = (sign * angles[index + 2]).sin_cos();
                let (x, y) = (v[offset + index], v[offset + index + 1]);
                (out[offset + index], out[offset + index + 1]) = (cos * x - sin * y, sin * x + cos * y);
            }
        }
        out
    }

    /// Converts `q` and `v` to MuJoCo's layout: quaternion w x y z, linear velocity of the base in world
    /// axes, angular velocity in base axes. The order of the joints is unchanged.
    pub fn to_mujoco(&self, q: &[f64], v: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut qpos, mut qvel) = (q.to_vec(), v.to_vec());
        if self.base().floating {
            qpos[3..7].rotate_right(1);
            let linear = base_pose(q).rotation * Vector3::from_column_slice(&v[..3]);
            qvel[..3].copy_from_slice(linear.as_slice());
        }
        (qpos, qvel)
    }

    /// Converts a configuration and velocity from MuJoCo's layout to `q` and `v`, the inverse of
    /// [`to_mujoco`](Self::to_mujoco).
    pub fn from_mujoco(&self, qpos: &[f64], qvel: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut q, mut v) = (qpos.to_vec(), qvel.to_vec());
        if self.base().floating {
            q[3..7].rotate_left(1);
            let linear = base_pose(&q).rotation.inverse() * Vector3::from_column_slice(&v[..3]);
            v[..3].copy_from_slice(linear.as_slice());
        }
        (q, v)
    }
}

/// Returns the pose of a floating base in the world.
pub(crate) fn base_pose(q: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[6], q[3], q[4], q[5]));
    Isometry3::from_parts(Translation3::new(q[0], q[1], q[2]), rotation)
}

pub(crate) fn write_pose(pose: &Isometry3<f64>, q: &mut [f64]) {
    q[..3].copy_from_slice(pose.translation.vector.as_slice());
    let rotation = UnitQuaternion::new_normalize(*pose.rotation.quaternion());
    q[3..7].copy_from_slice(rotation.coords.as_slice());
}

/// Returns the configuration with the base at its pose in the file and the joints at these positions.
pub(crate) fn with_joints(model: &Model, joints: &[f64]) -> Vec<f64> {
    let mut q = model.neutral();
    let first = q.len() - joints.len();
    q[first..].copy_from_slice(joints);
    q
}
