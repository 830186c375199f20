//! Maximisation of a function of joint positions within their ranges.

use core::f64::consts::TAU;

/// Largest number of rounds over all coordinates in a search.
pub(super) const ROUNDS: usize = 32;
/// Relative improvement of a round above which another round follows.
const GAIN: f64 = 1e-9;
/// Number of sample positions over a range for a function of unknown shape.
const PLACES: usize = 9;
/// Largest number of function evaluations per coordinate.
pub(super) const VALUES: usize = 3 * PLACES;
/// Largest number of extrapolation steps in the direction of a round.
pub(super) const FURTHER: usize = 8;

/// Shape of a function along one coordinate, with the others fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// Sum of sines and cosines of the angle and of twice the angle: weights and inertias over a revolute
    /// joint. The positions of the carried bodies are linear in the sine and cosine of the angle; weights are
    /// linear in these positions, and inertias quadratic.
    Turning,
    /// Quadratic polynomial: weights and inertias over a prismatic joint.
    Sliding,
    /// Any other shape, such as when a second joint follows the coordinate with a ratio.
    Unknown,
}

/// Search coordinate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    /// Index of the coordinate among the positions.
    pub(super) index: usize,
    pub(super) range: [f64; 2],
    pub(super) shape: Shape,
}

/// Returns the largest value of a function found from these starting positions.
///
/// Each coordinate in turn moves to its maximum, which is exact for a known shape. The search ends when no
/// single coordinate improves the value, or after [`ROUNDS`]. Except at that limit, each start therefore
/// leads to a position that no single joint can improve.
pub(super) fn largest(starts: Vec<Vec<f64>>, axes: &[Axis], mut value: impl FnMut(&[f64]) -> f64) -> f64 {
    let mut most = f64::NEG_INFINITY;
    for mut at in starts {
        let mut best = value(&at);
        for _ in 0..ROUNDS {
            let (before, from) = (best, at.clone());
            for axis in axes {
                best = raise(axis, &mut at, best, &mut value);
            }
            best = go_on(axes, &from, &mut at, best, &mut value);
            if best - before <= GAIN * best.abs() {
                break;
            }
        }
        most = most.max(best);
    }
    most
}

/// Extrapolates in the direction of a round that started at `from`, with growing steps while the function
/// increases. On a ridge, where all coordinates have to move together, rounds alone only make small steps.
/// Returns the value at the new position.
fn go_on(
    axes: &[Axis],
    from: &[f64],
    at: &mut [f64],
    best: f64,
    value: &mut impl FnMut(&[f64]) -> f64,
) -> f64 {
    let (way, mut best) = (at.to_vec(), best);
    for step in 0..FURTHER {
        let share = f64::from(1_u32 << step);
        let mut further = way.clone();
        for Axis { index: i, range: [lower, upper], .. } in axes.iter().copied() {
            further[i] = (way[i] + share * (way[i] - from[i])).clamp(lower, upper);
        }
        let next = value(&further);
        if next <= best {
            break;
        }
        best = next;
        at.copy_from_slice(&further);
    }
    best
}

/// Moves one coordinate to a position where the function exceeds `best`, if there is one. Returns the value
/// there.
fn raise(axis: &Axis, at: &mut [f64], best: f64, value: &mut impl FnMut(&[f64]) -> f64) -> f64 {
    let (i, [lower, upper], mut best) = (axis.index, axis.range, best);
    let mut place = at[i];
    let mut value_at = |x: f64| {
        at[i] = x;
        value(at)
    };
    let mut consider = |x: f64, next: f64| {
        if next > best {
            (best, place) = (next, x);
        }
    };
    match axis.shape {
        Shape::Turning => {
            let angles: [f64; 5] = core::array::from_fn(|k| TAU * k as f64 / 5.0);
            let wave = Wave::through(angles.map(&mut value_at));
            let x = wave.highest(lower, upper.min(lower + TAU));
            consider(x, value_at(x));
        }
        Shape::Sliding => {
            let (middle, half) = ((lower + upper) / 2.0, (upper - lower) / 2.0);
            let [a, b, c] = [lower, middle, upper].map(&mut value_at);
            consider(lower, a);
            consider(upper, c);
            let curvature = a - 2.0 * b + c;
            if curvature < 0.0 {
                let x = (middle - half * (c - a) / (2.0 * curvature)).clamp(lower, upper);
                consider(x, value_at(x));
            }
        }
        Shape::Unknown => {
            let (mut center, mut half) = ((lower + upper) / 2.0, (upper - lower) / 2.0);
            for _ in 0..VALUES / PLACES {
                let mut highest = (f64::NEG_INFINITY, center);
                for step in 0..PLACES {
                    let share = 2.0 * step as f64 / (PLACES - 1) as f64 - 1.0;
                    let x = (center + share * half).clamp(lower, upper);
                    let next = value_at(x);
                    consider(x, next);
                    if next > highest.0 {
                        highest = (next, x);
                    }
                }
                (center, half) = (highest.1, 2.0 * half / (PLACES - 1) as f64);
            }
        }
    }
    at[i] = place;
    best
}

