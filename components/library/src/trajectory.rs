//! Recorded movements before their conversion to forces.

use nalgebra::DMatrix;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_pcg::Pcg64;

use crate::{Interpolation, SampledSpring};

/// A recorded movement: evenly spaced positions of every degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Name of the movement.
    pub id: String,
    /// Label of the kind of movement, if known.
    pub label: Option<String>,
    /// Time from the first sample to the last, s.
    pub duration: f64,
    /// Positions, samples x degrees of freedom.
    pub positions: DMatrix<f64>,
}

/// Recorded movements of the same degrees of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Recordings {
    /// Names of the degrees of freedom.
    pub names: Vec<String>,
    /// Recorded movements.
    pub trajectories: Vec<Trajectory>,
}

impl Trajectory {
    /// Returns the path at the spring's samples, which are evenly spaced on the spring's interpolation curve.
    pub fn sampled(&self, spring: &SampledSpring) -> DMatrix<f64> {
        match spring.interpolation() {
            Interpolation::Spline if self.positions.nrows() > 2 => self.splined(spring.samples()).positions,
            Interpolation::Spline | Interpolation::Linear => self.resampled(spring.samples()),
        }
    }

    /// Returns the path resampled to `samples` evenly spaced samples by linear interpolation.
    pub fn resampled(&self, samples: usize) -> DMatrix<f64> {
        let (rows, columns) = self.positions.shape();
        DMatrix::from_fn(samples, columns, |k, d| {
            let at = k as f64 * (rows - 1) as f64 / (samples - 1).max(1) as f64;
            let below = (at as usize).min(rows.saturating_sub(2));
            let part = at - below as f64;
            let (a, b) = (self.positions[(below, d)], self.positions[((below + 1).min(rows - 1), d)]);
            a + part * (b - a)
        })
    }

    /// Returns the recording resampled to `samples` evenly spaced points of the natural cubic spline through
    /// its samples. Forces are second differences: piecewise linear paths cause a spike at every sample, but
    /// splines do not. A recording that already has `samples` samples stays unchanged.
    #[must_use]
    pub fn splined(&self, samples: usize) -> Self {
        let (rows, columns) = self.positions.shape();
        if rows < 3 || rows == samples {
            return self.clone();
        }
        // second derivatives per squared sample, 0 at the ends:
        // m[k-1] + 4 m[k] + m[k+1] = 6 (y[k-1] - 2 y[k] + y[k+1])
        let mut curvature = DMatrix::<f64>::zeros(rows, columns);
        let mut pivots = vec![0.0; rows];
        for k in 1..rows - 1 {
            pivots[k] = 1.0 / (4.0 - if k > 1 { pivots[k - 1] } else { 0.0 });
            for d in 0..columns {
                let y = |k: usize| self.positions[(k, d)];
                let bend = 6.0 * (y(k - 1) - 2.0 * y(k) + y(k + 1));
                curvature[(k, d)] = (bend - curvature[(k - 1, d)]) * pivots[k];
            }
        }
        for k in (1..rows - 1).rev() {
            for d in 0..columns {
                let next = curvature[(k + 1, d)];
                curvature[(k, d)] -= pivots[k] * next;
            }
        }
        let positions = DMatrix::from_fn(samples, columns, |k, d| {
            let at = k as f64 * (rows - 1) as f64 / (samples - 1).max(1) as f64;
            let below = (at as usize).min(rows - 2);
            let (b, y, m) = (at - below as f64, &self.positions, &curvature);
            let a = 1.0 - b;
            a * y[(below, d)]
                + b * y[(below + 1, d)]
                + ((a * a * a - a) * m[(below, d)] + (b * b * b - b) * m[(below + 1, d)]) / 6.0
        });
        Self { positions, ..self.clone() }
    }

