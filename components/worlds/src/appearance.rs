//! Appearance of a world: colours, light, sky.

use std::collections::BTreeMap;

use motorium_robots::Colour;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Colour of the ground.
const EARTH: Colour = [0.8, 0.82, 0.84];

/// Colours, light and sky of a world, as seen by cameras. The appearance has no effect on physics.
///
/// ```
/// use motorium_worlds::Appearance;
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
    /// Colours by object name: red, green and blue, 0 to 1. The names `ground` and `terrain` colour the plane
    /// and the terrain. Default: fixed objects grey, free objects orange, the ground light grey. Links have
    /// the colours of their visuals.
    pub colours: BTreeMap<String, Colour>,
    /// Checkerboard on the ground: squares of a second colour alternate with squares of the ground's colour.
    /// Default: no checkerboard.
    pub checker: Option<Checker>,
    /// Background colour: red, green and blue, 0 to 1.
    pub sky: Colour,
    /// Lighting.
    pub light: Light,
}

/// A checkerboard on the ground. The world origin is at a corner of four squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checker {
    /// Side length of a square (m).
    pub side: f64,
    /// Colour of every second square: red, green and blue, 0 to 1.
    pub colour: Colour,
}

/// Directional light, such as sunlight, and ambient light.
///
/// A matt surface of colour `c` with outward normal `n` has the colour
/// `c (ambient + (1 - ambient) max(0, -n d))` for light that travels along the unit vector `d` (Lambert's
/// law). In a shadow, the colour is `c ambient`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Light {
    /// Direction in which the light travels, of any nonzero length, world axes. Default [0.3, 0.4, -1.0].
    pub direction: [f64; 3],
    /// Ambient light as a fraction of the total, 0 to 1. Default 0.35.
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
    /// Returns the colour of the ground, which is a plane or a terrain.
    pub fn ground(&self) -> Colour {
        let stated = self.colours.get("ground").or_else(|| self.colours.get("terrain"));
        stated.copied().unwrap_or(EARTH)
    }
}
