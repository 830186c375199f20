//! Contacts of the geoms of a world: the surface properties with the `condim` of each geom, and the pairs of
//! geoms that `contype` and `conaffinity` exclude from collision.

use motorium_robots::mjcf::{Attributes, Element, MjcfError, MjcfProblem, named};
use roxmltree::Node;

use crate::{Object, World};

/// Friction of a geom.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// An object with the coefficients of the geom.
    pub(super) object: Object,
    /// `condim`: contacts resist sliding above 1, spinning above 3 and rolling above 4.
    directions: f64,
}

impl Surface {
    /// Returns `true` if both have the same friction in all directions of their `condim`.
    pub(super) fn rubs_like(&self, other: &Self) -> bool {
        let of = |surface: &Self| {
            let Object { friction, torsional_friction, rolling_friction, .. } = surface.object;
            [friction, torsional_friction, rolling_friction]
        };
        let both = of(self).into_iter().zip(of(other)).zip(LARGEST_WITHOUT);
        self.directions == other.directions
            && both.into_iter().all(|((own, other), least)| own == other || self.directions <= least)
    }
}

/// Returns the friction of a geom. Warns about contact parameters that objects do not have.
pub(super) fn surface(geom: &Element<'_, '_, '_>) -> Result<Surface, MjcfError> {
    let [friction, torsional, rolling] = geom.first_numbers("friction", [1.0, 0.005, 0.0001])?;
    let directions = geom.number("condim", 3.0)?;
    for (name, reason) in [
        ("margin", "objects touch at their surfaces"),
        ("gap", "objects touch at their surfaces"),
        ("solref", "contacts are rigid here; set `soft` of the object for compliance"),
        ("solimp", "contacts are rigid here; set `soft` of the object for compliance"),
        ("priority", "friction comes from both surfaces"),
    ] {
        if geom.get(name).is_some_and(|value| value.split_whitespace().any(|part| part.parse() != Ok(0.0))) {
            geom.ignore(name, reason);
        }
    }
    let object =
        Object { friction, torsional_friction: torsional, rolling_friction: rolling, ..Object::default() };
    Ok(Surface { object, directions })
}

/// A surface of a world, before the directions of all surfaces are known.
struct Rubbing<'a, 'i> {
    geom: Node<'a, 'i>,
    directions: f64,
    moves: bool,
}

/// The surfaces of a world.
#[derive(Default)]
pub(super) struct Surfaces<'a, 'i> {
    ground: Option<Rubbing<'a, 'i>>,
    /// One entry per object.
    objects: Vec<Rubbing<'a, 'i>>,
}

impl<'a, 'i> Surfaces<'a, 'i> {
    pub(super) fn set_ground(&mut self, geom: Node<'a, 'i>, surface: &Surface) {
        self.ground = Some(Rubbing { geom, directions: surface.directions, moves: false });
    }

    /// Adds the surface of the next object.
    pub(super) fn add(&mut self, geom: Node<'a, 'i>, surface: &Surface, moves: bool) {
        self.objects.push(Rubbing { geom, directions: surface.directions, moves });
    }

    /// Drops the coefficients of directions in which contacts do not resist.
    ///
    /// A contact has the larger `condim` and the larger coefficients of its two geoms. A geom without a
    /// direction therefore keeps a coefficient that exceeds the other geom's. Two geoms without the direction
    /// then have friction if they touch, and cause a warning.
    pub(super) fn apply(&self, attributes: &Attributes<'a, 'i>, world: &mut World) {
        let all: Vec<&Rubbing<'a, 'i>> = self.ground.iter().chain(&self.objects).collect();
        for (kind, least) in LARGEST_WITHOUT.into_iter().enumerate() {
            let mut values: Vec<&mut f64> =
                coefficients(world).filter_map(|own| own.into_iter().nth(kind)).collect();
            let resists = |place: usize| all[place].directions > least;
            let places = 0..values.len().min(all.len());
            let smallest =
                places.clone().filter(|place| resists(*place)).map(|place| *values[place]).reduce(f64::min);
            let drops = |value: f64| smallest.is_none_or(|smallest| value <= smallest);
            let without: Vec<usize> = places.filter(|place| !resists(*place)).collect();
            for &place in &without {
                if drops(*values[place]) {
                    *values[place] = 0.0;
                } else if without
                    .iter()
                    .any(|other| *other != place && (all[*other].moves || all[place].moves))
                {
                    attributes.ignored(all[place].geom, "condim of <geom>".to_owned(), FRICTION_STAYS);
                }
            }
        }
    }
}

/// Largest `condim` of contacts without friction against sliding, spinning and rolling.
const LARGEST_WITHOUT: [f64; 3] = [1.0, 3.0, 4.0];

/// Reason in the warning about a direction that cannot be dropped.
const FRICTION_STAYS: &str =
    "contacts between this geom and another geom with a small condim have friction in a world";

/// Iterates over the coefficients of friction of the ground, then of the objects.
fn coefficients(world: &mut World) -> impl Iterator<Item = [&mut f64; 3]> {
    let ground = world
        .ground
        .iter_mut()
        .map(|ground| [&mut ground.friction, &mut ground.torsional_friction, &mut ground.rolling_friction]);
    let objects = world
        .objects
        .iter_mut()
        .map(|object| [&mut object.friction, &mut object.torsional_friction, &mut object.rolling_friction]);
    ground.chain(objects)
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
    /// The geom cannot collide with an earlier geom that may move relative to it; in a world, all objects
    /// collide.
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
                "contype and conaffinity keep it from touching <{}>, but all objects of a world touch; remove one geom, or \
                 give both a common bit",
                named(other.geom)
            );
            return Err(attributes.error(geom, MjcfProblem::Other(problem)));
        }
        self.geoms.push(Masked { geom, masks, moved_by });
        Ok(())
    }
}
