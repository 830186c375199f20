//! Contacts of the geoms of a world: surfaces, and the pairs that `contype` and `conaffinity` keep from
//! touching.

use motorium_robots::mjcf::{Attributes, Element, MjcfError, MjcfProblem, named};
use roxmltree::Node;

use crate::Object;

/// An object with the coefficients of friction of a geom. Warns of parameters of contacts that no object has.
pub(super) fn surface(geom: &Element<'_, '_, '_>) -> Result<Object, MjcfError> {
    let [friction, torsional, rolling] = geom.first_numbers("friction", [1.0, 0.005, 0.0001])?;
    let directions = geom.number("condim", 3.0)?;
    for (name, reason) in [
        ("margin", "objects touch at their surfaces"),
        ("gap", "objects touch at their surfaces"),
        ("solref", "contacts are rigid here; `soft` of an object makes them give way"),
        ("solimp", "contacts are rigid here; `soft` of an object makes them give way"),
        ("priority", "friction comes from both surfaces"),
    ] {
        if geom.get(name).is_some_and(|value| value.split_whitespace().any(|part| part.parse() != Ok(0.0))) {
            geom.ignore(name, reason);
        }
    }
    Ok(Object {
        friction: if directions > 1.0 { friction } else { 0.0 },
        torsional_friction: if directions > 3.0 { torsional } else { 0.0 },
        rolling_friction: if directions > 4.0 { rolling } else { 0.0 },
        ..Object::default()
    })
}

struct Masked<'a, 'i> {
    geom: Node<'a, 'i>,
    masks: [i32; 2],
    /// Body with the free joint that moves it; `None` for a fixed geom.
    moved_by: Option<Node<'a, 'i>>,
}

/// The geoms of a world with their masks.
#[derive(Default)]
pub(super) struct Contacts<'a, 'i> {
    geoms: Vec<Masked<'a, 'i>>,
}

impl<'a, 'i> Contacts<'a, 'i> {
    /// Adds a geom with its `contype` and `conaffinity`.
    ///
    /// # Errors
    ///
    /// An earlier geom that may move relative to it never touches it; in a world all objects touch.
    pub(super) fn add(
        &mut self,
        attributes: &Attributes<'a, 'i>,
        geom: Node<'a, 'i>,
        masks: [i32; 2],
    ) -> Result<(), MjcfError> {
        let is_free = |body: &Node<'_, '_>| {
            let joint = |child: Node<'_, '_>| ["joint", "freejoint"].contains(&child.tag_name().name());
            body.has_tag_name("body") && body.children().any(joint)
        };
        let moved_by = geom.ancestors().find(is_free);
        let passes = |other: &&Masked<'_, '_>| {
            other.moved_by != moved_by && masks[0] & other.masks[1] == 0 && other.masks[0] & masks[1] == 0
        };
        if let Some(other) = self.geoms.iter().find(passes) {
            let problem = format!(
                "contype and conaffinity keep it from touching <{}>, and all objects of a world touch: leave one of them out, or \
                 give both a common bit",
                named(other.geom)
            );
            return Err(attributes.error(geom, MjcfProblem::Other(problem)));
        }
        self.geoms.push(Masked { geom, masks, moved_by });
        Ok(())
    }
}
