//! Parts of simulated drives: motor, encoder, watchdog, and the search for a mark.

use core::fmt::Debug;

use crate::frame::{Frame, Id};

/// Simulated drive of one protocol, at the other end of the wire.
pub(crate) trait Simulated: Debug + Send {
    /// Returns the motor of the drive.
    fn motor(&self) -> &Motor;

    /// Returns mutable access to the motor.
    fn motor_mut(&mut self) -> &mut Motor;

    /// Returns the identifiers of the frames that the drive receives.
    fn ids(&self) -> Vec<Id>;

    /// Receives a frame on the bus at `now_ns`, and passes each answer frame to `answer`.
    fn receive(&mut self, frame: &Frame, now_ns: u64, answer: &mut dyn FnMut(Frame));

    /// Observes a frame of another drive, and passes a frame triggered by it to `answer`.
    fn observe(&mut self, _frame: &Frame, _answer: &mut dyn FnMut(Frame)) {}

    /// Passes the unsolicited frames that are due by `now_ns` to `send`, each with its time.
    fn report(&mut self, _now_ns: u64, _send: &mut dyn FnMut(Frame, u64)) {}

    /// Runs one step of the inner loop at this encoder position \[rad\] and velocity \[rad/s\]. Returns the
    /// torque until the next step, N m.
    fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64;

    /// Cuts the power. The drive is disabled when power returns.
    fn cut_power(&mut self);

    /// Returns `true` if the drive follows commands.
    fn is_enabled(&self) -> bool;

    /// Returns `true` if the drive applies torque.
    fn has_torque(&self) -> bool {
        self.is_enabled()
    }

    /// Returns a function that invalidates the device, state or a number in a frame of the drive.
    fn corruption(&self) -> fn(&mut Frame) {
        |frame| {
            if let [first, ..] = frame.data_mut() {
                *first ^= 0x70;
            }
        }
    }

    /// Returns the number of watchdog trips.
    fn watchdog_trips(&self) -> u64;
}

/// Settings of a simulated drive that differ from the table.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overrides {
    /// Watchdog time, ns; 0 for off, `None` for the value in the table.
    pub watchdog_ns: Option<u64>,
    /// Largest torque of the drive's range, or its rated torque, N m; `None` for the value in the table.
    pub torque: Option<f64>,
}

/// Behaviour of the homing mark, such as a switch, of a simulated drive whose position is unknown after
/// power-up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// The mark is detected at its position.
    #[default]
    Works,
    /// The mark is never found.
    Missing,
    /// The mark is detected at every position.
    Stuck,
}

/// Shaft position at which an encoder reads zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Zero {
    /// Zero of the table.
    Absolute,
    /// Position at power-up, which has not been read yet.
    PowerOn,
    /// This position, rad.
    At(f64),
}

/// Motor of a simulated drive: its shaft, applied torque and temperature.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    /// Full torque, N m.
    pub(crate) largest: f64,
    /// Configured limit, N m.
    pub(crate) limit: f64,
    pub(crate) stepped_ns: u64,
    pub(crate) position: f64,
    pub(crate) velocity: f64,
    pub(crate) torque: f64,
    pub(crate) temperature: f64,
    pub(crate) zero: Zero,
    pub(crate) mark: Mark,
}

/// Ambient temperature, degrees Celsius.
const SURROUNDINGS: f64 = 25.0;
/// Temperature rise at continuous full torque, degrees Celsius.
const RISE: f64 = 90.0;
/// Time constant of the temperature, s.
const WARM_UP: f64 = 120.0;
/// Temperature at which a drive disables itself, degrees Celsius.
const TOO_HOT: f64 = 100.0;

impl Motor {
    pub(crate) fn new(largest: f64) -> Self {
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
    pub(crate) fn turn(&mut self, position: f64, velocity: f64, now_ns: u64) {
        (self.position, self.velocity) = (position, velocity);
        let dt = now_ns.saturating_sub(self.stepped_ns) as f64 * 1e-9;
        self.stepped_ns = now_ns;
        let goal = SURROUNDINGS + RISE * (self.torque / self.largest).powi(2);
        self.temperature += (goal - self.temperature) * (dt / WARM_UP).min(1.0);
    }

    /// Sets the largest torque, clamped to the drive's range, N m.
    pub(crate) fn limit(&mut self, torque: f64) {
        self.limit = torque.clamp(0.0, self.largest);
    }

    pub(crate) fn is_too_hot(&self) -> bool {
        self.temperature > TOO_HOT
    }

    /// Applies a torque, clamped to the limits, N m; `None` for a disabled drive applies zero torque.
    pub(crate) fn apply(&mut self, desired: Option<f64>) -> f64 {
        self.torque = desired.map_or(0.0, |torque| torque.clamp(-self.limit, self.limit));
        self.torque
    }

    /// Returns the encoder reading with the shaft at this position, rad.
    pub(crate) fn encoder(&mut self, shaft: f64) -> f64 {
        match self.zero {
            Zero::Absolute => shaft,
            Zero::At(zero) => shaft - zero,
            Zero::PowerOn => {
                self.zero = Zero::At(shaft);
                0.0
            }
        }
    }

    /// Cuts the power, so an encoder that is not absolute loses its zero.
    pub(crate) fn cut_power(&mut self) {
        if self.zero != Zero::Absolute {
            self.zero = Zero::PowerOn;
        }
    }

    /// Returns the position of the shaft, rad.
    pub(crate) fn shaft(&self) -> f64 {
        match self.zero {
            Zero::At(zero) => self.position + zero,
            Zero::Absolute | Zero::PowerOn => self.position,
        }
    }
}

/// Minimum duration of a search, ns: a drive at its mark moves away from it and returns.
const SHORTEST_NS: u64 = 250_000_000;

/// Search for the mark, which is at the zero of the table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search {
    velocity: f64,
    until_ns: u64,
    is_found: bool,
}

impl Search {
    /// Starts a search at `now_ns` with this speed, rad/s.
    pub(crate) fn new(motor: &Motor, speed: f64, now_ns: u64) -> Self {
        let velocity = if motor.shaft() > 0.0 { -speed } else { speed };
        Self { velocity, until_ns: now_ns + SHORTEST_NS, is_found: false }
    }

    /// Returns the velocity for this step, or `None` once the mark has been found. From then on, the encoder
    /// counts from the mark.
    pub(crate) fn step(&mut self, motor: &mut Motor, now_ns: u64) -> Option<f64> {
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

    /// Ends the search at the current position, from which the encoder then counts.
    pub(crate) fn here(motor: &mut Motor) {
        motor.zero = Zero::At(motor.shaft());
    }
}

/// Watchdog that expires when it is not fed in time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watchdog {
    pub(crate) after_ns: Option<u64>,
    pub(crate) fed_ns: u64,
}

impl Watchdog {
    pub(crate) fn new(after_ns: Option<u64>) -> Self {
        Self { after_ns, fed_ns: 0 }
    }

    pub(crate) fn has_expired(&self, now_ns: u64) -> bool {
        self.after_ns.is_some_and(|after_ns| now_ns.saturating_sub(self.fed_ns) >= after_ns)
    }
}
