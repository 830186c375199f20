//! Contact surfaces of collisions.

use roxmltree::Node;

use super::super::WorldFileError;
use super::super::reading::position;
use super::reader::Reader;
use super::values::{child, elements, is_foreign};

/// Reason for the warnings about direction-dependent friction.
const ISOTROPIC: &str = "friction is the same in all directions; only `mu` is used";

impl Reader<'_> {
    /// Returns the friction and restitution of a surface. Other elements cause warnings or errors.
    pub(super) fn surface(&mut self, collision: Node<'_, '_>) -> Result<(f64, f64), WorldFileError> {
        for node in elements(collision) {
            if !["pose", "geometry", "surface", "density"].contains(&node.tag_name().name()) {
                self.leave_out("collision", node)?;
            }
        }
        let surface = child(collision, "surface");
        let own = |node: &Node<'_, '_>| {
            node.is_element() && !node.ancestors().any(|node| node.is_element() && is_foreign(&node))
        };
        for node in surface.into_iter().flat_map(|node| node.descendants().skip(1)).filter(own) {
            let of_bullet = node.parent().is_some_and(|parent| parent.tag_name().name() == "bullet");
            self.leave_out(if of_bullet { "bullet" } else { "surface" }, node)?;
        }
        let bounce = surface.and_then(|surface| child(surface, "bounce"));
        let restitution = self.number_or(bounce, "restitution_coefficient", 0.0)?;
        if let Some(bounce) = bounce.filter(|_| restitution > 0.0) {
            self.first_bounce.get_or_insert(position(bounce));
            if child(bounce, "threshold").is_none() {
                let reason = "impacts at any speed rebound, as with a <threshold> of 0";
                self.ignore(bounce, "the default <threshold> of 100000 m/s", reason);
            }
        }
        let ode = surface.and_then(|node| child(node, "friction")).and_then(|node| child(node, "ode"));
        let friction = self.number_or(ode, "mu", 1.0)?;
        if let Some(ode) = ode.filter(|ode| friction != 1.0 && child(*ode, "mu2").is_none()) {
            self.ignore(ode, "the default <mu2> of 1", ISOTROPIC);
        }
        Ok((friction, restitution))
    }
}
