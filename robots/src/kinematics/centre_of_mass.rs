//! The centre of mass and its Jacobian.

use nalgebra::{Dim, Matrix, StorageMut, Vector3};

use super::Kinematics;
use crate::Model;
use crate::math::{RigidInertia, V3};
use crate::model::flat::FlatModel;

/// Position, velocity and acceleration of the centre of mass of all moving bodies, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CentreOfMass {
    /// Position \[m\].
    pub position: Vector3<f64>,
    /// Velocity \[m/s\].
    pub velocity: Vector3<f64>,
    /// Acceleration \[m/s2\]. After [`Kinematics::update_with_velocity`], which assumes zero acceleration
    /// `a`, this is the drift `Jdot v`.
    pub acceleration: Vector3<f64>,
}

impl Kinematics {
    /// Returns the position, velocity and acceleration of the centre of mass at the last update of the
    /// kinematics. Links fixed to the world are ignored. The result is NaN for a robot without mass.
    pub fn centre_of_mass(&self, model: &Model) -> CentreOfMass {
        let flat = model.flat();
        let (mut mass, mut position, mut velocity, mut acceleration) = (0.0, V3::ZERO, V3::ZERO, V3::ZERO);
        let inertias = std::iter::once(&flat.base).chain(flat.nodes.iter().map(|node| &node.inertia));
        for (body, inertia) in self.bodies.iter().zip(inertias) {
            // Everything is multiplied by the mass, because a massless body has no centre.
            let arm = body.rotation * inertia.moment;
            let across = body.angular.cross(arm);
            mass += inertia.mass;
            position += body.position * inertia.mass + arm;
            velocity += body.linear * inertia.mass + across;
            acceleration +=
                body.linear_rate * inertia.mass + body.angular_rate.cross(arm) + body.angular.cross(across);
        }
        let inverse = 1.0 / mass;
        CentreOfMass {
            position: (position * inverse).into(),
            velocity: (velocity * inverse).into(),
            acceleration: (acceleration * inverse).into(),
        }
    }

    /// Computes the Jacobian of the centre of mass (3 x nv) in world axes. `jacobian * v` is the velocity of
    /// the centre of mass \[m/s\].
    ///
    /// `out` is overwritten. Its entries are NaN for a robot without mass.
    pub fn com_jacobian<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &self,
        model: &Model,
        out: &mut Matrix<f64, R, C, S>,
    ) {
        assert_eq!(out.shape(), (3, model.nv()), "shape of the Jacobian");
        out.fill(0.0);
        let flat = model.flat();
        let inverse = 1.0 / flat.carried_masses[0];
        let moment = if flat.coupled {
            self.couple_columns(flat, inverse, out)
        } else {
            self.fill_columns(flat, inverse, out)
        };
        if flat.floating {
            let base = &self.bodies[0];
            let arm = moment * inverse - base.position;
            for (column, axis) in [base.rotation.x, base.rotation.y, base.rotation.z].into_iter().enumerate()
            {
                add(out, column, axis);
                add(out, column + 3, axis.cross(arm));
            }
        }
    }

    /// Fills the columns of joints with individual columns in one pass from the leaves to the base. A column
    /// contains the first moment of mass of its body's subtree until the body is reached. Returns the moment
    /// of the whole robot.
    fn fill_columns<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &self,
        flat: &FlatModel,
        inverse: f64,
        out: &mut Matrix<f64, R, C, S>,
    ) -> V3 {
        let mut whole = self.moment(0, &flat.base);
        for (index, node) in flat.nodes.iter().enumerate().rev() {
            let at = node.column;
            let carried = V3::new(out[(0, at)], out[(1, at)], out[(2, at)]);
            let moment = self.moment(index + 1, &node.inertia) + carried;
            match node.parent.checked_sub(1) {
                Some(parent) => add(out, flat.nodes[parent].column, moment),
                None => whole += moment,
            }
            let body = &self.bodies[index + 1];
            let mass = flat.carried_masses[index + 1];
            let axis = body.rotation.z * (node.multiplier * inverse);
            let column = if node.prismatic { axis * mass } else { axis.cross(moment - body.position * mass) };
            for (row, entry) in column.array().into_iter().enumerate() {
                out[(row, at)] = entry;
            }
        }
        whole
    }

    /// Fills the columns if several joints share one: each body contributes to the columns of all joints that
    /// carry it.
    fn couple_columns<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &self,
        flat: &FlatModel,
        inverse: f64,
        out: &mut Matrix<f64, R, C, S>,
    ) -> V3 {
        let mut whole = self.moment(0, &flat.base);
        for (index, moved) in flat.nodes.iter().enumerate() {
            let (mass, moment) = (moved.inertia.mass, self.moment(index + 1, &moved.inertia));
            whole += moment;
            for &slot in flat.chain(index) {
                let (node, body) = (&flat.nodes[slot - 1], &self.bodies[slot]);
                let axis = body.rotation.z * (node.multiplier * inverse);
                let column =
                    if node.prismatic { axis * mass } else { axis.cross(moment - body.position * mass) };
                add(out, node.column, column);
            }
        }
        whole
    }

    /// Returns the first moment of mass of the body at `slot` about the world's origin, in world axes.
    fn moment(&self, slot: usize, inertia: &RigidInertia) -> V3 {
        let body = &self.bodies[slot];
        body.position * inertia.mass + body.rotation * inertia.moment
    }
}

fn add<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(out: &mut Matrix<f64, R, C, S>, column: usize, entry: V3) {
    for (row, entry) in entry.array().into_iter().enumerate() {
        out[(row, column)] += entry;
    }
}
