//! A handwritten stroke through points, with variation.

use nalgebra::DMatrix;
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::shapes::{ALPHABET, points};
use crate::{Recordings, Trajectory};

/// Standard deviations of the random variation between letters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    /// Standard deviation of each point, in letter widths.
    pub points: f64,
    /// Standard deviation of slant, stretch and rotation \[rad, or relative\].
    pub shape: f64,
    /// Standard deviation of the natural logarithm of the duration.
    pub pace: f64,
}

impl Default for Variation {
    fn default() -> Self {
        Self { points: 0.03, shape: 0.08, pace: 0.1 }
    }
}

/// Number of samples of each letter.
const SAMPLES: usize = 200;
/// Duration of a letter per letter width of stroke length, s.
const SECONDS_PER_WIDTH: f64 = 0.35;

/// Returns `each` random variations of every letter of the [`ALPHABET`], with widths of 1. Equal seeds give
/// equal letters.
pub fn letters(each: usize, variation: Variation, seed: u64) -> Recordings {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut trajectories = Vec::new();
    for letter in ALPHABET.chars() {
        let shape = points(letter).expect("every letter of the alphabet has a shape");
        for k in 0..each {
            let (positions, length) = write(shape, variation, &mut random);
            let pace: f64 = variation.pace * normal(&mut random);
            trajectories.push(Trajectory {
                id: format!("{letter}{k}"),
                label: Some(letter.to_string()),
                duration: SECONDS_PER_WIDTH * length * pace.exp(),
                positions,
            });
        }
    }
    Recordings { names: vec!["x".into(), "y".into()], trajectories }
}

fn normal(random: &mut Pcg64) -> f64 {
    StandardNormal.sample(random)
}

/// Writes one letter: returns its samples, evenly spaced in time, and the length of its stroke.
fn write(shape: &[[f64; 2]], variation: Variation, random: &mut Pcg64) -> (DMatrix<f64>, f64) {
    let [slant, turn, wide, high] = [0; 4].map(|_| variation.shape * normal(random));
    let (sin, cos) = turn.sin_cos();
    let through: Vec<[f64; 2]> = shape
        .iter()
        .map(|[x, y]| {
            let x = (x + variation.points * normal(random) - 0.5) * wide.exp() + slant * y;
            let y = (y + variation.points * normal(random)) * high.exp();
            [cos * x - sin * y, sin * x + cos * y]
        })
        .collect();
    let curve = smooth(&through);
    // Time along the curve: the two-thirds power law, v ~ curvature^(-1/3), and rest at both ends.
    let (mut times, mut length) = (vec![0.0], 0.0);
    let total: f64 = curve.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
    for k in 1..curve.len() {
        let step = distance(curve[k], curve[k - 1]);
        let before = curve[k.saturating_sub(8)];
        let after = curve[(k + 8).min(curve.len() - 1)];
        let (a, b) = (distance(curve[k], before), distance(after, curve[k]));
        let bend = turned(before, curve[k], after) / (0.5 * (a + b)).max(1e-6);
        length += step;
        let part = (length - 0.5 * step) / total;
        let ends = (part * (1.0 - part) * 8.0).sqrt().min(1.0);
        let speed = (0.2 + bend).powf(-1.0 / 3.0) * (0.05 + ends);
        times.push(times[k - 1] + step / speed);
    }
    let end = times[times.len() - 1];
    let mut at = 0;
    let mut positions = DMatrix::zeros(SAMPLES, 2);
    for k in 0..SAMPLES {
        let time = end * k as f64 / (SAMPLES - 1) as f64;
        while at + 2 < times.len() && times[at + 1] < time {
            at += 1;
        }
        let part = ((time - times[at]) / (times[at + 1] - times[at])).clamp(0.0, 1.0);
        for d in 0..2 {
            positions[(k, d)] = curve[at][d] + part * (curve[at + 1][d] - curve[at][d]);
        }
    }
    let written = Trajectory { id: String::new(), label: None, duration: 1.0, positions };
    (written.smoothed(2.0).positions, length)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Returns the angle by which a curve turns at `b`, rad.
fn turned(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
    (u[0] * v[1] - u[1] * v[0]).atan2(u[0] * v[0] + u[1] * v[1]).abs()
}

/// Returns a densely sampled curve through points: a centripetal Catmull-Rom spline.
fn smooth(through: &[[f64; 2]]) -> Vec<[f64; 2]> {
    const BETWEEN: usize = 40;
    let last = through.len() - 1;
    let mirrored = |end: [f64; 2], next: [f64; 2]| [2.0 * end[0] - next[0], 2.0 * end[1] - next[1]];
    let mut padded = vec![mirrored(through[0], through[1])];
    padded.extend_from_slice(through);
    padded.push(mirrored(through[last], through[last - 1]));
    let mut curve = vec![through[0]];
    for p in padded.windows(4) {
        let knot = |a: [f64; 2], b: [f64; 2]| distance(a, b).sqrt().max(1e-6);
        let (t1, t2, t3) = (knot(p[0], p[1]), knot(p[1], p[2]), knot(p[2], p[3]));
        for k in 1..=BETWEEN {
            let x = k as f64 / BETWEEN as f64;
            curve.push(std::array::from_fn(|d| {
                let (a, b, c) =
                    ((p[1][d] - p[0][d]) / t1, (p[2][d] - p[1][d]) / t2, (p[3][d] - p[2][d]) / t3);
                let m1 = t2 * (a - (p[2][d] - p[0][d]) / (t1 + t2) + b);
                let m2 = t2 * (b - (p[3][d] - p[1][d]) / (t2 + t3) + c);
                let (y0, y1) = (p[1][d], p[2][d]);
                let (e, f) = (2.0 * (y0 - y1) + m1 + m2, 3.0 * (y1 - y0) - 2.0 * m1 - m2);
                y0 + x * (m1 + x * (f + x * e))
            }));
        }
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_reproducible_from_their_seed() {
        let (a, b, c) = (
            letters(2, Variation::default(), 1),
            letters(2, Variation::default(), 1),
            letters(2, Variation::default(), 2),
        );
        assert_eq!(a, b);
        assert_ne!(a, c);
        assert_eq!(a.trajectories.len(), 2 * ALPHABET.len());
    }

    #[test]
    fn letter_without_variation_passes_its_ends() {
        let none = Variation { points: 0.0, shape: 0.0, pace: 0.0 };
        let set = letters(1, none, 0);
        for (trajectory, letter) in set.trajectories.iter().zip(ALPHABET.chars()) {
            let shape = points(letter).unwrap();
            let first = trajectory.positions.row(0);
            assert!((first[0] - (shape[0][0] - 0.5)).abs() < 1e-9 && (first[1] - shape[0][1]).abs() < 1e-9);
        }
    }
}
