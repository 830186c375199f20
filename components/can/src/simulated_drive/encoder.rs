//! The encoder of a simulated drive, and its search for a mark.

use super::Motor;

/// Shortest time of a search, ns: a drive at its mark moves off it and returns.
const SHORTEST_NS: u64 = 250_000_000;

/// The mark of a simulated drive with unknown position at power-up, such as its switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// Works.
    #[default]
    Works,
    /// Never found.
    Missing,
    /// Found at every position.
    Stuck,
}

/// Position of the shaft at which an encoder reads zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Zero {
    /// Value in the table.
    Absolute,
    /// The position at power-up, which is unknown.
    PowerOn,
    /// This one, rad.
    At(f64),
}

impl Motor {
    /// Returns the encoder's reading with the shaft at this position, rad.
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

    /// Loses its power, and with it the zero of an encoder that is not absolute.
    pub(super) fn cut_power(&mut self) {
        if self.zero != Zero::Absolute {
            self.zero = Zero::PowerOn;
        }
    }

    /// The position of the shaft, rad.
    fn shaft(&self) -> f64 {
        match self.zero {
            Zero::At(zero) => self.position + zero,
            Zero::Absolute | Zero::PowerOn => self.position,
        }
    }
}

/// A search for the mark, which is at the table's zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    velocity: f64,
    until_ns: u64,
    is_found: bool,
}

impl Search {
    /// Begins at `now_ns`, with this speed, rad/s.
    pub(super) fn new(motor: &Motor, speed: f64, now_ns: u64) -> Self {
        let velocity = if motor.shaft() > 0.0 { -speed } else { speed };
        Self { velocity, until_ns: now_ns + SHORTEST_NS, is_found: false }
    }

    /// The velocity of this step; `None` once the mark is found, from which the encoder counts then.
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

    /// Ends at the drive's position, which becomes the encoder's zero.
    pub(super) fn here(motor: &mut Motor) {
        motor.zero = Zero::At(motor.shaft());
    }
}
