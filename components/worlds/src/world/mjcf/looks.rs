//! Colours of objects, read from the geoms of each object.

use std::collections::BTreeMap;

use motorium_robots::Colour;
use roxmltree::{Node, NodeId};

/// Colours specified by the geoms of a world.
#[derive(Default)]
pub(super) struct Looks(Vec<Stated>);

/// A geom and its colour.
struct Stated {
    /// Body of the geom; `None` in the world itself.
    body: Option<NodeId>,
    /// Object of the geom; `None` for a non-colliding geom, which is not a shape of a world.
    object: Option<String>,
    /// Colour specified by the geom or its material, if any.
    colour: Option<Colour>,
    /// `true` if MuJoCo's viewer shows the geom by default.
    is_seen: bool,
}

impl Looks {
    /// Records a geom: its object, its colour, and whether viewers show it.
    pub(super) fn add(
        &mut self,
        node: Node<'_, '_>,
        object: Option<&str>,
        colour: Option<Colour>,
        seen: bool,
    ) {
        let body = node.ancestors().find(|around| around.has_tag_name("body")).map(|body| body.id());
        self.0.push(Stated { body, object: object.map(str::to_owned), colour, is_seen: seen });
    }

    /// Number of geoms so far.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Assigns the object name to shapes among the geoms from index `first`.
    pub(super) fn rename(&mut self, first: usize, object: &str) {
        for stated in self.0.iter_mut().skip(first).filter(|stated| stated.object.is_some()) {
            stated.object = Some(object.to_owned());
        }
    }

    /// Returns the colours of objects: of the first visible shape, otherwise of the first visible
    /// non-colliding geom of the same bodies, otherwise of a hidden shape. Objects without a specified colour
    /// are omitted.
    pub(super) fn colours<'n>(&self, objects: impl Iterator<Item = &'n str>) -> BTreeMap<String, Colour> {
        let of = |name: &str| {
            let own = || self.0.iter().filter(|stated| stated.object.as_deref() == Some(name));
            let beside = || {
                let touch_nothing = self.0.iter().filter(|stated| stated.object.is_none());
                touch_nothing
                    .filter(|stated| stated.body.is_some() && own().any(|shape| shape.body == stated.body))
            };
            let seen = own().chain(beside()).filter(|stated| stated.is_seen);
            let colour = seen.chain(own()).find_map(|stated| stated.colour)?;
            Some((name.to_owned(), colour))
        };
        objects.filter_map(of).collect()
    }
}
