//! A phase drawn along by what is measured.

/// Draws an oscillator towards a measured phase: `pull = gain sin(phi_measured + lead - phi)` (Adler 1946).
///
/// It locks when the two angular velocities differ by less than `gain`, then with the constant difference
/// `asin((omega_measured - omega) / gain)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entrainment {
    /// Strength, rad/s.
    pub gain: f64,
    /// By how much the oscillator is to be ahead of the measurement, rad.
    pub lead: f64,
}

impl Entrainment {
    /// Term added to the rate of the phase, rad/s.
    pub fn pull(&self, measured: f64, phase: f64) -> f64 {
        self.gain * (measured + self.lead - phase).sin()
    }

    /// The phase of a measured joint that swings as `centre + a cos(phi)`: from its position, and its velocity over the
    /// angular velocity `omega` (rad/s) of the swing.
    pub fn measured_phase(position: f64, velocity: f64, centre: f64, omega: f64) -> f64 {
        (-velocity / omega).atan2(position - centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_of_a_swinging_joint_is_read_off_position_and_velocity() {
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
