//! Gaits: the order in which legs move.

use core::fmt;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A gait: the phase of every leg within the stride.
///
/// Legs come in pairs, left before right, from the front to the rear: two are L, R; four are LF, RF, LH, RH;
/// six are LF, RF, LM, RM, LH, RH. A leg with a larger phase is ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Gait {
    /// One leg after the other. Two legs alternate. Four legs follow the lateral sequence LF, RH, RF, LH, a
    /// quarter of a stride apart. Six legs follow the metachronal wave: on each side from rear to front, a
    /// sixth of a stride apart, the two sides alternating.
    Walk,
    /// Diagonal legs move together. Only for four legs.
    Trot,
    /// Both legs of a side move together. Only for four legs.
    Pace,
    /// The front legs move together, then the hind legs. With two legs, both move together (a hop). Only for
    /// two or four legs.
    Bound,
    /// Alternating tripods: LF, RM and LH move together, then RF, LM and RH. Only for six legs.
    Tripod,
}

/// Error returned when a gait is not defined for a number of legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the {gait} gait is not defined for {legs} legs: {}", advice(*.legs))]
pub struct GaitError {
    /// Requested gait.
    pub gait: Gait,
    /// Number of legs.
    pub legs: usize,
}

fn advice(legs: usize) -> &'static str {
    match legs {
        2 => "use walk or bound",
        4 => "use walk, trot, pace or bound",
        6 => "use walk or tripod",
        _ => "gaits are defined for two, four and six legs",
    }
}

impl fmt::Display for Gait {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Gait {
    /// Returns the name of the gait in graph files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Walk => "walk",
            Self::Trot => "trot",
            Self::Pace => "pace",
            Self::Bound => "bound",
            Self::Tripod => "tripod",
        }
    }

    /// Returns the gaits defined for a number of legs; empty unless `legs` is 2, 4 or 6.
    pub fn for_legs(legs: usize) -> &'static [Self] {
        match legs {
            2 => &[Self::Walk, Self::Bound],
            4 => &[Self::Walk, Self::Trot, Self::Pace, Self::Bound],
            6 => &[Self::Walk, Self::Tripod],
            _ => &[],
        }
    }

    /// Returns the phase of each leg, rad in \[0, 2 pi).
    ///
    /// # Errors
    /// [`GaitError`] if the gait is not defined for this number of legs.
    pub fn phases(self, legs: usize) -> Result<&'static [f64], GaitError> {
        Ok(match (self, legs) {
            (Self::Walk, 2) => &[0.0, PI],
            (Self::Bound, 2) => &[0.0, 0.0],
            (Self::Walk, 4) => &[0.0, PI, 3.0 * FRAC_PI_2, FRAC_PI_2],
            (Self::Trot, 4) => &[0.0, PI, PI, 0.0],
            (Self::Pace, 4) => &[0.0, PI, 0.0, PI],
            (Self::Bound, 4) => &[0.0, 0.0, PI, PI],
            (Self::Walk, 6) => &[0.0, PI, FRAC_PI_3, 4.0 * FRAC_PI_3, 2.0 * FRAC_PI_3, 5.0 * FRAC_PI_3],
            (Self::Tripod, 6) => &[0.0, PI, PI, 0.0, 0.0, PI],
            _ => return Err(GaitError { gait: self, legs }),
        })
    }

    /// Returns the usual fraction of the stride that a leg spends in stance. The fraction exceeds one half
    /// for gaits without a flight phase.
    pub fn duty_factor(self, legs: usize) -> f64 {
        match (self, legs) {
            (Self::Walk, 2) => 0.6,
            (Self::Walk, 4) => 0.75,
            (Self::Walk, _) => 5.0 / 6.0,
            (Self::Bound, _) => 0.4,
            (Self::Trot | Self::Pace | Self::Tripod, _) => 0.5,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gait_for_another_leg_count_is_rejected_with_alternatives() {
        let error = Gait::Tripod.phases(4).unwrap_err().to_string();
        assert_eq!(error, "the tripod gait is not defined for 4 legs: use walk, trot, pace or bound");
        assert!(Gait::Walk.phases(5).unwrap_err().to_string().contains("two, four and six"));
    }

    /// In Hildebrand's lateral sequence, the front foot of a side follows the hind foot of the same side.
    #[test]
    fn walk_follows_the_lateral_sequence() {
        let phases = Gait::Walk.phases(4).unwrap();
        // the leg that is farthest ahead reaches the same point of its stride first
        let mut order = [0, 1, 2, 3];
        order.sort_by(|a, b| phases[*b].total_cmp(&phases[*a]));
        assert_eq!(order.map(|leg| ["LF", "RF", "LH", "RH"][leg]), ["LH", "RF", "RH", "LF"]);
    }

    #[test]
    fn tripod_never_lifts_two_adjacent_legs() {
        let phases = Gait::Tripod.phases(6).unwrap();
        for (a, b) in [(0, 1), (2, 3), (4, 5), (0, 2), (2, 4), (1, 3), (3, 5)] {
            assert_eq!((phases[a] - phases[b]).abs(), PI);
        }
    }
}
