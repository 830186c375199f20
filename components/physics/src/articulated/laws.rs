//! The laws of a joint as functions of its end velocity: drive, damping, friction and stops.

use crate::JointSetpoint;
use crate::joint::JointProperties;

/// The active branch of each law of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mode {
    pub(super) drive: Drive,
    pub(super) friction: Friction,
    pub(super) stop: Stop,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Drive {
    Linear,
    /// Straight line through the zero of the drive law and its effort at the last end velocity.
    Secant,
    /// Full effort forwards.
    High,
    /// Full effort backwards.
    Low,
    /// Forwards beyond the velocity limit: the effort falls with the velocity.
    SlowForwards,
    /// Backwards beyond the velocity limit.
    SlowBackwards,
    /// At the highest velocity that the acceleration limit allows, by whatever effort that needs.
    HeldForwards,
    /// At the lowest velocity that the acceleration limit allows.
    HeldBackwards,
    /// Beyond the highest velocity, despite full effort backwards.
    BeyondForwards,
    /// Beyond the lowest velocity, despite full effort forwards.
    BeyondBackwards,
}

impl Drive {
    /// Returns `true` if the acceleration limit determines the effort.
    pub(super) fn is_restrained(self) -> bool {
        matches!(
            self,
            Self::HeldForwards | Self::HeldBackwards | Self::BeyondForwards | Self::BeyondBackwards
        )
    }
}

/// The initial modes of a joint.
pub(super) const START: Mode = Mode { drive: Drive::Linear, friction: Friction::None, stop: Stop::Free };

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Friction {
    None,
    Stick,
    /// Moving forwards; friction pushes backwards.
    Forwards,
    Backwards,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    Free,
    Lower,
    Upper,
}

/// The laws of one joint as functions of its end velocity.
#[derive(Clone, Debug)]
pub(crate) struct Laws {
    /// Drive effort before clamping: `drive_0 - drive_slope * v+`.
    drive_0: f64,
    drive_slope: f64,
    /// Highest and lowest effort of the drive.
    high: f64,
    low: f64,
    /// Velocities beyond which the drive brakes.
    min_velocity: f64,
    max_velocity: f64,
    /// Slope of the effort limit beyond those velocities.
    braking_slope: f64,
    /// Force of the joint's spring at zero velocity, and the decrease of the spring and damping forces per
    /// unit of velocity.
    spring: f64,
    pub(super) damping: f64,
    pub(super) friction: f64,
    /// Range of `v+` that the stops allow.
    pub(super) slowest: f64,
    pub(super) fastest: f64,
    /// Range of `v+` that the acceleration limit allows.
    window: [f64; 2],
    /// Effort of [`Drive::Secant`] as `constant - slope * v+`.
    secant: (f64, f64),
}

/// Largest relative error of the effort of a drive on a secant.
const SECANT_ERROR: f64 = 1e-3;

/// Window of a joint without an acceleration limit.
const NO_WINDOW: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Decay rate of the distance of a joint beyond its stop \[1/s\]. Kept low, because correcting the distance
/// within one step would cause an impact.
const RECOVERY_RATE: f64 = 20.0;

/// Returns the velocity at which a joint arrives exactly at a stop at this distance within `h`. For a joint
/// beyond the stop, returns the recovery velocity.
fn reach(distance: f64, beyond: bool, h: f64) -> f64 {
    if beyond { distance * RECOVERY_RATE } else { distance / h }
}

impl Laws {
    /// The velocity of a floating base, on which no law acts.
    pub(crate) const FREE: Self = Self {
        drive_0: 0.0,
        drive_slope: 0.0,
        high: f64::INFINITY,
        low: f64::NEG_INFINITY,
        min_velocity: f64::NEG_INFINITY,
        max_velocity: f64::INFINITY,
        braking_slope: 0.0,
        spring: 0.0,
        damping: 0.0,
        friction: 0.0,
        slowest: f64::NEG_INFINITY,
        fastest: f64::INFINITY,
        window: NO_WINDOW,
        secant: (0.0, 0.0),
    };

