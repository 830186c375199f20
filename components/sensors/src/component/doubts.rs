//! Settings that are probably in another unit, and checks of gravity.

use motorium::declare::{ConfigError, Declare};

use crate::channel::ErrorModel;

/// The plausible magnitudes of a quantity, and the unit in which a larger number was probably written.
#[derive(Clone, Copy)]
pub(super) struct Plausible {
    /// Largest plausible magnitude.
    most: f64,
    /// Unit of the setting.
    unit: &'static str,
    /// Name of the other unit, and its factor to the unit of the setting.
    other: (&'static str, f64),
}

impl Plausible {
    /// Lengths up to `most` \[m\]; larger ones are probably in millimetres.
    pub(super) const fn length(most: f64) -> Self {
        Self { most, unit: "m", other: ("mm", 1e-3) }
    }

    /// Angles up to `most` \[rad\]; larger ones are probably in degrees.
    pub(super) const fn angle(most: f64) -> Self {
        Self { most, unit: "rad", other: ("degrees", core::f64::consts::PI / 180.0) }
    }

    /// Angular velocities up to `most` \[rad/s\]; larger ones are probably in degrees per second.
    pub(super) const fn rate(most: f64) -> Self {
        Self { most, unit: "rad/s", other: ("degrees/s", core::f64::consts::PI / 180.0) }
    }

    /// Warns of the first of some values of a setting that is implausible.
    pub(super) fn warn(self, key: &str, values: &[f64], declare: &mut Declare) {
        let Self { most, unit, other: (other, factor) } = self;
        if let Some(value) = values.iter().copied().find(|value| value.abs() > most) {
            declare
                .warn(format!("{value} {unit}, expected at most {most} {unit}"))
                .key(key)
                .advise(format!("if it is in {other}, write {}", rounded(value * factor)));
        }
    }

    /// Warns of implausible errors of a quantity: noise, bias and resolution.
    pub(super) fn warn_of_errors(self, key: &str, errors: &ErrorModel, declare: &mut Declare) {
        let ErrorModel { noise, bias, resolution, .. } = *errors;
        for (name, value) in [("noise", noise), ("bias", bias), ("resolution", resolution)] {
            self.warn(&format!("{key}.{name}"), &[value], declare);
        }
    }
}

/// Largest gravitational acceleration along an axis \[m/s2\].
const STRONGEST_GRAVITY: f64 = 1000.0;

/// Checks the key `gravity`.
///
/// # Errors
/// [`ConfigError`] if a number is not from -1000 to 1000 m/s2.
pub(super) fn check_gravity(gravity: [f64; 3]) -> Result<(), ConfigError> {
    match gravity.into_iter().find(|number| !(-STRONGEST_GRAVITY..=STRONGEST_GRAVITY).contains(number)) {
        Some(number) => {
            Err(ConfigError::key("gravity", format!("{number}, expected from -1000 to 1000 m/s2")))
        }
        None => Ok(()),
    }
}

/// Returns a number with four significant digits.
pub(super) fn rounded(number: f64) -> f64 {
    format!("{number:.3e}").parse().unwrap_or(number)
}
