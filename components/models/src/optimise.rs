//! Minimisation of smooth functions by L-BFGS.
//!
//! Each step uses the two-loop recursion over the previous steps (10 by default) and a line search for the
//! strong Wolfe conditions. References: Nocedal, Wright, *Numerical Optimization*, 2nd ed., algorithms 7.4,
//! 3.5 and 3.6.

use std::collections::VecDeque;

/// Options of [`minimise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Maximum number of iterations. Default: 100.
    pub iterations: usize,
    /// Number of previous steps stored by L-BFGS. Default: 10.
    pub memory: usize,
    /// Tolerance of the gradient: the minimisation stops when no entry of the gradient exceeds this
    /// magnitude. Default: 1e-6.
    pub gradient: f64,
    /// Minimum improvement: the minimisation stops when a step decreases the value of the function by less
    /// than this fraction. Default: 1e-10.
    pub improvement: f64,
    /// Maximum change of one variable in one step. Default: 2.
    pub step: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { iterations: 100, memory: 10, gradient: 1e-6, improvement: 1e-10, step: 2.0 }
    }
}

/// Result of [`minimise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Minimum {
    /// Smallest value found.
    pub value: f64,
    /// Number of iterations.
    pub iterations: usize,
    /// Number of evaluations of the function.
    pub evaluations: usize,
}

const SUFFICIENT: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
/// A line search ends when its remaining gain is below this fraction of the improvement that stops the
/// minimisation. Near the minimum, rounding of the value would otherwise make it bisect to the end.
const RESOLUTION: f64 = 0.1;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Minimises `function` by L-BFGS, starting at `x`, and writes the best point found to `x`.
///
/// `function` receives a point, writes the gradient to its second argument and returns the value. A value
/// that is not finite marks a point outside the domain, and the line search then backtracks. If the initial
/// value is not finite, `x` is unchanged.
pub fn minimise(
    x: &mut [f64],
    options: &Options,
    mut function: impl FnMut(&[f64], &mut [f64]) -> f64,
) -> Minimum {
    let n = x.len();
    let mut gradient = vec![0.0; n];
    let mut value = function(x, &mut gradient);
    let mut result = Minimum { value, iterations: 0, evaluations: 1 };
    let mut steps: VecDeque<(Vec<f64>, Vec<f64>, f64)> = VecDeque::new();
    while value.is_finite() && result.iterations < options.iterations {
        if gradient.iter().all(|g| g.abs() <= options.gradient) {
            break;
        }
        let mut direction = descent(&gradient, &steps);
        let mut slope = dot(&direction, &gradient);
        if !slope.is_finite() || slope >= 0.0 {
            steps.clear();
            direction = gradient.iter().map(|g| -g).collect();
            slope = -dot(&gradient, &gradient);
        }
        let longest = direction.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
        let limit = options.step / longest;
        let first = if steps.is_empty() { (1.0 / (-slope).sqrt()).min(1.0) } else { 1.0 };
        let resolution = RESOLUTION * options.improvement * value.abs().max(1.0);
        let mut search =
            Search { x, direction: &direction, function: &mut function, resolution, evaluations: 0 };
        let found = search.run(value, slope, first.min(limit), limit);
        result.evaluations += search.evaluations;
        let Some((length, next, next_gradient)) = found else {
            if steps.is_empty() {
                break;
            }
            // the stored curvature is no longer valid
            steps.clear();
            continue;
        };
        let step: Vec<f64> = direction.iter().map(|d| length * d).collect();
        let change: Vec<f64> = next_gradient.iter().zip(&gradient).map(|(a, b)| a - b).collect();
        x.iter_mut().zip(&step).for_each(|(x, s)| *x += s);
        let curvature = dot(&step, &change);
        if curvature > 1e-12 * dot(&change, &change) {
            if steps.len() == options.memory.max(1) {
                steps.pop_front();
            }
            steps.push_back((step, change, 1.0 / curvature));
        }
        let gain = value - next;
        value = next;
        gradient = next_gradient;
        result.iterations += 1;
        if gain <= options.improvement * value.abs().max(1.0) {
            break;
        }
    }
    result.value = value;
    result
}

/// Returns `-H g`, computed by the two-loop recursion.
fn descent(gradient: &[f64], steps: &VecDeque<(Vec<f64>, Vec<f64>, f64)>) -> Vec<f64> {
    let mut q: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut weights = vec![0.0; steps.len()];
    for ((step, change, rho), weight) in steps.iter().zip(&mut weights).rev() {
        *weight = rho * dot(step, &q);
        q.iter_mut().zip(change).for_each(|(q, c)| *q -= *weight * c);
    }
    if let Some((_, change, rho)) = steps.back() {
        let scale = 1.0 / (rho * dot(change, change));
        q.iter_mut().for_each(|q| *q *= scale);
    }
    for ((step, change, rho), weight) in steps.iter().zip(&weights) {
        let beta = rho * dot(change, &q);
        q.iter_mut().zip(step).for_each(|(q, s)| *q += (weight - beta) * s);
    }
    q
}