    /// Creates the laws of a step of `h` from position `q`. The drive's effort is limited to `low` and
    /// `high`: the limits of the joint, or narrower ones in this step.
    pub(crate) fn new(
        joint: &JointProperties,
        command: &JointSetpoint,
        [low, high]: [f64; 2],
        (q, h): (f64, f64),
    ) -> Self {
        let limit = joint.effort_limit.abs();
        let brakes = command.braking_band().is_finite();
        let drive_0 = command.kp * (command.position - q) + command.kd * command.velocity + command.effort;
        let drive_slope = command.kd + h * command.kp;
        let (limit, low, high) = if brakes && !limit.is_finite() {
            let limit = command.braking_effort(drive_0, drive_slope);
            (limit, low.max(-limit), high.min(limit))
        } else {
            (limit, low, high)
        };
        Self {
            drive_0,
            drive_slope,
            high,
            low,
            min_velocity: if brakes { command.min_velocity } else { f64::NEG_INFINITY },
            max_velocity: if brakes { command.max_velocity } else { f64::INFINITY },
            braking_slope: command.braking_slope(limit),
            spring: joint.stiffness * (joint.rest - q),
            damping: joint.damping + h * joint.stiffness,
            friction: joint.friction,
            slowest: reach(joint.lower - q, q < joint.lower, h),
            fastest: reach(joint.upper - q, q > joint.upper, h),
            window: NO_WINDOW,
            secant: (0.0, 0.0),
        }
    }

    /// Sets the range of end velocities that the acceleration limit allows.
    pub(super) fn restrain(&mut self, window: [f64; 2]) {
        self.window = window;
    }

    /// Returns the force of the joint's spring and damping at velocity `v`.
    pub(super) fn passive_force(&self, v: f64) -> f64 {
        self.spring - self.damping * v
    }

    /// Returns `true` if the acceleration limit bounds the end velocity.
    pub(super) fn has_window(&self) -> bool {
        self.window != NO_WINDOW
    }

    /// Returns the drive effort at end velocity `x`, with the effort `needed` at an end of the window, and
    /// whether it differs from the setpoint's.
    pub(super) fn restrained_drive(&self, x: f64, needed: impl FnOnce() -> f64) -> (f64, bool) {
        let free = self.drive(x);
        let [low, high] = self.window;
        let effort = if x > low && x < high {
            return (free, false);
        } else if x == high {
            needed().min(free).max(self.low)
        } else if x == low {
            needed().max(free).min(self.high)
        } else if x > high {
            self.low
        } else {
            self.high
        };
        (effort, effort != free)
    }

    /// Returns the branch of the drive at the end velocity `x` that was found in `mode`, with the
    /// acceleration limit. `missing` is the drive effort that keeps a held velocity.
    fn restrained_mode(&self, mode: Drive, x: f64, missing: f64) -> Drive {
        let [low, high] = self.window;
        let slack = 1e-13 * (1.0 + x.abs());
        match mode {
            Drive::HeldForwards if missing > self.drive(x) => self.drive_mode(Drive::Linear, x),
            Drive::HeldForwards if missing < self.low => Drive::BeyondForwards,
            Drive::HeldBackwards if missing < self.drive(x) => self.drive_mode(Drive::Linear, x),
            Drive::HeldBackwards if missing > self.high => Drive::BeyondBackwards,
            Drive::HeldForwards | Drive::HeldBackwards => mode,
            Drive::BeyondForwards if x < high => Drive::HeldForwards,
            Drive::BeyondBackwards if x > low => Drive::HeldBackwards,
            Drive::BeyondForwards | Drive::BeyondBackwards => mode,
            _ if x > high + slack && self.drive(x) > self.low => Drive::HeldForwards,
            _ if x < low - slack && self.drive(x) < self.high => Drive::HeldBackwards,
            _ => self.drive_mode(mode, x),
        }
    }

    /// Converts the laws to a midpoint step from position `q` through `middle`, after which the end velocity
    /// applies. Stops act in the second half of the step. A spring acts with the mean of its forces at both
    /// ends, which conserves its energy.
    pub(super) fn midway(self, joint: &JointProperties, [q, middle]: [f64; 2], h: f64) -> Self {
        Self {
            spring: joint.stiffness * (joint.rest - 0.5 * (q + middle)),
            damping: joint.damping + 0.25 * h * joint.stiffness,
            slowest: reach(joint.lower - middle, middle < joint.lower, 0.5 * h),
            fastest: reach(joint.upper - middle, middle > joint.upper, 0.5 * h),
            ..self
        }
    }

    /// Returns the highest effort at end velocity `x`.
    fn highest(&self, x: f64) -> f64 {
        if x > self.max_velocity { self.slowing_forwards(x).max(self.low) } else { self.high }
    }

    /// Returns the lowest effort at end velocity `x`.
    fn lowest(&self, x: f64) -> f64 {
        if x < self.min_velocity { self.slowing_backwards(x).min(self.high) } else { self.low }
    }

