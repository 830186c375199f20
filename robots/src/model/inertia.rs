//! Rigid-body inertia.

use nalgebra::{Isometry3, Matrix3, Vector3};

/// Inertia of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass \[kg\].
    pub mass: f64,
    /// Centre of mass in the body frame \[m\].
    pub com: Vector3<f64>,
    /// Rotational inertia about the centre of mass, body axes \[kg m2\].
    pub rotational: Matrix3<f64>,
}

impl Inertia {
    /// Returns a zero inertia.
    pub fn zero() -> Self {
        Self { mass: 0.0, com: Vector3::zeros(), rotational: Matrix3::zeros() }
    }

    /// Returns the inertia in a new frame. `pose` is the pose of the current frame in the new frame.
    pub fn moved(&self, pose: &Isometry3<f64>) -> Self {
        let r = pose.rotation.to_rotation_matrix().into_inner();
        Self {
            mass: self.mass,
            com: pose.rotation * self.com + pose.translation.vector,
            rotational: r * self.rotational * r.transpose(),
        }
    }

    /// Returns the inertia of a body with the same shape and `factor` times the density.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self { mass: self.mass * factor, com: self.com, rotational: self.rotational * factor }
    }

    /// Returns the combined inertia of two bodies that are welded together. Both inertias must be given in
    /// the same frame.
    pub fn merged(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        if mass == 0.0 {
            return Self { rotational: self.rotational + other.rotational, ..*self };
        }
        let com = (self.com * self.mass + other.com * other.mass) / mass;
        let rotational = self.rotational
            + parallel_axis(self.mass, &(self.com - com))
            + other.rotational
            + parallel_axis(other.mass, &(other.com - com));
        Self { mass, com, rotational }
    }

    /// Returns the rotational inertia about the origin of the body frame, in body axes \[kg m2\].
    pub fn about_origin(&self) -> Matrix3<f64> {
        self.rotational + parallel_axis(self.mass, &self.com)
    }
}

/// Returns the inertia of a point mass at `r` about the origin (Huygens-Steiner).
fn parallel_axis(mass: f64, r: &Vector3<f64>) -> Matrix3<f64> {
    mass * (Matrix3::from_diagonal_element(r.norm_squared()) - r * r.transpose())
}
