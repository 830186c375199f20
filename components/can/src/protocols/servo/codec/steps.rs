//! Positions of servos as steps of a turn.

use core::f64::consts::TAU;

/// Steps per turn.
pub const TURN: f64 = 4096.0;
/// Step of position 0, in the middle of the range.
pub const MIDDLE: f64 = 2048.0;

/// Returns the nearest step to a shaft position \[rad\], 0 to 4095.
pub(super) fn nearest(position: f64) -> u16 {
    (MIDDLE + position / TAU * TURN + 0.5).clamp(0.0, TURN - 1.0) as u16
}

/// Returns the position of a step, rad.
pub(super) fn position(step: i32) -> f64 {
    (f64::from(step) - MIDDLE) / TURN * TAU
}
