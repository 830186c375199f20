//! Coupling: feedback from the robot into a running primitive.

/// Coupling terms of one step. [`Default`] means no coupling.
///
/// The primitive then obeys `T^2 y'' = ... + T^2 C` and `T p' = phase_rate`. `C` pushes the motion off the
/// path; a phase rate below 1 slows the clock of the motion. The effect of `C` decays with the spring once
/// `C` returns to zero, and the clock resumes where it stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling<'a> {
    /// Acceleration `C` in every dimension, unit of y per second squared; empty for none. Sources include
    /// [`ObstacleAvoidance`](super::ObstacleAvoidance) and [`Yielding`].
    pub acceleration: &'a [f64],
    /// Rate of the phase, clamped to \[0, 1\], such as from a [`PhaseStop`].
    pub phase_rate: f64,
}

impl Default for Coupling<'_> {
    fn default() -> Self {
        Self { acceleration: &[], phase_rate: 1.0 }
    }
}

/// A law that slows the phase while the robot cannot follow.
///
/// The rate is meant for [`Coupling::phase_rate`]. As published, only the phase waits, together with a
/// quintic goal, which follows the phase. To stretch the whole movement, including the spring, multiply `dt`
/// by the rate instead of setting the phase rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PhaseStop {
    /// `rate = 1 / (1 + gain |y_real - y|^2)`: Ijspeert et al. 2013, equation 2.27 written for the phase.
    Quadratic {
        /// Gain `a_e`, per unit of y squared, at least 0.
        gain: f64,
    },
    /// `rate = 1 / (1 + gain |y_real - y|)`, which also reacts to small errors.
    Linear {
        /// Gain, per unit of y, at least 0.
        gain: f64,
    },
}

impl PhaseStop {
    /// Returns the phase rate, in (0, 1], for a tracking error: the distance between robot and primitive. If
    /// `error` is NaN, the phase stops (rate 0).
    pub fn rate(self, error: f64) -> f64 {
        let brake = match self {
            Self::Quadratic { gain } => gain * error * error,
            Self::Linear { gain } => gain * error.abs(),
        };
        if brake.is_nan() { 0.0 } else { (1.0 + brake.max(0.0)).recip() }
    }

    /// Returns the phase rate for a measured position, using the Euclidean distance over all dimensions.
    pub fn rate_of(self, measured: &[f64], position: &[f64]) -> f64 {
        let squared: f64 = measured.iter().zip(position).map(|(a, b)| (a - b) * (a - b)).sum();
        self.rate(squared.sqrt())
    }
}

/// A compliance that yields to a measured force like a mass: `C = F / m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yielding {
    /// Mass `m`, in the unit of force per unit of acceleration (kg for N and m), above 0.
    pub inertia: f64,
    /// Magnitude, in each dimension, up to which a force is ignored, for example to reject sensor noise. Only
    /// the excess acts, so the response is continuous.
    pub deadband: f64,
}

impl Yielding {
    /// Adds to `acceleration` the acceleration that `force` causes in each dimension.
    pub fn add(&self, force: &[f64], acceleration: &mut [f64]) {
        for (acceleration, force) in acceleration.iter_mut().zip(force) {
            let felt = (force.abs() - self.deadband).max(0.0).copysign(*force);
            *acceleration += felt / self.inertia;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_slows_down_with_increasing_error() {
        let stop = PhaseStop::Quadratic { gain: 100.0 };
        assert!((stop.rate(0.0) - 1.0).abs() < 1e-15);
        assert!((stop.rate(0.1) - 0.5).abs() < 1e-15);
        assert!((stop.rate_of(&[0.3, 0.0], &[0.0, 0.4]) - 1.0 / 26.0).abs() < 1e-15);
        assert!((PhaseStop::Linear { gain: 10.0 }.rate(-0.1) - 0.5).abs() < 1e-15);
        assert_eq!(stop.rate(f64::NAN), 0.0);
    }

    #[test]
    fn deadband_removes_small_forces_without_a_jump() {
        let yielding = Yielding { inertia: 2.0, deadband: 1.0 };
        let mut acceleration = [0.5, 0.0, 0.0];
        yielding.add(&[0.9, 3.0, -5.0], &mut acceleration);
        assert_eq!(acceleration, [0.5, 1.0, -2.0]);
    }
}
