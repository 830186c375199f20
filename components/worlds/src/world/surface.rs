//! Checks of surfaces, and the choice of one friction rule for a whole world.

use nalgebra::Vector3;

use super::checks::{check, from_zero, positive};
use super::{Ground, Object, World, WorldError};
use crate::{FrictionCombine, Grain, Softness};

impl Softness {
    /// Checks every value of the surface. Error messages call the surface `owner`.
    ///
    /// # Errors
    ///
    /// [`WorldError::Value`] for a value out of range.
    pub fn check(&self, owner: &str) -> Result<(), WorldError> {
        positive(owner, "soft.stiffness", self.stiffness)?;
        from_zero(owner, "soft.damping", self.damping)
    }
}

impl Grain {
    /// Checks every value of the surface. Error messages call the surface `owner`.
    ///
    /// # Errors
    ///
    /// [`WorldError::Value`] for a value out of range.
    pub fn check(&self, owner: &str) -> Result<(), WorldError> {
        let length = Vector3::from(self.direction).norm();
        let good = length.is_finite() && length > 0.0;
        check(owner, "grain.direction", length, good, "a vector of nonzero length")?;
        from_zero(owner, "grain.friction", self.friction)
    }
}

impl World {
    /// Sets this rule for all surfaces, unless they have equal coefficients: the friction is then the same
    /// under every rule except `multiply`.
    pub(crate) fn combine_frictions(&mut self, rule: FrictionCombine) {
        let all = || {
            let of_object =
                |object: &Object| [object.friction, object.torsional_friction, object.rolling_friction];
            let of_ground =
                |ground: &Ground| [ground.friction, ground.torsional_friction, ground.rolling_friction];
            self.ground.iter().map(of_ground).chain(self.objects.iter().map(of_object))
        };
        if all().zip(all().skip(1)).all(|(one, other)| one == other) {
            return;
        }
        self.ground.iter_mut().for_each(|ground| ground.friction_combine = Some(rule));
        self.objects.iter_mut().for_each(|object| object.friction_combine = Some(rule));
    }
}
