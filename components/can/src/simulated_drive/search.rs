//! Search of a simulated drive for its mark.

use super::encoder::{Mark, Zero};
use super::motor::Motor;

/// Shortest duration of a search, ns: a drive at its mark moves off it and returns.
const SHORTEST_NS: u64 = 250_000_000;

/// Search for the mark, which is at the zero of the table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    velocity: f64,
    until_ns: u64,
    is_found: bool,
}

impl Search {
    /// Starts a search at `now_ns` with this speed, rad/s.
    pub(super) fn new(motor: &Motor, speed: f64, now_ns: u64) -> Self {
        let velocity = if motor.shaft() > 0.0 { -speed } else { speed };
        Self { velocity, until_ns: now_ns + SHORTEST_NS, is_found: false }
    }

    /// Velocity of this step; `None` once the mark is found. Then the encoder counts from the mark.
    pub(super) fn step(&mut self, motor: &mut Motor, now_ns: u64) -> Option<f64> {
        let is_passed = motor.shaft() * self.velocity >= 0.0;
        self.is_found |= is_passed && motor.mark == Mark::Works;
        if !self.is_found {
            return Some(self.velocity);
        }
        if now_ns < self.until_ns {
            return Some(0.0);
        }
        motor.zero = Zero::At(0.0);
        None
    }

    /// Ends at the present position, from which the encoder then counts.
    pub(super) fn here(motor: &mut Motor) {
        motor.zero = Zero::At(motor.shaft());
    }
}