struct Search<'a, F> {
    x: &'a [f64],
    direction: &'a [f64],
    function: &'a mut F,
    /// Smallest relevant gain.
    resolution: f64,
    evaluations: usize,
}

struct Point {
    length: f64,
    value: f64,
    slope: f64,
    gradient: Vec<f64>,
}

impl<F: FnMut(&[f64], &mut [f64]) -> f64> Search<'_, F> {
    fn try_length(&mut self, length: f64) -> Point {
        let x: Vec<f64> = self.x.iter().zip(self.direction).map(|(x, d)| x + length * d).collect();
        let mut gradient = vec![0.0; x.len()];
        let value = (self.function)(&x, &mut gradient);
        self.evaluations += 1;
        let slope = dot(&gradient, self.direction);
        let value = if value.is_finite() && slope.is_finite() { value } else { f64::INFINITY };
        Point { length, value, slope, gradient }
    }

    /// Returns a step length that satisfies the strong Wolfe conditions, or at least decreases the value.
    fn run(&mut self, value: f64, slope: f64, first: f64, limit: f64) -> Option<(f64, f64, Vec<f64>)> {
        let mut low = Point { length: 0.0, value, slope, gradient: vec![] };
        let mut high: Option<Point> = None;
        let mut length = first;
        for _ in 0..25 {
            let point = self.try_length(length);
            if point.value > value + SUFFICIENT * length * slope || point.value >= low.value {
                high = Some(point);
            } else {
                if point.slope.abs() <= -CURVATURE * slope || (high.is_none() && length >= limit) {
                    return Some((point.length, point.value, point.gradient));
                }
                let turned = match &high {
                    None => point.slope >= 0.0,
                    Some(high) => point.slope * (high.length - low.length) >= 0.0,
                };
                let before = std::mem::replace(&mut low, point);
                if turned {
                    high = Some(before);
                }
            }
            length = match &high {
                None => (2.5 * length).min(limit),
                Some(high) => between(&low, high),
            };
            let width = high.as_ref().map_or(f64::INFINITY, |high| (high.length - low.length).abs());
            if width < 1e-14 * first || width * low.slope.abs() <= self.resolution {
                break;
            }
        }
        (low.length > 0.0).then_some((low.length, low.value, low.gradient))
    }
}

/// Returns the minimum of the cubic through two points, well inside their interval.
fn between(a: &Point, b: &Point) -> f64 {
    let width = b.length - a.length;
    let middle = a.length + 0.5 * width;
    if !b.value.is_finite() {
        return a.length + 0.1 * width;
    }
    let d1 = a.slope + b.slope - 3.0 * (a.value - b.value) / (a.length - b.length);
    let root = (d1 * d1 - a.slope * b.slope).sqrt().copysign(width);
    let found = b.length - width * (b.slope + root - d1) / (b.slope - a.slope + 2.0 * root);
    let share = (found - a.length) / width;
    if share.is_finite() && (0.05..=0.95).contains(&share) { found } else { middle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rosenbrock_is_minimised_in_ten_dimensions() {
        let mut x = vec![-1.2; 10];
        let options = Options { iterations: 500, improvement: 0.0, gradient: 1e-9, ..Options::default() };
        let found = minimise(&mut x, &options, |x, g| {
            g.fill(0.0);
            let mut value = 0.0;
            for i in 0..9 {
                let (a, b) = (1.0 - x[i], x[i + 1] - x[i] * x[i]);
                value += a * a + 100.0 * b * b;
                g[i] += -2.0 * a - 400.0 * b * x[i];
                g[i + 1] += 200.0 * b;
            }
            value
        });
        assert!(found.value < 1e-15, "{found:?}");
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-7), "{x:?}");
        assert!(found.evaluations < 250, "{found:?}");
    }

    #[test]
    fn a_rounded_minimum_is_found_without_bisection() {
        let mut x = [3.0, -2.0];
        let found = minimise(&mut x, &Options::default(), |x, g| {
            (g[0], g[1]) = (2.0 * x[0], 40.0 * x[1]);
            // single precision hides the last gains
            f64::from((1000.0 + x[0] * x[0] + 20.0 * x[1] * x[1]) as f32)
        });
        assert!(x.iter().all(|x| x.abs() < 0.02) && found.evaluations < 30, "{x:?} {found:?}");
    }

    #[test]
    fn line_search_leaves_infeasible_points() {
        let mut x = [4.0];
        let found = minimise(&mut x, &Options { step: 100.0, ..Options::default() }, |x, g| {
            g[0] = 1.0 - 1.0 / x[0];
            if x[0] > 0.0 { x[0] - x[0].ln() } else { f64::NAN }
        });
        assert!((x[0] - 1.0).abs() < 1e-4 && (found.value - 1.0).abs() < 1e-8, "{x:?} {found:?}");
    }

    #[test]
    fn infeasible_start_is_unchanged() {
        let mut x = [-1.0];
        let found = minimise(&mut x, &Options::default(), |_, _| f64::INFINITY);
        assert_eq!((x, found.iterations), ([-1.0], 0));
    }
}