    /// Returns the highest effort beyond `max_velocity`, where it falls with the velocity.
    fn slowing_forwards(&self, x: f64) -> f64 {
        self.high - self.braking_slope * (x - self.max_velocity)
    }

    /// Returns the lowest effort beyond `min_velocity`, where it rises with the speed.
    fn slowing_backwards(&self, x: f64) -> f64 {
        self.low - self.braking_slope * (x - self.min_velocity)
    }

    /// Returns the drive effort at end velocity `x`, after clamping.
    pub(crate) fn drive(&self, x: f64) -> f64 {
        (self.drive_0 - self.drive_slope * x).clamp(self.lowest(x), self.highest(x))
    }

    /// Returns the branch of the drive at end velocity `x` without velocity limits.
    fn plain_mode(&self, x: f64) -> Drive {
        let raw = self.drive_0 - self.drive_slope * x;
        if raw > self.high {
            Drive::High
        } else if raw < self.low {
            Drive::Low
        } else {
            Drive::Linear
        }
    }

    /// Returns `true` if the drive's effort is smaller than the commanded one.
    pub(crate) fn is_saturated(&self, x: f64) -> bool {
        let raw = self.drive_0 - self.drive_slope * x;
        raw > self.highest(x) || raw < self.lowest(x)
    }

    /// Returns the branch of the drive at the end velocity `x` that was found in `mode`, without the
    /// acceleration limit. The braking branch is between full effort forwards and full effort backwards;
    /// skipping it would make the iteration cycle.
    pub(crate) fn drive_mode(&self, mode: Drive, x: f64) -> Drive {
        let raw = self.drive_0 - self.drive_slope * x;
        if x > self.max_velocity && raw > self.highest(x) {
            let full = self.slowing_forwards(x) <= self.low;
            return if full && matches!(mode, Drive::SlowForwards | Drive::Low) {
                Drive::Low
            } else {
                Drive::SlowForwards
            };
        }
        if x < self.min_velocity && raw < self.lowest(x) {
            let full = self.slowing_backwards(x) >= self.high;
            return if full && matches!(mode, Drive::SlowBackwards | Drive::High) {
                Drive::High
            } else {
                Drive::SlowBackwards
            };
        }
        let plain = self.plain_mode(x);
        match (mode, plain) {
            (Drive::Low, Drive::High) if self.braking_slope > 0.0 => Drive::SlowForwards,
            (Drive::High, Drive::Low) if self.braking_slope > 0.0 => Drive::SlowBackwards,
            _ => plain,
        }
    }

    /// Returns the effort of the drive on a branch as `constant - slope * x`.
    pub(crate) fn drive_force(&self, drive: Drive) -> (f64, f64) {
        match drive {
            Drive::Linear => (self.drive_0, self.drive_slope),
            Drive::Secant => self.secant,
            Drive::High => (self.high, 0.0),
            Drive::Low => (self.low, 0.0),
            Drive::SlowForwards => (self.slowing_forwards(0.0), self.braking_slope),
            Drive::SlowBackwards => (self.slowing_backwards(0.0), self.braking_slope),
            // Unknown until the velocity is held.
            Drive::HeldForwards | Drive::HeldBackwards => (0.0, 0.0),
            Drive::BeyondForwards => (self.low, 0.0),
            Drive::BeyondBackwards => (self.high, 0.0),
        }
    }

    /// Returns the force on the joint in `mode` as `constant - slope * x`, without stops and stiction.
    pub(super) fn force(&self, mode: &Mode) -> (f64, f64) {
        let (drive, slope) = self.drive_force(mode.drive);
        let friction = match mode.friction {
            Friction::None | Friction::Stick => 0.0,
            Friction::Forwards => -self.friction,
            Friction::Backwards => self.friction,
        };
        (drive + friction + self.spring, slope + self.damping)
    }

    /// Replaces the drive by the secant through its effort at end velocity `x`, if the law is zero at some
    /// velocity within the limits. Returns `true` if the effort that `drive` gives at `x` is the law's,
    /// apart from a relative error of [`SECANT_ERROR`].
    pub(super) fn take_secant(&mut self, drive: &mut Drive, x: f64) -> bool {
        let zero = self.drive_0 / self.drive_slope;
        if self.has_window() || !(self.min_velocity < zero && zero < self.max_velocity) {
            let next = self.drive_mode(*drive, x);
            return core::mem::replace(drive, next) == next;
        }
        let (constant, slope) = self.drive_force(*drive);
        let (effort, applied) = (self.drive(x), constant - slope * x);
        let slope = effort / (zero - x);
        self.secant = match self.is_saturated(x) {
            true if slope > 0.0 => (slope * zero, slope),
            true => (effort, 0.0),
            false => (self.drive_0, self.drive_slope),
        };
        *drive = Drive::Secant;
        (applied - effort).abs() <= SECANT_ERROR * effort.abs()
    }

