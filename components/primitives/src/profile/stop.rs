//! The end of a motion before its goal.

use super::MotionLimits;
use crate::dmp::Jet;

/// Fastest stop of one coordinate with an initial velocity and acceleration, within limits of acceleration
/// and jerk.
///
/// A positive initial acceleration first decreases to zero; meanwhile the velocity still grows by `a^2 / 2j`.
///
/// ```
/// use motorium_primitives::profile::{MotionLimits, Stop};
///
/// let limits = MotionLimits { velocity: 1.0, acceleration: 2.0, jerk: 10.0 };
/// let stop = Stop::new(1.0, 0.0, &limits);
/// // velocity over acceleration, plus the time to build up the acceleration
/// assert!((stop.duration() - (0.5 + 0.2)).abs() < 1e-12);
/// assert!((stop.sample(stop.duration()).value - 0.35).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    start: Jet,
    phases: [Phase; 3],
    duration: f64,
    distance: f64,
}

/// An interval of constant jerk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Phase {
    duration: f64,
    jerk: f64,
}

impl Phase {
    /// Returns the state at a time of the phase that starts in the state `from`.
    fn sample(&self, from: Jet, time: f64) -> Jet {
        let Jet { value, rate, acceleration } = from;
        Jet {
            value: value + time * (rate + time * (0.5 * acceleration + time * self.jerk / 6.0)),
            rate: rate + time * (acceleration + 0.5 * time * self.jerk),
            acceleration: acceleration + time * self.jerk,
        }
    }
}

impl Stop {
    /// Plans the stop for an initial velocity `rate` of at least 0 and an initial acceleration within the
    /// limits. The jerk limit may be infinite.
    pub fn new(rate: f64, acceleration: f64, limits: &MotionLimits) -> Self {
        let MotionLimits { acceleration: most, jerk, .. } = *limits;
        let rate = rate.max(0.0);
        if rate == 0.0 && acceleration <= 0.0 {
            return Self::from_phases(Jet::default(), [Phase::default(); 3]);
        }
        if !jerk.is_finite() {
            let start = Jet { value: 0.0, rate, acceleration: -most };
            let brake = Phase { duration: rate / most, jerk: 0.0 };
            return Self::from_phases(start, [brake, Phase::default(), Phase::default()]);
        }
        // The stop from zero acceleration would start at this velocity; part of its first ramp may be over.
        let from = rate + 0.5 * acceleration * acceleration / jerk;
        let rise = (most / jerk).min((from / jerk).sqrt());
        let hold = (from / (rise * jerk) - rise).max(0.0);
        let ramp = (rise + acceleration / jerk).max(0.0);
        let start = Jet { value: 0.0, rate, acceleration };
        let phases = [
            Phase { duration: ramp, jerk: -jerk },
            Phase { duration: hold, jerk: 0.0 },
            Phase { duration: rise, jerk },
        ];
        Self::from_phases(start, phases)
    }

    fn from_phases(start: Jet, phases: [Phase; 3]) -> Self {
        let duration = phases.iter().map(|phase| phase.duration).sum();
        let end = phases.iter().fold(start, |from, phase| phase.sample(from, phase.duration));
        Self { start, phases, duration, distance: end.value }
    }

    /// Returns the duration of the stop \[s\].
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the distance from the start, the velocity and the acceleration at a time \[s\]. The motion is
    /// at rest after the end.
    pub fn sample(&self, time: f64) -> Jet {
        if time >= self.duration {
            return Jet { value: self.distance, ..Jet::default() };
        }
        let (mut from, mut time) = (self.start, time.max(0.0));
        for phase in &self.phases {
            if time < phase.duration {
                return phase.sample(from, time);
            }
            from = phase.sample(from, phase.duration);
            time -= phase.duration;
        }
        Jet { value: self.distance, ..Jet::default() }
    }
}
