//! Checks of the values in a controller's `config` table.

use core::ops::RangeInclusive;

use motorium::prelude::*;
use motorium_robots::{Model, PerJoint};
use nalgebra::{DVector, Isometry3, Quaternion, Translation3, UnitQuaternion};

/// Returns `value` if it is within `range`. A bound of `f64::MIN` or `f64::MAX` means that the value is not
/// limited in this direction.
///
/// # Errors
/// [`ConfigError`] for `key` if the value is outside `range` or not finite.
pub fn in_range(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, ConfigError> {
    if range.contains(&value) {
        return Ok(value);
    }
    let expected = match (*range.start(), *range.end()) {
        (f64::MIN, f64::MAX) => "a finite number".to_owned(),
        (low, f64::MAX) => format!("at least {low}"),
        (low, high) => format!("a number from {low} to {high}"),
    };
    Err(ConfigError::key(key, format!("{value}, expected {expected}")))
}

/// Returns the magnitude of gravity, m/s2, from the key `gravity`, which must act along -z of the world.
///
/// # Errors
/// [`ConfigError`] for this key if gravity does not act along -z, or if its magnitude is outside 0.01 to 1000
/// m/s2.
pub fn downward_gravity(gravity: [f64; 3]) -> Result<f64, ConfigError> {
    let [0.0, 0.0, down] = gravity else {
        let message = format!("{gravity:?}, expected a vector along -z of the world");
        return Err(ConfigError::key("gravity", message));
    };
    Ok(-in_range("gravity[2]", down, -1000.0..=-0.01)?)
}

/// Expands a value given once for all independent joints of `model`, or once per joint, to one finite number
/// per joint.
pub(crate) fn per_joint(key: &str, given: &PerJoint, model: &Model) -> Result<DVector<f64>, ConfigError> {
    let values = given.resolve(model.joint_count()).map_err(|error| {
        ConfigError::key(key, error.to_string())
            .advise(format!("in this order: {}", model.joint_names().join(", ")))
    })?;
    for value in &values {
        in_range(key, *value, f64::MIN..=f64::MAX)?;
    }
    Ok(DVector::from_vec(values))
}

/// Returns `true` if `name` is a valid name of a task or an input: a lower-case letter, then lower-case
/// letters, digits and underscores.
pub(crate) fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

/// Converts a position \[m\] and a quaternion (x, y, z, w) to a pose. Returns `None` if a number is not
/// finite, or if the length of the quaternion is below 0.5 or at least 2. Rounding errors never change a unit
/// quaternion by that much.
pub(crate) fn pose_of(position: [f64; 3], orientation: [f64; 4]) -> Option<Isometry3<f64>> {
    let [x, y, z, w] = orientation;
    let rotation = Quaternion::new(w, x, y, z);
    let is_pose = position.iter().all(|number| number.is_finite()) && (0.5..2.0).contains(&rotation.norm());
    is_pose.then(|| {
        let rotation = UnitQuaternion::new_normalize(rotation);
        Isometry3::from_parts(Translation3::from(position), rotation)
    })
}
