//! The looks of a world: colours, light, sky.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Red, green and blue, 0 to 1 each.
pub type Colour = [f64; 3];

/// Colour of the ground.
const EARTH: Colour = [0.8, 0.82, 0.84];
/// Colours of links without a stated colour: the base, then alternating links.
const PLAIN: [Colour; 3] = [[0.55, 0.57, 0.6], [0.93, 0.93, 0.93], [0.72, 0.77, 0.84]];

/// The appearance of a world, for cameras. It has no effect on physics.
///
/// ```
/// use motorium_robots::Appearance;
///
/// let text = r#"
/// colours = { ball = [0.9, 0.1, 0.1], ground = [0.7, 0.7, 0.7] }
/// checker = { side = 0.25, colour = [0.5, 0.5, 0.5] }
/// sky     = [0.6, 0.75, 0.95]
/// light   = { direction = [0.3, 0.4, -1.0], ambient = 0.35 }
/// "#;
/// let appearance: Appearance = toml::from_str(text).unwrap();
/// assert_eq!(appearance.ground(), [0.7; 3]);
/// assert!(appearance.light.shadows);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Appearance {
    /// Colours of objects by their names, of the plane by `ground`, of the terrain by `terrain`: red, green
    /// and blue, 0 to 1. Default: fixed objects grey, free ones orange, the ground light grey. Links have the
    /// colours of their visuals.
    pub colours: BTreeMap<String, Colour>,
    /// Squares of a second colour on the ground. Default: none.
    pub checker: Option<Checker>,
    /// Colour where there is nothing.
    pub sky: Colour,
    /// The light.
    pub light: Light,
}

/// A checkerboard on the ground. A corner is at the origin of the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checker {
    /// Side of a square (m).
    pub side: f64,
    /// The second colour: red, green and blue, 0 to 1.
    pub colour: Colour,
}

/// Light from far away, as the sun's, and from all sides.
///
/// A matt surface of colour `c` with the outward normal `n` is seen as `c (ambient + (1 - ambient) max(0, -n
/// d))`, `d` the direction of the light (Lambert's law); in a shadow as `c ambient`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Light {
    /// Direction of the light, of any nonzero length. Default [0.3, 0.4, -1.0].
    pub direction: [f64; 3],
    /// Fraction of ambient light, 0 to 1. Default 0.35.
    pub ambient: f64,
    /// `true` if objects cast shadows. Default true.
    pub shadows: bool,
}

impl Default for Appearance {
    fn default() -> Self {
        Self { colours: BTreeMap::new(), checker: None, sky: [0.65, 0.78, 0.92], light: Light::default() }
    }
}

impl Default for Light {
    fn default() -> Self {
        Self { direction: [0.3, 0.4, -1.0], ambient: 0.35, shadows: true }
    }
}

impl Appearance {
    /// The colour of the ground, plane or terrain.
    pub fn ground(&self) -> Colour {
        let stated = self.colours.get("ground").or_else(|| self.colours.get("terrain"));
        stated.copied().unwrap_or(EARTH)
    }
}

/// Colours of the links of a robot, from the visuals of its URDF or the geoms of its MJCF.
///
/// ```
/// use motorium_robots::LinkColours;
///
/// let urdf = r#"<robot name="r">
///   <material name="red"><color rgba="1 0 0 1"/></material>
///   <link name="a"><visual><geometry><sphere radius="1"/></geometry><material name="red"/></visual></link>
///   <link name="b"/>
/// </robot>"#;
/// let colours = LinkColours::of_urdf(urdf);
/// assert_eq!(colours.of_shape("a", 0, None), [1.0, 0.0, 0.0]);
/// assert_eq!(colours.of_shape("b", 0, Some(0)), [0.93; 3]);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkColours(BTreeMap<String, Vec<Option<Colour>>>);

impl LinkColours {
    /// The colours of the shapes of each link, in their order.
    pub(crate) fn of_shapes(links: BTreeMap<String, Vec<Option<Colour>>>) -> Self {
        Self(links)
    }

    /// Returns these colours, completed by another set for links without a colour here.
    #[must_use]
    pub(crate) fn or(mut self, other: Self) -> Self {
        for (link, colours) in other.0 {
            let own = self.0.entry(link).or_default();
            if own.iter().all(Option::is_none) {
                *own = colours;
            }
        }
        self
    }

    /// Returns the colour of a shape of a link: the visual at index `place` of the link, else its last
    /// visual, else a default by the moving `body` of the link; `None` is the base.
    pub fn of_shape(&self, link: &str, place: usize, body: Option<usize>) -> Colour {
        self.stated(link, place).unwrap_or(PLAIN[body.map_or(0, |body| 1 + body % 2)])
    }

    /// Returns the colour of the visual at index `place` of a link, else of its last visual, if stated.
    pub(crate) fn stated(&self, link: &str, place: usize) -> Option<Colour> {
        self.0.get(link).and_then(|colours| colours.get(place).or(colours.last())).copied().flatten()
    }
}