    /// Returns the velocity that `mode` fixes, if any.
    pub(super) fn fixed(&self, mode: &Mode) -> Option<f64> {
        match (mode.stop, mode.friction) {
            (Stop::Lower, _) => Some(self.slowest),
            (Stop::Upper, _) => Some(self.fastest),
            (Stop::Free, _) if mode.drive == Drive::HeldForwards => Some(self.window[1]),
            (Stop::Free, _) if mode.drive == Drive::HeldBackwards => Some(self.window[0]),
            (Stop::Free, Friction::Stick) => Some(0.0),
            (Stop::Free, _) => None,
        }
    }

    /// Returns the mode of the solution `x`; `missing` is the force that holds a fixed velocity.
    pub(super) fn explain(&self, mode: &Mode, x: f64, missing: f64) -> Mode {
        let is_held = matches!(mode.drive, Drive::HeldForwards | Drive::HeldBackwards);
        let drive = if !self.has_window() {
            self.drive_mode(mode.drive, x)
        } else if mode.stop == Stop::Free && (is_held || mode.friction != Friction::Stick) {
            self.restrained_mode(mode.drive, x, missing)
        } else if mode.drive.is_restrained() {
            // The stop or friction determines the velocity.
            self.drive_mode(Drive::Linear, x)
        } else {
            self.drive_mode(mode.drive, x)
        };
        let mut friction = mode.friction;
        let stop = match mode.stop {
            Stop::Lower if missing >= 0.0 => Stop::Lower,
            Stop::Upper if missing <= 0.0 => Stop::Upper,
            Stop::Lower | Stop::Upper => Stop::Free,
            Stop::Free => {
                friction = match mode.friction {
                    Friction::None => Friction::None,
                    _ if is_held && x > 0.0 => Friction::Forwards,
                    _ if is_held && x < 0.0 => Friction::Backwards,
                    _ if is_held => Friction::Stick,
                    Friction::Stick if missing > self.friction => Friction::Backwards,
                    Friction::Stick if missing < -self.friction => Friction::Forwards,
                    Friction::Stick => Friction::Stick,
                    Friction::Forwards if x < 0.0 => Friction::Stick,
                    Friction::Backwards if x > 0.0 => Friction::Stick,
                    slipping => slipping,
                };
                let slack = 1e-13 * (1.0 + x.abs());
                if x < self.slowest - slack {
                    Stop::Lower
                } else if x > self.fastest + slack {
                    Stop::Upper
                } else {
                    Stop::Free
                }
            }
        };
        Mode { drive, friction, stop }
    }

    /// Solves this joint's equation `inertia * x + rest = h * force(x)` with the velocities of the other
    /// joints fixed: a monotone scalar equation with kinks.
    pub(super) fn solve_alone(&self, inertia: f64, rest: f64, h: f64) -> f64 {
        // Root of inertia x + rest - h (drive(x) - damping x) = h push, whose left side strictly increases in
        // x.
        let root = |push: f64| {
            let push = push + self.spring;
            let linear =
                (h * (self.drive_0 + push) - rest) / (inertia + h * (self.drive_slope + self.damping));
            let full = |effort: f64| (h * (effort + push) - rest) / (inertia + h * self.damping);
            let plain = match self.plain_mode(linear) {
                Drive::High => full(self.high),
                Drive::Low => full(self.low),
                _ => linear,
            };
            // Beyond a velocity limit the drive uses the branch with the lowest effort.
            let slowing = |effort: f64| {
                (h * (effort + push) - rest) / (inertia + h * (self.braking_slope + self.damping))
            };
            let free = if plain > self.max_velocity {
                plain.min(slowing(self.slowing_forwards(0.0)).max(full(self.low)))
            } else if plain < self.min_velocity {
                plain.max(slowing(self.slowing_backwards(0.0)).min(full(self.high)))
            } else {
                plain
            };
            let [low, high] = self.window;
            if free > high {
                high.max(free.min(full(self.low)))
            } else if free < low {
                low.min(free.max(full(self.high)))
            } else {
                free
            }
        };
        let without = root(0.0);
        let x = if self.friction == 0.0 {
            without
        } else if without > 0.0 {
            root(-self.friction).max(0.0)
        } else {
            root(self.friction).min(0.0)
        };
        x.max(self.slowest).min(self.fastest)
    }
}
