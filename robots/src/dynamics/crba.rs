//! Composite rigid body algorithm (Featherstone 2008, table 6.2).

use nalgebra::{DMatrix, Matrix3};

use super::Dynamics;
use crate::Model;
use crate::model::tree::{BASE, Node};

impl Dynamics {
    /// Joint-space mass matrix `M(q)` (nv x nv), both triangles.
    pub fn crba(&mut self, model: &Model, q: &[f64], out: &mut DMatrix<f64>) {
        assert_eq!(out.shape(), (model.nv(), model.nv()), "shape of the mass matrix");
        self.place(model, q);
        self.compose(model);
        out.fill(0.0);
        for (index, node) in model.nodes().iter().enumerate() {
            let body = &self.bodies[index];
            // The wrench that accelerates everything beyond the joint by one unit.
            let (mut force, mut moment) = if node.prismatic {
                (node.axis * body.composite_mass, body.composite_moment.cross(&node.axis))
            } else {
                (node.axis.cross(&body.composite_moment), body.composite_inertia * node.axis)
            };
            let along = |node: &Node, force: &_, moment: &_| {
                node.multiplier * node.axis.dot(if node.prismatic { force } else { moment })
            };
            out[(node.column, node.column)] += node.multiplier * along(node, &force, &moment);
            let mut child = index;
            while model.nodes()[child].parent != BASE {
                let work = &self.bodies[child];
                force = work.rotation * force;
                moment = work.rotation * moment + work.translation.cross(&force);
                child = model.nodes()[child].parent;
                let ancestor = &model.nodes()[child];
                let entry = node.multiplier * along(ancestor, &force, &moment);
                // Twice on the diagonal when a mimic and its master share the column: both cross terms land there.
                out[(node.column, ancestor.column)] += entry;
                out[(ancestor.column, node.column)] += entry;
            }
        }
    }

    /// Inertia of each body together with all that hangs on it, in the body frame.
    fn compose(&mut self, model: &Model) {
        for (node, body) in model.nodes().iter().zip(&mut self.bodies) {
            body.composite_mass = node.mass;
            body.composite_moment = node.moment;
            body.composite_inertia = node.inertia;
        }
        for (index, node) in model.nodes().iter().enumerate().rev() {
            if node.parent == BASE {
                continue;
            }
            let body = &self.bodies[index];
            let (r, p, mass) = (body.rotation, body.translation, body.composite_mass);
            let moment = r * body.composite_moment;
            let cross = p * moment.transpose();
            let shift = Matrix3::from_diagonal_element(2.0 * p.dot(&moment) + mass * p.norm_squared())
                - (cross + cross.transpose())
                - p * p.transpose() * mass;
            let inertia = r * body.composite_inertia * r.transpose() + shift;
            let parent = &mut self.bodies[node.parent];
            parent.composite_mass += mass;
            parent.composite_moment += moment + p * mass;
            parent.composite_inertia += inertia;
        }
    }
}
