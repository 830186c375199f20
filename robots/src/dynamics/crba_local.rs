//! The composite rigid body algorithm in the bodies' own frames.
//!
//! Cheaper than base coordinates where limbs are short: no body has to be placed, and a joint's wrench is a column of its
//! composite's inertia; but each wrench has to be carried down to the base step by step.

use super::Dynamics;
use crate::algebra::{M3, RigidInertia, Spatial, V3};
use crate::model::program::{Node, Program};

/// A body in its parent's frame, with the inertia of all it carries in its own.
#[derive(Clone, Debug)]
pub(super) struct Hanging {
    rotation: M3,
    translation: V3,
    inertia: RigidInertia,
}

impl Hanging {
    pub(super) const START: Self =
        Self { rotation: M3::IDENTITY, translation: V3::ZERO, inertia: RigidInertia::ZERO };
}

impl Dynamics {
    /// Upper triangle of the mass matrix of a model without mimic joints, the base's own block apart. Leaves the
    /// inertia of the whole in the first slot of `composite`.
    #[inline(always)]
    pub(super) fn mass_in_place(&mut self, program: &Program, out: &mut [f64], n: usize) {
        self.hanging[0].inertia = program.base;
        for ((node, position), body) in
            program.nodes.iter().zip(self.positions.iter()).zip(&mut self.hanging[1..])
        {
            (body.rotation, body.translation) = node.pose(position);
            body.inertia = node.inertia;
        }
        for (index, node) in program.nodes.iter().enumerate().rev() {
            let (outer, inner) = self.hanging.split_at_mut(index + 1);
            let body = &inner[0];
            let mut wrench = unit_wrench(node, &body.inertia);
            let column = &mut out[node.column * n..][..=node.column];
            column[node.column] = along(node, wrench);
            if node.parent != 0 || program.floating {
                outer[node.parent].inertia += body.inertia.moved(&body.rotation, body.translation);
                wrench = carried(body, wrench);
            }
            let mut ancestor = node.parent;
            while ancestor != 0 {
                let other = &program.nodes[ancestor - 1];
                column[other.column] = along(other, wrench);
                if other.parent != 0 || program.floating {
                    wrench = carried(&outer[ancestor], wrench);
                }
                ancestor = other.parent;
            }
            if program.floating {
                column[..6].copy_from_slice(&wrench.array());
            }
        }
        self.composite[0].inertia = self.hanging[0].inertia;
    }
}

/// The wrench that accelerates `inertia` by one unit of the joint's motion: about z, or along it.
#[inline(always)]
fn unit_wrench(node: &Node, inertia: &RigidInertia) -> Spatial {
    let (h, i) = (inertia.moment, &inertia.rotational);
    if node.prismatic {
        Spatial::new(V3::new(0.0, 0.0, inertia.mass), V3::new(h.y, -h.x, 0.0))
    } else {
        Spatial::new(V3::new(-h.y, h.x, 0.0), V3::new(i.xz, i.yz, i.zz))
    }
}

/// The same wrench about the parent's origin, in its axes.
#[inline(always)]
fn carried(body: &Hanging, wrench: Spatial) -> Spatial {
    let force = body.rotation * wrench.linear;
    Spatial { linear: force, angular: body.rotation * wrench.angular + body.translation.cross(force) }
}

#[inline(always)]
fn along(node: &Node, wrench: Spatial) -> f64 {
    if node.prismatic { wrench.linear.z } else { wrench.angular.z }
}