    /// Returns the recording smoothed with a symmetric Gaussian of standard deviation `sigma` samples,
    /// without a phase shift.
    ///
    /// Forces are second differences and amplify noise, so a measured recording is smoothed before it is
    /// converted to forces. The recording is extended point-symmetrically at both ends, so the first and last
    /// sample do not change.
    #[must_use]
    pub fn smoothed(&self, sigma: f64) -> Self {
        if sigma <= 0.0 {
            return self.clone();
        }
        let (rows, columns) = self.positions.shape();
        let reach = (4.0 * sigma).ceil() as isize;
        let kernel: Vec<f64> = (-reach..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
        let total: f64 = kernel.iter().sum();
        let last = rows as isize - 1;
        let sample = |k: isize, d: usize| -> f64 {
            let y = |k: isize| self.positions[(k.clamp(0, last) as usize, d)];
            match k {
                k if k < 0 => 2.0 * y(0) - y(-k),
                k if k > last => 2.0 * y(last) - y(2 * last - k),
                k => y(k),
            }
        };
        let positions = DMatrix::from_fn(rows, columns, |k, d| {
            let terms = kernel.iter().zip(-reach..=reach);
            terms.map(|(weight, shift)| weight * sample(k as isize + shift, d)).sum::<f64>() / total
        });
        Self { positions, ..self.clone() }
    }

    /// Returns the root mean square distance of the samples from their mean, a measure of size.
    pub fn spread(positions: &DMatrix<f64>) -> f64 {
        let mean = positions.row_mean();
        let squares: f64 = positions.row_iter().map(|row| (row - &mean).norm_squared()).sum();
        (squares / positions.nrows().max(1) as f64).sqrt()
    }
}

impl Recordings {
    /// Returns windows of `length` samples of each recording, one every `stride` samples. Windows with a step
    /// change larger than `leap` between samples are omitted. A window has the label of its recording, and
    /// the recording's id followed by the index of the window's first sample.
    #[must_use]
    pub fn windows(&self, length: usize, stride: usize, leap: f64) -> Self {
        let mut trajectories = Vec::new();
        for whole in &self.trajectories {
            let (rows, columns) = whole.positions.shape();
            let step = whole.duration / (rows - 1).max(1) as f64;
            let mut first = 0;
            while length >= 2 && first + length <= rows {
                let positions = whole.positions.rows(first, length).into_owned();
                let leaps = (1..length)
                    .any(|k| (0..columns).any(|d| (positions[(k, d)] - positions[(k - 1, d)]).abs() > leap));
                if !leaps {
                    trajectories.push(Trajectory {
                        id: format!("{}@{first}", whole.id),
                        label: whole.label.clone(),
                        duration: step * (length - 1) as f64,
                        positions,
                    });
                }
                first += stride.max(1);
            }
        }
        Self { names: self.names.clone(), trajectories }
    }

    /// Splits the movements at random. The first set contains the fraction `share` of all movements, and at
    /// least one movement if there are two or more. The second set contains the remaining movements. Equal
    /// seeds give equal sets.
    pub fn split(&self, share: f64, seed: u64) -> (Self, Self) {
        let mut order: Vec<&Trajectory> = self.trajectories.iter().collect();
        order.shuffle(&mut Pcg64::seed_from_u64(seed));
        let count = (share.clamp(0.0, 1.0) * order.len() as f64).round() as usize;
        let (first, rest) = order.split_at(count.max(1).min(order.len()));
        let set = |part: &[&Trajectory]| Self {
            names: self.names.clone(),
            trajectories: part.iter().copied().cloned().collect(),
        };
        (set(first), set(rest))
    }

