//! Terrain: description of uneven ground, and the resulting height field.

mod cast;
mod error;
mod expression;
mod field;
mod image;
mod layers;

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{FrictionCombine, Softness};
pub use error::TerrainError;
pub use field::{HeightField, NearTriangle};
pub(crate) use image::Picture;
pub use layers::TerrainLayer;

/// Maximum number of heights of a terrain.
const MOST: f64 = 1e6;
/// Minimum distance between neighbouring heights \[m\].
const LEAST_SPACING: f64 = 1e-4;
/// Maximum distance of the centre from the origin, along x and y \[m\].
const FARTHEST: f64 = 1e6;

/// Width of the band around the level area over which the terrain rises to its height \[m\].
const BAND: f64 = 0.3;

/// Uneven ground, as an alternative to a plane. The height above z = 0 is the sum of the heights of all
/// layers.
///
/// Beyond the `size`, the height continues as at the nearest edge.
///
/// ```
/// use motorium_worlds::Terrain;
///
/// let text = r#"
/// size    = [6.0, 4.0]
/// spacing = 0.05
/// flat    = 0.5
/// seed    = 7
/// layers  = [
///     { slope  = { angle = 0.1, from = 1.0 } },
///     { stones = { height = 0.03, size = 0.2, per_square_metre = 8.0 } },
/// ]
/// "#;
/// let terrain: Terrain = toml::from_str(text).unwrap();
/// let field = terrain.height_field().unwrap();
/// assert_eq!(field.height(0.3, 0.2), 0.0);
/// assert!(field.height(2.9, 0.0) >= 1.9 * 0.1_f64.tan() - 1e-3);
/// assert_eq!(field, terrain.height_field().unwrap());
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Terrain {
    /// Length of the terrain along x and y (m).
    pub size: [f64; 2],
    /// Centre of the terrain along x and y (m). Default: the origin.
    #[serde(default)]
    pub centre: [f64; 2],
    /// Distance between adjacent heights (m). Default 0.05. Steeper features, such as the front of a step,
    /// become slopes of this horizontal length.
    #[serde(default = "default_spacing")]
    pub spacing: f64,
    /// Radius of the level area at z = 0 around the origin of the world (m). Default 0.
    #[serde(default)]
    pub flat: f64,
    /// Seed of the random features of layers. Default 0.
    #[serde(default)]
    pub seed: u64,
    /// Scales all heights. Default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Coefficient of friction, default 0.8. A surface with friction 0 is frictionless against every surface
    /// without a `friction_combine`.
    #[serde(default = "default_friction")]
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Rule by which the friction coefficients of two surfaces combine. Default: the mean if the friction is
    /// above 0, otherwise the product.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_combine: Option<FrictionCombine>,
    /// Coefficient of torsional friction (m): maximum torque about the contact normal per normal force.
    /// Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub torsional_friction: f64,
    /// Coefficient of rolling friction (m): maximum torque against rolling per normal force. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub rolling_friction: f64,
    /// Fraction of the approach speed kept after an impact, from 0 to 1. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
    /// Softness: contact points yield like a spring and a damper. Default: the surface is rigid.
    #[serde(default)]
    pub soft: Option<Softness>,
    /// Layers of the terrain. The heights of all layers are added.
    pub layers: Vec<TerrainLayer>,
}

fn one() -> f64 {
    1.0
}

fn default_spacing() -> f64 {
    0.05
}

fn default_friction() -> f64 {
    0.8
}

impl Terrain {
    /// Resolves relative paths of image files from a folder.
    pub fn locate(&mut self, folder: &Path) {
        for layer in &mut self.layers {
            if let TerrainLayer::Image { file, .. } = layer {
                *file = folder.join(&*file).to_string_lossy().into_owned();
            }
        }
    }

    /// Checks everything that does not require an image: the numbers, and the other layers over a single
    /// cell.
    pub(crate) fn check_numbers(&self) -> Result<(), TerrainError> {
        self.cells()?;
        let grid = (self.centre, self.spacing, [2; 2]);
        for (number, layer) in self.layers.iter().enumerate() {
            if !matches!(layer, TerrainLayer::Image { .. }) {
                layer.add(&format!("layers[{number}]"), self.seed, grid, &mut [0.0; 4])?;
            }
        }
        Ok(())
    }

