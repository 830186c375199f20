//! Encoder of a simulated drive, and its search for a mark.

use super::Motor;

/// Shortest duration of a search, ns: a drive at its mark moves off it and returns.
const SHORTEST_NS: u64 = 250_000_000;

/// Mark of a simulated drive whose position is unknown after power-up, such as a switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// The mark works.
    #[default]
    Works,
    /// The mark is never met.
    Missing,
    /// The mark is met at every position.
    Stuck,
}

/// Shaft position at which an encoder reads zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Zero {
    /// Zero of the table.
    Absolute,
    /// Position at power-up, which is not known yet.
    PowerOn,
    /// This position, rad.
    At(f64),
}

impl Motor {
    /// Encoder reading with the shaft at this position, rad.
    pub(super) fn encoder(&mut self, shaft: f64) -> f64 {
        match self.zero {
            Zero::Absolute => shaft,
            Zero::At(zero) => shaft - zero,
            Zero::PowerOn => {
                self.zero = Zero::At(shaft);
                0.0
            }
        }
    }

    /// Cuts the power, which loses the zero of an encoder that is not absolute.
    pub(super) fn cut_power(&mut self) {
        if self.zero != Zero::Absolute {
            self.zero = Zero::PowerOn;
        }
    }

    /// Position of the shaft, rad.
    fn shaft(&self) -> f64 {
        match self.zero {
            Zero::At(zero) => self.position + zero,
            Zero::Absolute | Zero::PowerOn => self.position,
        }
    }
}

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
