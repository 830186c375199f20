//! Colours of the objects in a world, and checks of the world's appearance.

use motorium_robots::{Colour, nearest};

use super::checks::check;
use super::{Object, World, WorldError};
use crate::appearance::{Appearance, Checker, Light};

/// Colour of fixed objects.
const FIXED: Colour = [0.55, 0.58, 0.62];
/// Colour of objects that move.
const FREE: Colour = [0.85, 0.55, 0.2];

impl Appearance {
    /// Returns the colour of an object.
    pub fn object(&self, object: &Object) -> Colour {
        let plain = if object.is_dynamic() { FREE } else { FIXED };
        self.colours.get(&object.name).copied().unwrap_or(plain)
    }

    /// Checks every value, and that all coloured objects exist.
    pub(crate) fn check(&self, world: &World) -> Result<(), WorldError> {
        let share = |field: &'static str, value: f64| {
            check("appearance", field, value, (0.0..=1.0).contains(&value), "a number from 0 to 1")
        };
        let ground = world.ground.map(|_| "ground");
        let terrain = world.terrain.as_ref().map(|_| "terrain");
        let objects = world.objects.iter().map(|object| object.name.as_str());
        let names: Vec<&str> = objects.chain(ground).chain(terrain).collect();
        for (name, colour) in &self.colours {
            if !names.contains(&name.as_str()) {
                let nearest = nearest(name, names.iter().copied()).map(str::to_owned);
                return Err(WorldError::NothingToColour { name: name.clone(), nearest });
            }
            colour.iter().try_for_each(|value| share("colours", *value))?;
        }
        self.sky.iter().try_for_each(|value| share("sky", *value))?;
        if let Some(Checker { side, colour }) = self.checker {
            let good = side.is_finite() && side > 0.0;
            check("appearance", "checker.side", side, good, "a positive number")?;
            colour.iter().try_for_each(|value| share("checker.colour", *value))?;
        }
        let Light { direction, ambient, .. } = self.light;
        share("light.ambient", ambient)?;
        let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt();
        let good = length.is_finite() && length > 1e-9;
        check("appearance", "light.direction", length, good, "a vector of nonzero length")
    }
}
