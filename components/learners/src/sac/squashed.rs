//! A normal distribution squashed by `tanh`.

/// Bounds of the logarithm of a standard deviation, as in Haarnoja's implementation.
const BOUNDS: [f32; 2] = [-20.0, 2.0];
/// Half the logarithm of 2 pi.
const HALF_LN_TAU: f32 = 0.918_938_5;

/// An action `a = tanh(u)`, `u = mean + deviation noise`, and derivatives for fixed noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Squashed {
    pub(super) action: f32,
    /// `ln p(a) = ln N(u) - ln(1 - a^2)`.
    pub(super) log_probability: f32,
    /// Derivatives of the log probability with respect to the mean and the logarithm of the deviation.
    pub(super) by_mean: f32,
    pub(super) by_log_deviation: f32,
    /// Derivatives of the action with respect to both.
    pub(super) action_by_mean: f32,
    pub(super) action_by_log_deviation: f32,
}

/// Computes an action from the mean, the logarithm of the deviation, and standard normal noise. Outside its
/// bounds, the logarithm of the deviation has a derivative of 0.
pub(super) fn squash(mean: f32, log_deviation: f32, noise: f32) -> Squashed {
    let inside = (BOUNDS[0]..=BOUNDS[1]).contains(&log_deviation);
    let log_deviation = log_deviation.clamp(BOUNDS[0], BOUNDS[1]);
    let spread = log_deviation.exp() * noise;
    let u = mean + spread;
    let action = u.tanh();
    // ln(1 - tanh(u)^2) without cancellation for large u
    let softplus = (-2.0 * u).max(0.0) + (-(2.0 * u).abs()).exp().ln_1p();
    let log_slope = 2.0 * (core::f32::consts::LN_2 - u - softplus);
    let slope = 1.0 - action * action;
    let factor = if inside { 1.0 } else { 0.0 };
    Squashed {
        action,
        log_probability: -0.5 * noise * noise - log_deviation - HALF_LN_TAU - log_slope,
        by_mean: 2.0 * action,
        by_log_deviation: factor * (2.0 * action * spread - 1.0),
        action_by_mean: slope,
        action_by_log_deviation: factor * slope * spread,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the probability that an action is at most `action`, by numerical integration over `u`.
    fn distribution(action: f64, mean: f64, deviation: f64) -> f64 {
        let end = (action.atanh() - mean) / deviation;
        let steps = 200_000;
        let width = (end + 12.0) / f64::from(steps);
        let density = |z: f64| (-0.5 * z * z).exp() / core::f64::consts::TAU.sqrt();
        (0..steps).map(|k| density(-12.0 + (f64::from(k) + 0.5) * width) * width).sum()
    }

    #[test]
    fn log_probability_is_the_slope_of_the_distribution() {
        for (mean, log_deviation, noise) in [(0.0, 0.0, 0.3), (0.7, -1.0, -1.2), (-1.1, 0.4, 0.5)] {
            let found = squash(mean, log_deviation, noise);
            let (mean, deviation) = (f64::from(mean), f64::from(log_deviation).exp());
            let action = f64::from(found.action);
            let [low, high] = [-1e-4, 1e-4].map(|step| distribution(action + step, mean, deviation));
            let slope = (high - low) / 2e-4;
            let difference = slope.ln() - f64::from(found.log_probability);
            assert!(difference.abs() < 1e-4, "{difference} at {action}");
        }
    }

    #[test]
    fn derivatives_match_finite_differences() {
        for (mean, log_deviation, noise) in [(0.2, -0.5, 0.8), (-1.5, 0.3, -0.4), (0.0, 2.5, 0.1)] {
            let found = squash(mean, log_deviation, noise);
            let slope = |value: &dyn Fn(f32) -> f32| (value(1e-2) - value(-1e-2)) / 2e-2;
            let by_mean = |step: f32| squash(mean + step, log_deviation, noise);
            let by_log = |step: f32| squash(mean, log_deviation + step, noise);
            for (name, expected, found) in [
                ("logarithm by mean", slope(&|s| by_mean(s).log_probability), found.by_mean),
                ("logarithm by deviation", slope(&|s| by_log(s).log_probability), found.by_log_deviation),
                ("action by mean", slope(&|s| by_mean(s).action), found.action_by_mean),
                ("action by deviation", slope(&|s| by_log(s).action), found.action_by_log_deviation),
            ] {
                assert!((expected - found).abs() < 2e-3, "{name}: {expected} {found}");
            }
        }
    }

    #[test]
    fn log_probability_stays_finite_far_from_zero() {
        for mean in [-60.0, 60.0] {
            let found = squash(mean, 0.0, 0.0);
            // ln(1 - tanh(u)^2) approaches 2 ln 2 - 2 |u|
            let expected = -HALF_LN_TAU - 2.0 * core::f32::consts::LN_2 + 120.0;
            assert!((found.log_probability - expected).abs() < 1e-3, "{}", found.log_probability);
        }
    }
}
