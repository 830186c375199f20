//! Bounds of a setpoint's value and of its rate of change.

/// Fraction of a joint's range by which a position setpoint may exceed the range. The tolerance covers sensor
/// noise at a joint stop.
pub const RANGE_TOLERANCE: f64 = 1e-3;
/// Fraction by which a rate may exceed its limit. Tolerates rounding errors in a setpoint that changes
/// exactly at the limit.
pub const ROUNDING: f64 = 1e-6;

/// Returns the end of the range \[rad or m\] that must replace a position setpoint outside the range. Returns
/// `None` if the setpoint may be forwarded, because it is inside the range or outside by at most
/// [`RANGE_TOLERANCE`] times the length of the range. A range with an infinite end counts as having the
/// length 1.
///
/// ```
/// use motorium_drive::within_range;
///
/// assert_eq!(within_range(0.5, -1.0, 1.0), None);
/// assert_eq!(within_range(1.001, -1.0, 1.0), None);
/// assert_eq!(within_range(1.5, -1.0, 1.0), Some(1.0));
/// ```
#[inline]
pub fn within_range(position: f64, lower: f64, upper: f64) -> Option<f64> {
    if position >= lower && position <= upper {
        return None;
    }
    let range = upper - lower;
    let tolerance = if range.is_finite() { RANGE_TOLERANCE * range } else { RANGE_TOLERANCE };
    let end = position.max(lower).min(upper);
    ((position - end).abs() > tolerance).then_some(end)
}

/// Returns the value that must replace the setpoint `value`, if `value` differs from the previous setpoint
/// `before` by more than `largest`. Otherwise returns `None`, and the setpoint may be forwarded bit for bit.
///
/// ```
/// use motorium_drive::within_rate;
///
/// assert_eq!(within_rate(0.3, 0.2, 0.2), None);
/// assert_eq!(within_rate(-0.3, 0.2, 0.25), Some(0.2 - 0.25));
/// ```
#[inline]
pub fn within_rate(value: f64, before: f64, largest: f64) -> Option<f64> {
    let step = value - before;
    (step.abs() > largest * (1.0 + ROUNDING)).then(|| before + largest.copysign(step))
}
