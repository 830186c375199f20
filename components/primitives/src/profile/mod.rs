//! Rest-to-rest motion along a line: time-optimal within limits of velocity, acceleration and jerk, or with
//! minimum jerk.
//!
//! [`Profile`] is the motion of one coordinate; [`StraightMove`] synchronises several coordinates along the
//! straight line between two points, and [`Stop`] ends a motion early. [`Follower`] follows targets with step
//! changes.
//!
//! ```
//! use motorium_primitives::profile::{MotionLimits, Profile};
//!
//! let limits = MotionLimits { velocity: 1.0, acceleration: 2.0, jerk: 10.0 };
//! let profile = Profile::time_optimal(3.0, &limits);
//! // distance over velocity, plus the times to build up velocity and acceleration
//! assert!((profile.duration() - (3.0 + 0.5 + 0.2)).abs() < 1e-12);
//! assert_eq!(profile.sample(10.0).value, 3.0);
//! ```

mod follow;
mod stop;
mod straight;

pub use follow::Follower;
pub use stop::Stop;
pub use straight::{Shape, StraightMove};

use crate::dmp::Jet;

/// Maximum velocity, acceleration and jerk, all positive. The jerk may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// Maximum velocity, per second.
    pub velocity: f64,
    /// Maximum acceleration, per second squared.
    pub acceleration: f64,
    /// Maximum jerk, per second cubed.
    pub jerk: f64,
}

/// Motion of one coordinate from rest at 0 to rest at a given distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    distance: f64,
    duration: f64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Seven phases of constant jerk, stretched in time by `stretch`.
    Jerk { jerk: f64, rise: f64, hold: f64, cruise: f64, stretch: f64 },
    /// Minimum-jerk quintic.
    Quintic,
}

/// Peak velocity, acceleration and jerk of the quintic for distance 1 and duration 1.
const QUINTIC: [f64; 3] = [1.875, 5.773_502_691_896_258, 60.0];

impl Profile {
    /// Returns the fastest motion within the limits: at any time jerk, acceleration or velocity is at its
    /// limit.
    pub fn time_optimal(distance: f64, limits: &MotionLimits) -> Self {
        let MotionLimits { velocity: v, acceleration: a, jerk: j } = *limits;
        let d = distance.abs();
        if d == 0.0 {
            return Self::rest();
        }
        // Duration of one acceleration ramp and of its plateau, up to the peak velocity.
        let (rise, hold) = if v * j >= a * a { (a / j, v / a - a / j) } else { ((v / j).sqrt(), 0.0) };
        let needed = v * (2.0 * rise + hold);
        let (rise, hold, cruise) = if d >= needed {
            (rise, hold, (d - needed) / v)
        } else if d >= 2.0 * a * (a / j) * (a / j) {
            let ramp = a * (a / j);
            let peak = 0.5 * ((ramp * ramp + 4.0 * a * d).sqrt() - ramp);
            (a / j, (peak / a - a / j).max(0.0), 0.0)
        } else {
            ((0.5 * d / j).cbrt(), 0.0, 0.0)
        };
        let duration = 4.0 * rise + 2.0 * hold + cruise;
        // jerk that covers the distance exactly in these times, equal to the limit up to rounding; infinite
        // without a ramp
        let jerk = if rise > 0.0 {
            d / (rise * (rise + hold) * (2.0 * rise + hold + cruise))
        } else {
            f64::INFINITY
        };
        Self { distance, duration, kind: Kind::Jerk { jerk, rise, hold, cruise, stretch: 1.0 } }
    }

    /// Returns the minimum-jerk motion of the given duration.
    pub fn minimum_jerk(distance: f64, duration: f64) -> Self {
        Self { distance, duration: duration.max(0.0), kind: Kind::Quintic }
    }

    /// Returns the shortest duration of a minimum-jerk motion within the limits \[s\].
    pub fn minimum_jerk_duration(distance: f64, limits: &MotionLimits) -> f64 {
        let d = distance.abs();
        let [v, a, j] = QUINTIC;
        let velocity = v * d / limits.velocity;
        let acceleration = (a * d / limits.acceleration).sqrt();
        velocity.max(acceleration).max((j * d / limits.jerk).cbrt())
    }

    /// Returns a profile without motion.
    pub fn rest() -> Self {
        Self { distance: 0.0, duration: 0.0, kind: Kind::Quintic }
    }

    /// Returns the motion with a duration of at least `duration` \[s\]; a shorter motion is stretched in
    /// time.
    #[must_use]
    pub fn taking(self, duration: f64) -> Self {
        if duration <= self.duration {
            return self;
        }
        let kind = match self.kind {
            Kind::Jerk { jerk, rise, hold, cruise, stretch } if self.duration > 0.0 => {
                Kind::Jerk { jerk, rise, hold, cruise, stretch: stretch * duration / self.duration }
            }
            kind => kind,
        };
        Self { duration, kind, ..self }
    }

