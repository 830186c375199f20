//! Memory for the witnesses of a pair of solids.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::Vector2;

use crate::math::V3;

/// Directions of small rotations.
pub(super) const TURNS: [(f64, f64); 8] = [
    (1.0, 0.0),
    (FRAC_1_SQRT_2, FRAC_1_SQRT_2),
    (0.0, 1.0),
    (-FRAC_1_SQRT_2, FRAC_1_SQRT_2),
    (-1.0, 0.0),
    (-FRAC_1_SQRT_2, -FRAC_1_SQRT_2),
    (0.0, -1.0),
    (FRAC_1_SQRT_2, -FRAC_1_SQRT_2),
];
/// A point of a solid, and its position perpendicular to the normal of a pair, relative to the nearest point
/// \[m\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) place: Vector2<f64>,
    pub(super) point: V3,
}

/// Memory for the witnesses of a pair.
#[derive(Debug)]
pub(super) struct WitnessRoom {
    pub(super) points: Vec<Seen>,
    /// Corners of the near part of each solid.
    pub(super) corners: [Vec<Seen>; 2],
    /// Corners of the region in which these parts face each other.
    pub(super) overlap: Vec<Vector2<f64>>,
    pub(super) clipped: Vec<Vector2<f64>>,
}

impl WitnessRoom {
    pub(super) fn new() -> Self {
        let corners = || Vec::with_capacity(2 * TURNS.len() + 4);
        let overlap = || Vec::with_capacity(4 * TURNS.len() + 8);
        Self {
            points: Vec::with_capacity(TURNS.len() + 1),
            corners: [corners(), corners()],
            overlap: overlap(),
            clipped: overlap(),
        }
    }
}
