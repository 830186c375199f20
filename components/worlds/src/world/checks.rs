//! Range checks of single numbers in the description of a world.

use super::WorldError;

pub(super) fn check(
    owner: &str,
    field: &'static str,
    value: f64,
    good: bool,
    expected: &'static str,
) -> Result<(), WorldError> {
    if good { Ok(()) } else { Err(WorldError::Value { owner: owner.to_owned(), field, value, expected }) }
}

pub(super) fn finite(owner: &str, field: &'static str, value: f64) -> Result<(), WorldError> {
    check(owner, field, value, value.is_finite(), "a finite number")
}

/// Largest gravitational acceleration along an axis \[m/s2\]: more than thirty times Jupiter's.
const STRONGEST_GRAVITY: f64 = 1000.0;

pub(super) fn gravity(value: f64) -> Result<(), WorldError> {
    let good = value.abs() <= STRONGEST_GRAVITY;
    check("world", "gravity", value, good, "-1000 to 1000 m/s2")
}

pub(super) fn positive(owner: &str, field: &'static str, value: f64) -> Result<(), WorldError> {
    check(owner, field, value, value.is_finite() && value > 0.0, "a positive number")
}

pub(super) fn from_zero(owner: &str, field: &'static str, value: f64) -> Result<(), WorldError> {
    check(owner, field, value, value.is_finite() && value >= 0.0, "a number from 0 up")
}
