//! Angles in radians that were probably written in degrees.

use core::f64::consts::{FRAC_PI_4, TAU};

/// Largest difference from a multiple of 45 degrees that rounding explains \[rad\].
const ROUNDING: f64 = 1e-3;

/// Returns a description of the first angle \[rad\] that was probably written in degrees; `None` if all are
/// plausible.
///
/// ```
/// use motorium_robots::degrees_doubt;
///
/// let found = degrees_doubt(&[0.0, 90.0, 0.0]).unwrap();
/// assert_eq!(found, "an angle of 90 rad; angles are in radians: if these are degrees, write 1.5708");
/// assert_eq!(degrees_doubt(&[0.0, 6.28, -4.7]), None);
/// ```
pub fn degrees_doubt(angles: &[f64]) -> Option<String> {
    let (angle, meant) = angles.iter().find_map(|angle| Some((angle, suspected_degrees(*angle)?)))?;
    Some(format!("an angle of {angle} rad; angles are in radians: if these are degrees, write {meant:.4}"))
}

/// Returns the angle in radians that was probably intended if `angle` \[rad\] was written in degrees; `None`
/// for a plausible angle.
///
/// An angle above a full revolution is only plausible if it is a multiple of pi/4, such as 2.5 pi, and not a
/// whole number.
///
/// ```
/// use motorium_robots::suspected_degrees;
///
/// assert_eq!(suspected_degrees(90.0), Some(90_f64.to_radians()));
/// assert_eq!(suspected_degrees(-4.7), None);
/// assert_eq!(suspected_degrees(2.5 * std::f64::consts::PI), None);
/// ```
pub fn suspected_degrees(angle: f64) -> Option<f64> {
    let is_multiple =
        angle.fract() != 0.0 && (angle - FRAC_PI_4 * (angle / FRAC_PI_4).round()).abs() < ROUNDING;
    (angle.is_finite() && angle.abs() > 1.001 * TAU && !is_multiple).then(|| angle.to_radians())
}