    /// Returns the number of cells along x and y, after checking all other numbers.
    fn cells(&self) -> Result<[f64; 2], TerrainError> {
        let positive = |key: &str, value: f64| {
            let good = value.is_finite() && value > 0.0;
            if good { Ok(()) } else { Err(TerrainError::value(key, value, "a positive number")) }
        };
        positive("spacing", self.spacing)?;
        if self.spacing < LEAST_SPACING {
            return Err(TerrainError::value("spacing", self.spacing, "at least 1e-4"));
        }
        for size in self.size {
            positive("size", size)?;
        }
        for (key, value) in [
            ("centre", self.centre[0]),
            ("centre", self.centre[1]),
            ("friction", self.friction),
            ("scale", self.scale),
        ] {
            if !value.is_finite() {
                return Err(TerrainError::value(key, value, "a finite number"));
            }
            if key == "centre" && value.abs() > FARTHEST {
                return Err(TerrainError::value(key, value, "a number from -1e6 to 1e6"));
            }
        }
        let shares = [
            ("friction", self.friction, f64::MAX),
            ("torsional_friction", self.torsional_friction, f64::MAX),
            ("rolling_friction", self.rolling_friction, f64::MAX),
            ("restitution", self.restitution, 1.0),
            ("flat", self.flat, 1e6),
        ];
        for (key, value, most) in shares {
            if !(0.0..=most).contains(&value) {
                let expected =
                    if key == "restitution" { "a number from 0 to 1" } else { "a number from 0 up" };
                return Err(TerrainError::value(key, value, expected));
            }
        }
        if let Some(Softness { stiffness, damping }) = self.soft {
            if !(stiffness > 0.0 && stiffness.is_finite()) {
                return Err(TerrainError::value("soft.stiffness", stiffness, "a positive number"));
            }
            if !(damping >= 0.0 && damping.is_finite()) {
                return Err(TerrainError::value("soft.damping", damping, "a number from 0 up"));
            }
        }
        let cells = self.size.map(|size| (size / self.spacing).round().max(1.0));
        let found = (cells[0] + 1.0) * (cells[1] + 1.0);
        if found > MOST {
            return Err(TerrainError::Fine { found, most: MOST });
        }
        Ok(cells)
    }

    /// Returns the height field of the terrain. The function reads the image files of the layers; apart from
    /// these files, the result depends only on the description.
    ///
    /// # Errors
    /// [`TerrainError`] if a value is out of range or an image cannot be read.
    pub fn height_field(&self) -> Result<HeightField, TerrainError> {
        let cells = self.cells()?;
        let count = cells.map(|cells| cells as usize + 1);
        let corner = [0, 1].map(|axis| self.centre[axis] - 0.5 * cells[axis] * self.spacing);
        let place = |index: usize, axis: usize| corner[axis] + self.spacing * index as f64;
        let mut heights = vec![0.0; count[0] * count[1]];
        for (number, layer) in self.layers.iter().enumerate() {
            // every layer has separate random numbers
            let seed = layers::mixed(self.seed ^ (number as u64) << 32);
            layer.add(&format!("layers[{number}]"), seed, (corner, self.spacing, count), &mut heights)?;
        }
        for (index, height) in heights.iter_mut().enumerate() {
            let (x, y) = (place(index / count[1], 0), place(index % count[1], 1));
            *height *= self.scale;
            if !height.is_finite() || height.abs() > 1e6 {
                return Err(TerrainError::Height { x, y, height: *height });
            }
            if self.flat > 0.0 {
                let share = ((x.hypot(y) - self.flat) / BAND).clamp(0.0, 1.0);
                *height *= share * share * (3.0 - 2.0 * share);
            }
        }
        let mut next = heights.into_iter();
        Ok(HeightField::new(corner, self.spacing, count, |_, _| next.next().unwrap_or_default()))
    }
}
