//! The centre of mass and its Jacobian.

use nalgebra::{Dim, Matrix, StorageMut, Vector3};

use super::Kinematics;
use crate::Model;
use crate::algebra::V3;

/// Motion of the centre of mass of all that moves, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CentreOfMass {
    /// Where it is \[m\].
    pub position: Vector3<f64>,
    /// Its velocity \[m/s\].
    pub velocity: Vector3<f64>,
    /// Its acceleration \[m/s2\]; the drift `Jdot v` after [`Kinematics::update_with_velocity`].
    pub acceleration: Vector3<f64>,
}

impl Kinematics {
    /// The centre of mass, moving as the last update says. Links fixed to the world do not count. Not a number for a
    /// robot without mass.
    pub fn centre_of_mass(&self, model: &Model) -> CentreOfMass {
        let program = model.program();
        let (mut mass, mut position, mut velocity, mut acceleration) = (0.0, V3::ZERO, V3::ZERO, V3::ZERO);
        let inertias = std::iter::once(&program.base).chain(program.nodes.iter().map(|node| &node.inertia));
        for (body, inertia) in self.bodies.iter().zip(inertias) {
            // Everything times the mass: a body without any has no centre.
            let arm = body.rotation * inertia.moment;
            let swing = body.angular.cross(arm);
            mass += inertia.mass;
            position += body.position * inertia.mass + arm;
            velocity += body.linear * inertia.mass + swing;
            acceleration +=
                body.linear_rate * inertia.mass + body.angular_rate.cross(arm) + body.angular.cross(swing);
        }
        let inverse = 1.0 / mass;
        CentreOfMass {
            position: (position * inverse).into(),
            velocity: (velocity * inverse).into(),
            acceleration: (acceleration * inverse).into(),
        }
    }

    /// Jacobian of the centre of mass (3 x nv), world axes: `jacobian * v` is its velocity.
    pub fn com_jacobian<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &mut self,
        model: &Model,
        out: &mut Matrix<f64, R, C, S>,
    ) {
        assert_eq!(out.shape(), (3, model.nv()), "shape of the Jacobian");
        out.fill(0.0);
        let program = model.program();
        let inertias = std::iter::once(&program.base).chain(program.nodes.iter().map(|node| &node.inertia));
        for ((carried, body), inertia) in self.carried.iter_mut().zip(&self.bodies).zip(inertias) {
            *carried = (inertia.mass, body.position * inertia.mass + body.rotation * inertia.moment);
        }
        for (index, node) in program.nodes.iter().enumerate().rev() {
            let (mass, moment) = self.carried[index + 1];
            let parent = &mut self.carried[node.parent];
            parent.0 += mass;
            parent.1 += moment;
        }
        let inverse = 1.0 / self.carried[0].0;
        for ((node, body), (mass, moment)) in
            program.nodes.iter().zip(&self.bodies[1..]).zip(&self.carried[1..])
        {
            let axis = body.rotation.z * (node.multiplier * inverse);
            let column =
                if node.prismatic { axis * *mass } else { axis.cross(*moment - body.position * *mass) };
            add(out, node.column, column);
        }
        if program.floating {
            let base = &self.bodies[0];
            let arm = self.carried[0].1 * inverse - base.position;
            for (column, axis) in [base.rotation.x, base.rotation.y, base.rotation.z].into_iter().enumerate()
            {
                add(out, column, axis);
                add(out, column + 3, axis.cross(arm));
            }
        }
    }
}

fn add<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(out: &mut Matrix<f64, R, C, S>, column: usize, entry: V3) {
    for (row, entry) in entry.array().into_iter().enumerate() {
        out[(row, column)] += entry;
    }
}
