//! Contacts at one state of the robot.

use motorium_robots::{Kinematics, Model, Reference};
use nalgebra::{Matrix3, Matrix6xX, Vector3, Vector6};

use crate::contact::{Contact, ContactShape};

/// Position, Jacobian and velocity of a contact at one state of the robot.
#[derive(Clone, Debug)]
pub(crate) struct ContactPlace {
    pub(crate) contact: Contact,
    /// `false` without contact: no motion is constrained and there is no force.
    pub(crate) active: bool,
    /// Index of its first force among all contacts, in points.
    pub(crate) first_point: usize,
    /// Index of its first row among all contacts.
    pub(super) first_row: usize,
    /// Two tangents and the normal as columns, in the world.
    pub(crate) axes: Matrix3<f64>,
    /// Points relative to the origin of the frame, in world axes \[m\].
    pub(crate) arms: Vec<Vector3<f64>>,
    /// Jacobian of the frame, world axes, 6 x nv.
    pub(super) jacobian: Matrix6xX<f64>,
    /// Velocity of the constrained motion, and its drift `Jdot v`; the first [`Contact::rows`] entries are
    /// used.
    pub(super) velocity: Vector6<f64>,
    pub(super) drift: Vector6<f64>,
}

impl ContactPlace {
    pub(super) fn new(contact: Contact, model: &Model, first_point: usize, first_row: usize) -> Self {
        Self {
            arms: vec![Vector3::zeros(); contact.points()],
            contact,
            active: true,
            first_point,
            first_row,
            axes: Matrix3::identity(),
            jacobian: Matrix6xX::zeros(model.nv()),
            velocity: Vector6::zeros(),
            drift: Vector6::zeros(),
        }
    }

    /// Evaluates position, Jacobian, velocity and drift.
    ///
    /// The contact point of a ball is at a constant offset `c` from its centre, in world axes. While the ball
    /// rolls, the velocity `v + w x c` of its touching point is zero, and remains zero if `dv/dt + dw/dt x c`
    /// is zero.
    pub(super) fn update(&mut self, model: &Model, kinematics: &Kinematics) {
        let frame = self.contact.frame;
        kinematics.jacobian(model, frame, Reference::LocalWorldAligned, &mut self.jacobian);
        let rotation = kinematics.pose(model, frame).rotation.to_rotation_matrix().into_inner();
        self.axes = match self.contact.shape {
            ContactShape::Sole { .. } => rotation,
            ContactShape::Point | ContactShape::Ball { .. } => tangents(&self.contact.normal),
        };
        for (point, arm) in self.arms.iter_mut().enumerate() {
            *arm = self.contact.arm(point, &rotation);
        }
        self.velocity = kinematics.velocity(model, frame).vector();
        self.drift = kinematics.acceleration(model, frame).vector();
        if let ContactShape::Ball { .. } = self.contact.shape {
            let arm = self.arms[0];
            for column in self.jacobian.as_mut_slice().chunks_exact_mut(6) {
                lever(column, &arm);
            }
            lever(self.velocity.as_mut_slice(), &arm);
            lever(self.drift.as_mut_slice(), &arm);
        }
    }

    /// Position of a point relative to the origin of `jacobian`, in world axes \[m\]. For a ball the origin
    /// is the contact point.
    pub(super) fn lever_arm(&self, point: usize) -> Vector3<f64> {
        match self.contact.shape {
            ContactShape::Ball { .. } => Vector3::zeros(),
            ContactShape::Point | ContactShape::Sole { .. } => self.arms[point],
        }
    }
}

/// Moves the point of a spatial motion by `arm`: `linear + angular x arm`.
fn lever(motion: &mut [f64], arm: &Vector3<f64>) {
    let angular = Vector3::new(motion[3], motion[4], motion[5]);
    let across = angular.cross(arm);
    for axis in 0..3 {
        motion[axis] += across[axis];
    }
}

/// Two tangents and the normal as columns: right-handed, the first tangent closest to the world's x.
fn tangents(normal: &Vector3<f64>) -> Matrix3<f64> {
    let near = if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let first = (near - normal * normal.dot(&near)).normalize();
    Matrix3::from_columns(&[first, normal.cross(&first), *normal])
}
