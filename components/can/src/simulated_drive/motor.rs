//! Motor of a simulated drive, with its encoder.

use super::encoder::{Mark, Zero};

/// Motor of a simulated drive: its shaft, applied torque and temperature.
#[derive(Clone, Debug)]
pub(super) struct Motor {
    /// N m.
    pub(super) largest: f64,
    /// Configured limit, N m.
    pub(super) limit: f64,
    pub(super) stepped_ns: u64,
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) torque: f64,
    pub(super) temperature: f64,
    pub(super) zero: Zero,
    pub(super) mark: Mark,
}

/// Ambient temperature, degrees Celsius.
const SURROUNDINGS: f64 = 25.0;
/// Temperature rise at continuous full torque, degrees.
const RISE: f64 = 90.0;
/// Time constant of the temperature, s.
const WARM_UP: f64 = 120.0;
/// Temperature at which a drive disables itself, degrees Celsius.
const TOO_HOT: f64 = 100.0;

impl Motor {
    pub(super) fn new(largest: f64) -> Self {
        let temperature = SURROUNDINGS;
        Self {
            largest,
            limit: largest,
            stepped_ns: 0,
            position: 0.0,
            velocity: 0.0,
            torque: 0.0,
            temperature,
            zero: Zero::Absolute,
            mark: Mark::Works,
        }
    }

    /// Sets the present position \[rad\] and velocity \[rad/s\] of the shaft.
    pub(super) fn turn(&mut self, position: f64, velocity: f64, now_ns: u64) {
        (self.position, self.velocity) = (position, velocity);
        let dt = now_ns.saturating_sub(self.stepped_ns) as f64 * 1e-9;
        self.stepped_ns = now_ns;
        let goal = SURROUNDINGS + RISE * (self.torque / self.largest).powi(2);
        self.temperature += (goal - self.temperature) * (dt / WARM_UP).min(1.0);
    }

    /// Sets the largest torque, clamped to the drive's range, N m.
    pub(super) fn limit(&mut self, torque: f64) {
        self.limit = torque.clamp(0.0, self.largest);
    }

    pub(super) fn is_too_hot(&self) -> bool {
        self.temperature > TOO_HOT
    }

    /// Applies a torque within the limits, N m; zero while the drive is disabled.
    pub(super) fn apply(&mut self, desired: Option<f64>) -> f64 {
        self.torque = desired.map_or(0.0, |torque| torque.clamp(-self.limit, self.limit));
        self.torque
    }

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
    pub(super) fn shaft(&self) -> f64 {
        match self.zero {
            Zero::At(zero) => self.position + zero,
            Zero::Absolute | Zero::PowerOn => self.position,
        }
    }
}