/// `c[0] + c[1] cos x + c[2] sin x + c[3] cos 2x + c[4] sin 2x`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wave {
    c: [f64; 5],
}

impl Wave {
    /// Number of sampling intervals over a range. Near the best sample, a wave has a single maximum.
    const STEPS: usize = 64;

    /// Returns the wave with these values at 0, 72, 144, 216 and 288 degrees.
    fn through(values: [f64; 5]) -> Self {
        let sum = |factor: fn(f64) -> f64, times: f64| {
            let terms = values.iter().enumerate();
            0.4 * terms.map(|(k, y)| y * factor(times * TAU * k as f64 / 5.0)).sum::<f64>()
        };
        let mean = values.iter().sum::<f64>() / 5.0;
        Self { c: [mean, sum(f64::cos, 1.0), sum(f64::sin, 1.0), sum(f64::cos, 2.0), sum(f64::sin, 2.0)] }
    }

    fn evaluate(&self, x: f64) -> f64 {
        let ([c0, c1, s1, c2, s2], (sin, cos)) = (self.c, x.sin_cos());
        c0 + c1 * cos + s1 * sin + c2 * (cos * cos - sin * sin) + s2 * 2.0 * sin * cos
    }

    /// Returns the position of the maximum in a range.
    fn highest(&self, lower: f64, upper: f64) -> f64 {
        let step = (upper - lower) / Self::STEPS as f64;
        let places = (0..=Self::STEPS).map(|k| lower + step * k as f64);
        let best = places.max_by(|a, b| self.evaluate(*a).total_cmp(&self.evaluate(*b))).unwrap_or(lower);
        // ternary search for the only maximum around the best sample
        let (mut a, mut b) = ((best - step).max(lower), (best + step).min(upper));
        for _ in 0..60 {
            let (x, y) = (a + (b - a) / 3.0, b - (b - a) / 3.0);
            if self.evaluate(x) < self.evaluate(y) { a = x } else { b = y }
        }
        [best, (a + b) / 2.0]
            .into_iter()
            .max_by(|a, b| self.evaluate(*a).total_cmp(&self.evaluate(*b)))
            .unwrap_or(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(shape: Shape, range: [f64; 2], start: f64, value: impl Fn(f64) -> f64) -> f64 {
        largest(vec![vec![start]], &[Axis { index: 0, range, shape }], |at| value(at[0]))
    }

    #[test]
    fn the_maximum_of_a_revolute_joint_is_exact() {
        let wave = |x: f64| 0.7 + 2.0 * (x - 1.1).cos() - 0.3 * (2.0 * x + 0.4).sin();
        // by a fine scan
        let scanned = |lower: f64, upper: f64| {
            (0..=1_000_000)
                .map(|k| wave(lower + (upper - lower) * f64::from(k) * 1e-6))
                .fold(f64::MIN, f64::max)
        };
        for [lower, upper] in [[-3.0, 3.0], [1.9, 2.4], [-2.0, -1.0], [-9.0, 9.0], [4.0, 6.0]] {
            let (found, expected) = (one(Shape::Turning, [lower, upper], lower, wave), scanned(lower, upper));
            assert!((found - expected).abs() < 1e-9, "{found} instead of {expected} in {lower} to {upper}");
        }
    }

    #[test]
    fn the_maximum_of_a_prismatic_joint_is_exact() {
        for (factor, range, expected) in [
            (-1.0, [0.0, 1.0], 0.0),
            (-1.0, [0.5, 1.0], -0.04),
            (1.0, [0.0, 1.0], 0.49),
            (0.0, [0.0, 1.0], 0.0),
        ] {
            let found = one(Shape::Sliding, range, range[0], |x| factor * (x - 0.3) * (x - 0.3));
            assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
        }
    }

    #[test]
    fn the_maximum_of_an_unknown_coordinate_is_close() {
        let found = one(Shape::Unknown, [-2.0, 2.0], 0.0, |x| (3.0 * (x - 0.77)).cos());
        assert!((0.998..=1.0).contains(&found), "{found}");
    }
}
