//! The minimum-jerk polynomial that moves the goal from the start to the end of a movement.

/// A quintic polynomial of progress with a given initial position, rate and acceleration. Either it comes to
/// rest at a goal (Flash and Hogan 1985: the trajectory with the least integrated squared jerk between these
/// ends), or it passes the goal with a given rate and zero acceleration.
///
/// After its end the trajectory continues from the goal at the final rate. With rate zero it stays exactly at
/// the goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quintic {
    start: f64,
    length: f64,
    per_length: f64,
    goal: f64,
    final_rate: f64,
    coefficients: [f64; 6],
}

/// Value with first and second derivative with respect to progress.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jet {
    /// Value of the function.
    pub value: f64,
    /// First derivative.
    pub rate: f64,
    /// Second derivative.
    pub acceleration: f64,
}

impl Quintic {
    /// Creates a quintic that starts at progress `start` in the state `from` and rests at `goal` from
    /// progress `start + length` on.
    pub fn new(start: f64, length: f64, from: Jet, goal: f64) -> Self {
        Self::passing(start, length, from, goal, 0.0)
    }

    /// Creates a quintic that starts at progress `start` in the state `from` and reaches `goal` with the rate
    /// `final_rate` at `start + length`.
    pub fn passing(start: f64, length: f64, from: Jet, goal: f64, final_rate: f64) -> Self {
        let (rate, half) = (from.rate * length, 0.5 * from.acceleration * length * length);
        let (distance, leaving) = (goal - from.value, final_rate * length);
        let coefficients = [
            from.value,
            rate,
            half,
            10.0 * distance - 6.0 * rate - 4.0 * leaving - 3.0 * half,
            -15.0 * distance + 8.0 * rate + 7.0 * leaving + 3.0 * half,
            6.0 * distance - 3.0 * rate - 3.0 * leaving - half,
        ];
        Self { start, length, per_length: length.recip(), goal, final_rate, coefficients }
    }

    /// Returns a quintic that rests at a point.
    pub fn at_rest(goal: f64) -> Self {
        let coefficients = [goal, 0.0, 0.0, 0.0, 0.0, 0.0];
        Self { start: 0.0, length: 0.0, per_length: 0.0, goal, final_rate: 0.0, coefficients }
    }

    /// Returns the value and derivatives at this progress.
    pub fn sample(&self, progress: f64) -> Jet {
        let elapsed = progress - self.start;
        if elapsed >= self.length {
            let value = self.goal + self.final_rate * (elapsed - self.length);
            return Jet { value, rate: self.final_rate, acceleration: 0.0 };
        }
        let (t, [a, b, c, d, e, f]) = (elapsed * self.per_length, self.coefficients);
        Jet {
            value: a + t * (b + t * (c + t * (d + t * (e + t * f)))),
            rate: (b + t * (2.0 * c + t * (3.0 * d + t * (4.0 * e + t * 5.0 * f)))) * self.per_length,
            acceleration: (2.0 * c + t * (6.0 * d + t * (12.0 * e + t * 20.0 * f)))
                * (self.per_length * self.per_length),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rest_to_rest_is_the_minimum_jerk_trajectory() {
        let quintic = Quintic::new(0.0, 1.0, Jet { value: 1.0, ..Jet::default() }, 3.0);
        for k in 0..=20 {
            let t = f64::from(k) / 20.0;
            let published = 1.0 + 2.0 * (10.0 * t.powi(3) - 15.0 * t.powi(4) + 6.0 * t.powi(5));
            assert!((quintic.sample(t).value - published).abs() < 1e-14);
        }
        // the peak speed is 15/8 of the mean speed
        assert!((quintic.sample(0.5).rate - 2.0 * 1.875).abs() < 1e-14);
    }

    #[test]
    fn starts_in_the_given_state_and_rests_at_the_goal() {
        let from = Jet { value: -1.0, rate: 4.0, acceleration: -7.0 };
        let quintic = Quintic::new(0.3, 0.5, from, 2.0);
        let first = quintic.sample(0.3);
        assert!((first.value + 1.0).abs() < 1e-14);
        assert!((first.rate - 4.0).abs() < 1e-13 && (first.acceleration + 7.0).abs() < 1e-12);
        let just_before = quintic.sample(0.8 - 1e-9);
        assert!((just_before.value - 2.0).abs() < 1e-12);
        assert!(just_before.rate.abs() < 1e-7 && just_before.acceleration.abs() < 1e-5);
        assert_eq!(quintic.sample(0.8), Jet { value: 2.0, rate: 0.0, acceleration: 0.0 });
    }

    #[test]
    fn derivatives_match_finite_differences() {
        let quintic = Quintic::new(0.0, 2.0, Jet { value: 0.5, rate: 1.0, acceleration: 2.0 }, -1.0);
        let h = 1e-5;
        for k in 1..20 {
            let t = 0.1 * f64::from(k);
            let (before, here, after) = (quintic.sample(t - h), quintic.sample(t), quintic.sample(t + h));
            assert!(((after.value - before.value) / (2.0 * h) - here.rate).abs() < 1e-8);
            assert!(((after.rate - before.rate) / (2.0 * h) - here.acceleration).abs() < 1e-8);
        }
    }

    #[test]
    fn passing_quintic_meets_the_goal_with_its_final_rate() {
        let from = Jet { value: -1.0, rate: 4.0, acceleration: -7.0 };
        let quintic = Quintic::passing(0.3, 0.5, from, 2.0, -1.5);
        let first = quintic.sample(0.3);
        assert!((first.value + 1.0).abs() < 1e-14 && (first.rate - 4.0).abs() < 1e-13);
        let just_before = quintic.sample(0.8 - 1e-9);
        assert!((just_before.value - 2.0).abs() < 1e-8);
        assert!((just_before.rate + 1.5).abs() < 1e-7 && just_before.acceleration.abs() < 1e-5);
        let after = quintic.sample(1.0);
        assert!((after.value - 1.7).abs() < 1e-14 && after.rate == -1.5 && after.acceleration == 0.0);
    }
}
