//! The critically damped transformation system, advanced exactly.

/// A critically damped spring, `x'' = K (u - x) - D x'` in normalised time (progress), with `D = damping` and
/// `K = D^2 / 4`.
///
/// Both roots are at `-D / 2`. A step is the exact solution for an input `u` that is linear between its
/// values at both ends of the step. The step is unconditionally stable, and exact for any constant or linear
/// input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CriticalSpring {
    root: f64,
}

impl CriticalSpring {
    /// Creates a spring with the damping `D > 0`.
    pub fn new(damping: f64) -> Self {
        Self { root: 0.5 * damping }
    }

    /// Returns the stiffness `K`.
    pub fn stiffness(&self) -> f64 {
        self.root * self.root
    }

    /// Returns the damping `D`.
    pub fn damping(&self) -> f64 {
        2.0 * self.root
    }

    /// Returns the coefficients of one step of width `h` (in progress).
    pub fn stride(&self, h: f64) -> Stride {
        Stride {
            root: self.root,
            h,
            fade: (-self.root * h).exp(),
            per_h: if h > 0.0 { h.recip() } else { 0.0 },
            lag: 2.0 / self.root,
        }
    }

    /// Returns the acceleration `x''` of the state `(x, rate)` under the input `u`.
    pub fn acceleration(&self, x: f64, rate: f64, input: f64) -> f64 {
        self.stiffness() * (input - x) - self.damping() * rate
    }
}

/// Coefficients of one step of a [`CriticalSpring`], shared by all dimensions.
#[derive(Clone, Copy, Debug)]
pub struct Stride {
    root: f64,
    h: f64,
    fade: f64,
    per_h: f64,
    /// Lag behind a ramp per unit slope: `D / K`.
    lag: f64,
}

impl Stride {
    /// Advances `(x, x')` over the step while the input changes linearly from `from` to `to`.
    #[inline]
    pub fn advance(&self, (x, rate): (f64, f64), from: f64, to: f64) -> (f64, f64) {
        if self.h <= 0.0 {
            return (x, rate);
        }
        // the output lags a ramp of slope m by the constant D m / K
        let slope = (to - from) * self.per_h;
        let lag = slope * self.lag;
        let deviation = x - (from - lag);
        let deviation_rate = rate - slope;
        let mixed = deviation_rate + self.root * deviation;
        (
            to - lag + (deviation + mixed * self.h) * self.fade,
            slope + (deviation_rate - self.root * mixed * self.h) * self.fade,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The textbook solution `x(t) = g + (x0 - g + (v0 + w (x0 - g)) t) exp(-w t)`, evaluated once for the
    /// whole duration.
    #[test]
    fn constant_input_gives_the_textbook_solution() {
        let spring = CriticalSpring::new(25.0);
        let (goal, x0, v0, w) = (0.7, -0.2, 3.0, 12.5);
        let mut state = (x0, v0);
        let stride = spring.stride(1e-3);
        for k in 1..=1000 {
            state = stride.advance(state, goal, goal);
            let t = f64::from(k) * 1e-3;
            let b = v0 + w * (x0 - goal);
            let x = goal + (x0 - goal + b * t) * (-w * t).exp();
            let v = (b - w * (x0 - goal + b * t)) * (-w * t).exp();
            assert!((state.0 - x).abs() < 1e-13 && (state.1 - v).abs() < 1e-12);
        }
    }

    #[test]
    fn ramp_response_does_not_depend_on_step_width() {
        let spring = CriticalSpring::new(8.0);
        let once = spring.stride(0.6).advance((0.1, -1.0), 0.0, 1.8);
        let mut many = (0.1, -1.0);
        for k in 0..600 {
            let (from, to) = (3e-3 * f64::from(k), 3e-3 * f64::from(k + 1));
            many = spring.stride(1e-3).advance(many, from, to);
        }
        assert!((once.0 - many.0).abs() < 1e-12 && (once.1 - many.1).abs() < 1e-12);
    }

    #[test]
    fn step_wider_than_the_time_constant_lands_on_the_goal() {
        let (x, rate) = CriticalSpring::new(25.0).stride(50.0).advance((5.0, 100.0), 2.0, 2.0);
        assert!((x - 2.0).abs() < 1e-12 && rate.abs() < 1e-12);
    }

    #[test]
    fn zero_length_step_changes_nothing() {
        assert_eq!(CriticalSpring::new(25.0).stride(0.0).advance((5.0, 1.0), 2.0, 2.5), (5.0, 1.0));
    }
}
