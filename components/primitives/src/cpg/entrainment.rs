//! Entrainment of an oscillator's phase by a measured phase.

/// A law that pulls an oscillator towards a measured phase: `pull = gain sin(phi_measured + lead - phi)`
/// (Adler 1946).
///
/// The oscillator locks when the two angular velocities differ by less than `gain`. The remaining phase
/// difference is `asin((omega_measured - omega) / gain)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entrainment {
    /// Strength of the pull, rad/s.
    pub gain: f64,
    /// Desired phase lead of the oscillator over the measurement, rad.
    pub lead: f64,
}

impl Entrainment {
    /// Returns the term to add to the phase rate, rad/s, for a measured phase and the oscillator's phase,
    /// rad.
    pub fn pull(&self, measured: f64, phase: f64) -> f64 {
        self.gain * (measured + self.lead - phase).sin()
    }

    /// Computes the phase, rad, of a joint that swings as `centre + a cos(phi)`, from the joint's measured
    /// position and velocity. `omega` is the angular velocity of the swing, rad/s.
    pub fn measured_phase(position: f64, velocity: f64, centre: f64, omega: f64) -> f64 {
        (-velocity / omega).atan2(position - centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_of_a_swinging_joint_from_position_and_velocity() {
        let (centre, amplitude, omega) = (0.3, 0.7, 4.0);
        for k in 0..12 {
            let phi = -3.0 + 0.5 * f64::from(k);
            let (sine, cosine) = phi.sin_cos();
            let found = Entrainment::measured_phase(
                centre + amplitude * cosine,
                -amplitude * omega * sine,
                centre,
                omega,
            );
            assert!((found - phi).abs() < 1e-12);
        }
    }
}