    /// Returns the duration of the profile \[s\].
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the distance between start and end.
    pub fn distance(&self) -> f64 {
        self.distance
    }

    /// Returns position, velocity and acceleration at a time \[s\]. The motion is at rest before the start
    /// and after the end.
    pub fn sample(&self, time: f64) -> Jet {
        if time <= 0.0 {
            return Jet::default();
        }
        if time >= self.duration {
            return Jet { value: self.distance, ..Jet::default() };
        }
        match self.kind {
            Kind::Quintic => {
                let (d, t) = (self.distance, self.duration);
                let s = time / t;
                let left = 1.0 - s;
                Jet {
                    value: d * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s),
                    rate: d / t * 30.0 * (s * left).powi(2),
                    acceleration: d / (t * t) * 60.0 * s * left * (1.0 - 2.0 * s),
                }
            }
            Kind::Jerk { stretch, .. } => {
                let (sign, time) = (self.distance.signum(), time / stretch);
                let whole = self.duration / stretch;
                // the second half mirrors the first
                let jet = if time <= 0.5 * whole {
                    self.first_half(time)
                } else {
                    let Jet { value, rate, acceleration } = self.first_half(whole - time);
                    Jet { value: self.distance.abs() - value, rate, acceleration: -acceleration }
                };
                Jet {
                    value: sign * jet.value,
                    rate: sign * jet.rate / stretch,
                    acceleration: sign * jet.acceleration / (stretch * stretch),
                }
            }
        }
    }

    /// Returns the motion up to its middle, unstretched.
    fn first_half(&self, time: f64) -> Jet {
        let Kind::Jerk { jerk, rise, hold, cruise, .. } = self.kind else { return Jet::default() };
        let d = self.distance.abs();
        // without a jerk limit the acceleration jumps
        let (peak, acceleration) = if rise > 0.0 {
            let acceleration = jerk * rise;
            (acceleration * (rise + hold), acceleration)
        } else {
            let peak = d / (hold + cruise);
            (peak, peak / hold)
        };
        let ramp = 2.0 * rise + hold;
        if time < rise {
            let rate = 0.5 * jerk * time * time;
            return Jet { value: jerk * time.powi(3) / 6.0, rate, acceleration: jerk * time };
        }
        if time < rise + hold {
            let t = time - rise;
            let (value, rate) =
                if rise > 0.0 { (jerk * rise.powi(3) / 6.0, 0.5 * acceleration * rise) } else { (0.0, 0.0) };
            return Jet {
                value: value + rate * t + 0.5 * acceleration * t * t,
                rate: rate + acceleration * t,
                acceleration,
            };
        }
        if time < ramp {
            // the distance up to the end of the ramp is covered at its mean velocity, half the peak
            let t = ramp - time;
            return Jet {
                value: 0.5 * peak * ramp - peak * t + jerk * t.powi(3) / 6.0,
                rate: peak - 0.5 * jerk * t * t,
                acceleration: jerk * t,
            };
        }
        Jet { value: 0.5 * peak * ramp + peak * (time - ramp), rate: peak, acceleration: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Limits that produce every shape of profile: short and long, with and without an acceleration plateau,
    /// with and without a jerk limit.
    fn cases() -> impl Iterator<Item = (f64, MotionLimits)> {
        let spread = |n: u32| (0..n).map(move |i| 10f64.powf(-2.0 + 4.0 * f64::from(i) / f64::from(n - 1)));
        spread(9).flat_map(move |d| {
            spread(5).flat_map(move |acceleration| {
                spread(5).chain([f64::INFINITY]).map(move |jerk| {
                    let velocity = if ((d * 1e3) as u64).is_multiple_of(2) { 1.0 } else { 0.3 };
                    (if jerk < 1.0 { -d } else { d }, MotionLimits { velocity, acceleration, jerk })
                })
            })
        })
    }

    #[test]
    fn time_optimal_motion_is_always_at_one_limit() {
        for (distance, limits) in cases() {
            let profile = Profile::time_optimal(distance, &limits);
            let steps = 2000;
            let dt = profile.duration() / f64::from(steps);
            let tight = 1.0 + 1e-9;
            let mut idle = 0;
            for step in 0..steps {
                let (now, next) =
                    (profile.sample(f64::from(step) * dt), profile.sample(f64::from(step + 1) * dt));
                assert!(now.rate.abs() <= tight * limits.velocity, "{distance} {limits:?}");
                assert!(
                    now.acceleration.abs() <= tight * limits.acceleration,
                    "{distance} {limits:?} {now:?}"
                );
                let jerk = (next.acceleration - now.acceleration).abs() / dt;
                assert!(jerk <= limits.jerk * (1.0 + 1e-6) + 1e-6, "{distance} {limits:?}: {jerk}");
                let at_limit = now.rate.abs() > 0.999 * limits.velocity
                    || now.acceleration.abs() > 0.999 * limits.acceleration
                    || jerk > 0.9 * limits.jerk;
                idle += u64::from(!at_limit && step > 0 && step + 1 < steps);
            }
            // steps across the boundary between two phases of opposite jerk
            assert!(idle <= 8, "{distance} {limits:?}: {idle} steps below every limit");
        }
    }

    #[test]
    fn motion_ends_at_rest_with_consistent_derivatives() {
        for (distance, limits) in cases() {
            for profile in [
                Profile::time_optimal(distance, &limits),
                Profile::time_optimal(distance, &limits).taking(20.0),
                Profile::minimum_jerk(distance, Profile::minimum_jerk_duration(distance, &limits)),
            ] {
                let end = profile.sample(profile.duration());
                assert_eq!(end, Jet { value: distance, ..Jet::default() });
                let before = profile.sample(profile.duration() * (1.0 - 1e-9));
                assert!((before.value - distance).abs() < 1e-7 * distance.abs(), "{distance} {limits:?}");
                // the remaining velocity change is bounded by the acceleration
                let left = 1.001e-9 * profile.duration();
                assert!(before.rate.abs() <= limits.acceleration * left, "{distance} {limits:?}: {before:?}");
                let h = 1e-6 * profile.duration();
                for share in [0.07, 0.21, 0.43, 0.5, 0.61, 0.87, 0.96] {
                    let t = share * profile.duration();
                    let (low, now, high) = (profile.sample(t - h), profile.sample(t), profile.sample(t + h));
                    let scale = distance.abs() / profile.duration();
                    assert!(((high.value - low.value) / (2.0 * h) - now.rate).abs() < 1e-4 * scale);
                    if limits.jerk.is_finite() {
                        let slope = (high.rate - low.rate) / (2.0 * h);
                        assert!((slope - now.acceleration).abs() < 1e-2 * scale / profile.duration() + 1e-9);
                    }
                }
            }
        }
    }

    #[test]
    fn durations_match_the_textbook() {
        let limits = |velocity, acceleration, jerk| MotionLimits { velocity, acceleration, jerk };
        let time = |distance, limits| Profile::time_optimal(distance, &limits).duration();
        // all limits reached: d / v + v / a + a / j
        assert!((time(10.0, limits(5.0, 10.0, 30.0)) - (2.0 + 0.5 + 1.0 / 3.0)).abs() < 1e-12);
        // jerk alone: 4 cbrt(d / 2j)
        assert!((time(1e-3, limits(5.0, 10.0, 30.0)) - 4.0 * (1e-3_f64 / 60.0).cbrt()).abs() < 1e-12);
        // no jerk limit: triangular profile, 2 sqrt(d / a), and trapezoidal profile
        assert!((time(0.1, limits(5.0, 10.0, f64::INFINITY)) - 0.2).abs() < 1e-12);
        assert!((time(10.0, limits(5.0, 10.0, f64::INFINITY)) - 2.5).abs() < 1e-12);
        // velocity before acceleration: d / v + 2 sqrt(v / j)
        assert!((time(2.0, limits(0.5, 100.0, 50.0)) - (4.0 + 0.2)).abs() < 1e-12);
        // minimum jerk: velocity 15/8 d/T
        assert!((Profile::minimum_jerk_duration(1.0, &limits(1.0, 1e9, 1e9)) - 1.875).abs() < 1e-12);
        assert!((Profile::minimum_jerk_duration(1.0, &limits(1e9, 1e9, 60.0)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn minimum_jerk_motion_reaches_only_its_tightest_limit() {
        for (distance, limits) in cases() {
            let profile = Profile::minimum_jerk(distance, Profile::minimum_jerk_duration(distance, &limits));
            let mut most = [0.0_f64; 3];
            let steps = 4000;
            let dt = profile.duration() / f64::from(steps);
            for step in 0..steps {
                let (now, next) =
                    (profile.sample(f64::from(step) * dt), profile.sample(f64::from(step + 1) * dt));
                most[0] = most[0].max(now.rate.abs() / limits.velocity);
                most[1] = most[1].max(now.acceleration.abs() / limits.acceleration);
                most[2] = most[2].max((next.acceleration - now.acceleration).abs() / dt / limits.jerk);
            }
            let tightest = most.into_iter().fold(0.0, f64::max);
            assert!((0.99..1.0 + 1e-6).contains(&tightest), "{distance} {limits:?}: {most:?}");
        }
    }
}
