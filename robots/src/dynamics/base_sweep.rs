//! Poses, joint motions and inertias of all bodies in base coordinates.

use super::Dynamics;
use crate::math::{Spatial, V3};
use crate::model::flat::FlatModel;
use crate::model::node::Node;

/// Returns the motion of a body whose joint axis is `z` through `p`, per unit of joint velocity.
#[inline(always)]
pub(crate) fn joint_motion(node: &Node, z: V3, p: V3) -> Spatial {
    if node.prismatic { Spatial::new(z, V3::ZERO) } else { Spatial::new(p.cross(z), z) }
}

impl Dynamics {
    /// Outward pass: poses, joint motions and inertias of the bodies. The base is at the identity.
    #[inline(always)]
    pub(super) fn sweep(&mut self, flat: &FlatModel) {
        self.composite[0].inertia = flat.base;
        for (index, (node, position)) in flat.nodes.iter().zip(self.positions.iter()).enumerate() {
            let (outer, inner) = self.composite.split_at_mut(index + 1);
            let (parent, body) = (&outer[node.parent], &mut inner[0]);
            let (rotation, translation) = node.pose(position);
            let (r, p) = match node.parent {
                // The base is the frame of the coordinates.
                0 => (rotation, translation),
                _ => (parent.rotation * rotation, parent.position + parent.rotation * translation),
            };
            body.rotation = r;
            body.position = p;
            body.joint = joint_motion(node, r.z, p);
            body.inertia = node.inertia.moved(&r, p);
        }
    }
}