    /// Splits the movements by label. For each label, one in `every` movements, in order, belongs to the
    /// second set; all other movements belong to the first set. An `every` below 2 counts as 2.
    pub fn hold_out(&self, every: usize) -> (Self, Self) {
        let mut counts = std::collections::BTreeMap::<Option<&str>, usize>::new();
        let (mut seen, mut held) = (Vec::new(), Vec::new());
        for trajectory in &self.trajectories {
            let count = counts.entry(trajectory.label.as_deref()).or_default();
            *count += 1;
            if count.is_multiple_of(every.max(2)) { &mut held } else { &mut seen }.push(trajectory.clone());
        }
        let set = |trajectories| Self { names: self.names.clone(), trajectories };
        (set(seen), set(held))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(samples: usize) -> Trajectory {
        let positions = DMatrix::from_fn(samples, 2, |k, d| k as f64 * (d as f64 + 1.0));
        Trajectory { id: "line".into(), label: Some("l".into()), duration: 1.0, positions }
    }

    #[test]
    fn resampling_and_smoothing_keep_a_straight_line() {
        let resampled = line(11).resampled(41);
        assert!((0..41).all(|k| (resampled[(k, 1)] - 0.5 * k as f64).abs() < 1e-12));
        let smoothed = line(40).smoothed(2.0);
        assert!((&smoothed.positions - line(40).positions).norm() < 1e-10);
    }

    #[test]
    fn random_split_is_a_reproducible_partition() {
        let trajectories = (0..20).map(|k| Trajectory { id: k.to_string(), ..line(4) }).collect();
        let set = Recordings { names: vec!["a".into(), "b".into()], trajectories };
        let ids = |set: &Recordings| set.trajectories.iter().map(|t| t.id.clone()).collect::<Vec<_>>();
        let (few, many) = set.split(0.2, 7);
        assert_eq!((few.trajectories.len(), many.trajectories.len()), (4, 16));
        let all: std::collections::BTreeSet<String> = ids(&few).into_iter().chain(ids(&many)).collect();
        assert_eq!(all.len(), 20);
        assert_eq!(ids(&set.split(0.2, 7).0), ids(&few));
        assert_ne!(ids(&set.split(0.2, 8).0), ids(&few));
    }

    #[test]
    fn spline_interpolates_samples_and_approximates_the_curve() {
        let wave = |t: f64| (3.0 * t).sin();
        let positions = DMatrix::from_fn(31, 1, |k, _| wave(k as f64 * 0.1));
        let few = Trajectory { id: "wave".into(), label: None, duration: 3.0, positions };
        let many = few.splined(121);
        for k in 0..31 {
            assert!((many.positions[(4 * k, 0)] - few.positions[(k, 0)]).abs() < 1e-12);
        }
        // away from the ends, where a natural spline is straight and the wave is not
        let off = |path: &DMatrix<f64>| {
            (20..100).map(|k| (path[(k, 0)] - wave(k as f64 * 0.025)).abs()).fold(0.0, f64::max)
        };
        assert!(off(&many.positions) < 1e-4, "{}", off(&many.positions));
        assert!(off(&few.resampled(121)) > 50.0 * off(&many.positions));
        assert_eq!(few.splined(31), few);
    }

    #[test]
    fn spring_samples_with_its_own_interpolation() {
        let wave = |t: f64| (3.0 * t).sin();
        let positions = DMatrix::from_fn(31, 1, |k, _| wave(k as f64 * 0.1));
        let few = Trajectory { id: "wave".into(), label: None, duration: 3.0, positions };
        let spring = SampledSpring::new(121, crate::DAMPING).unwrap();
        assert_eq!(few.sampled(&spring), few.splined(121).positions, "splines are the default");
        let straight = spring.with_interpolation(Interpolation::Linear);
        assert_eq!(few.sampled(&straight), few.resampled(121));
        assert_ne!(few.sampled(&spring), few.sampled(&straight));
    }

    #[test]
    fn discontinuity_drops_a_window_and_holdout_keeps_shares() {
        let mut jumping = line(40);
        jumping.positions[(25, 0)] += 10.0;
        let set = Recordings { names: vec!["a".into(), "b".into()], trajectories: vec![jumping] };
        let windows = set.windows(10, 10, 3.0);
        assert_eq!(
            windows.trajectories.iter().map(|t| t.id.as_str()).collect::<Vec<_>>(),
            ["line@0", "line@10", "line@30"]
        );
        let (seen, held) = windows.hold_out(3);
        assert_eq!((seen.trajectories.len(), held.trajectories.len()), (2, 1));
    }
}
