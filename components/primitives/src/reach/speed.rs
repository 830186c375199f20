//! Time scale: the rate of policy time relative to world time.

/// Maximum rate of change of the speed factor, 1/s. The transition from standstill to nominal speed lasts a
/// quarter of a second.
pub const SPEED_SLEW: f64 = 4.0;

/// Converts real time to policy time, at a rate that follows the commanded one without a jump.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeScale {
    commanded: f64,
    rate: f64,
    slope: f64,
    /// Fraction of a nanosecond of policy time carried over to the next step.
    remainder: f64,
}

impl TimeScale {
    pub(super) fn new() -> Self {
        Self { commanded: 1.0, rate: 1.0, slope: 0.0, remainder: 0.0 }
    }

    pub(super) fn command(&mut self, rate: f64) {
        self.commanded = rate;
    }

    /// Applies the commanded rate immediately, for a policy at rest.
    pub(super) fn jump(&mut self) {
        *self = Self { rate: self.commanded, slope: 0.0, remainder: 0.0, ..*self };
    }

    /// Nanoseconds of policy time in a step of `real` nanoseconds.
    pub(super) fn advance(&mut self, real: u64) -> u64 {
        let seconds = real as f64 * 1e-9;
        let before = self.rate;
        let change = (self.commanded - before).clamp(-SPEED_SLEW * seconds, SPEED_SLEW * seconds);
        self.rate = before + change;
        self.slope = if seconds > 0.0 { change / seconds } else { 0.0 };
        if change == 0.0 && self.rate == 1.0 {
            return real;
        }
        let exact = 0.5 * (before + self.rate) * real as f64 + self.remainder;
        let whole = exact.floor();
        self.remainder = exact - whole;
        whole as u64
    }

    /// Policy seconds per second, now.
    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    /// Change of the rate in the last step, per second.
    pub(super) fn slope(&self) -> f64 {
        self.slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nominal_speed_is_exact_to_the_nanosecond() {
        let mut time_scale = TimeScale::new();
        assert_eq!(time_scale.advance(1_000_001), 1_000_001);
    }

    #[test]
    fn no_time_is_lost_to_rounding_at_an_odd_speed() {
        let mut time_scale = TimeScale::new();
        time_scale.command(1.0 / 3.0);
        time_scale.jump();
        let passed: u64 = (0..3000).map(|_| time_scale.advance(1000)).sum();
        assert!((999_999..=1_000_000).contains(&passed), "{passed}");
    }

    #[test]
    fn rate_change_respects_the_slew_limit() {
        let mut time_scale = TimeScale::new();
        time_scale.command(0.0);
        let passed: u64 = (0..500).map(|_| time_scale.advance(1_000_000)).sum();
        // a triangle of a quarter second and height one
        assert!((passed as f64 - 0.125e9).abs() < 1e3, "{passed}");
        assert_eq!(time_scale.rate(), 0.0);
        assert_eq!(time_scale.slope(), 0.0);
    }
}
