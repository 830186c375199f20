//! Range checks of the numbers of the ground and the objects.

use super::checks::{check, finite, from_zero, positive};
use super::shape::check_parts;
use super::{Conveyor, Ground, Object, ObjectShape, WorldError};
use crate::{Grain, Softness};

impl Ground {
    /// Checks its numbers.
    pub(super) fn check_numbers(&self) -> Result<(), WorldError> {
        finite("ground", "height", self.height)?;
        let frictions = [self.friction, self.torsional_friction, self.rolling_friction];
        surface("ground", frictions, self.restitution, self.conveyor)?;
        textured("ground", self.soft, self.grain)
    }
}

impl Object {
    /// Checks its numbers, and its shape unless that requires a file.
    pub(super) fn check_numbers(&self) -> Result<(), WorldError> {
        let name = self.name.as_str();
        for value in self.position {
            finite(name, "position", value)?;
        }
        for value in self.rpy {
            finite(name, "rpy", value)?;
        }
        for value in self.velocity.into_iter().chain(self.angular_velocity) {
            finite(name, "velocity or angular_velocity", value)?;
        }
        if !self.is_dynamic() && (self.velocity, self.angular_velocity) != ([0.0; 3], [0.0; 3]) {
            let problem = "a fixed object cannot have a velocity; give the object a `mass` or a `density`";
            return Err(WorldError::Parts { name: name.to_owned(), problem });
        }
        // Files are checked once the folder for paths is known.
        if !self.shape.has_files() {
            self.check_shape()?;
        }
        for (field, value) in [("mass", self.mass), ("density", self.density)] {
            value.map_or(Ok(()), |value| positive(name, field, value))?;
        }
        if self.mass.is_some() && self.density.is_some() {
            return Err(WorldError::TwoMasses { name: name.to_owned() });
        }
        from_zero(name, "drag", self.drag)?;
        let frictions = [self.friction, self.torsional_friction, self.rolling_friction];
        surface(name, frictions, self.restitution, self.conveyor)?;
        textured(name, self.soft, self.grain)
    }

    /// Checks the shape, including a mesh file.
    pub(super) fn check_shape(&self) -> Result<(), WorldError> {
        match &self.shape {
            ObjectShape::Compound(parts) => check_parts(&self.name, parts, self.density.is_some()),
            shape => shape.check(&self.name, self.is_dynamic()),
        }
    }
}

impl ObjectShape {
    fn has_files(&self) -> bool {
        match self {
            Self::Mesh(_) => true,
            Self::Compound(parts) => parts.iter().any(|part| part.shape.has_files()),
            _ => false,
        }
    }
}

/// Checks a softness and a grain.
fn textured(owner: &str, soft: Option<Softness>, grain: Option<Grain>) -> Result<(), WorldError> {
    soft.map_or(Ok(()), |soft| soft.check(owner))?;
    grain.map_or(Ok(()), |grain| grain.check(owner))
}

fn surface(
    owner: &str,
    [friction, torsional, rolling]: [f64; 3],
    restitution: f64,
    conveyor: Option<Conveyor>,
) -> Result<(), WorldError> {
    from_zero(owner, "friction", friction)?;
    from_zero(owner, "torsional_friction", torsional)?;
    from_zero(owner, "rolling_friction", rolling)?;
    check(owner, "restitution", restitution, (0.0..=1.0).contains(&restitution), "a number from 0 to 1")?;
    for value in conveyor.iter().flat_map(|conveyor| conveyor.velocity) {
        finite(owner, "conveyor.velocity", value)?;
    }
    Ok(())
}
