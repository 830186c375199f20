//! Predictions, and the latent point of a new pose.

use motorium_algebra::Simd;

use super::LatentModel;
use crate::optimise::{Options, minimise};

/// Workspace of [`LatentModel::predict`].
#[derive(Clone, Debug)]
pub struct Scratch {
    row: Vec<f64>,
}

impl LatentModel {
    /// Returns a workspace for predictions.
    pub fn scratch(&self) -> Scratch {
        Scratch { row: vec![0.0; self.poses()] }
    }

    /// Writes the mean pose of a space at a latent point `x`, and the variance of an observation for each
    /// column. Returns the fraction of the kernel's variance that the training poses do not explain: 0 where
    /// the training poses determine the pose, 1 far from all training poses. Does not allocate.
    ///
    /// # Panics
    /// If the space does not exist or a slice has the wrong length.
    pub fn predict(
        &self,
        space: usize,
        x: &[f64],
        mean: &mut [f64],
        variance: &mut [f64],
        scratch: &mut Scratch,
    ) -> f64 {
        let shared = self.standard_prediction(space, x, mean, &mut scratch.row);
        let space = &self.spaces[space];
        for ((mean, m), s) in mean.iter_mut().zip(&space.mean).zip(&space.scale) {
            *mean = m + s * *mean;
        }
        for (variance, s) in variance.iter_mut().zip(&space.scale) {
            *variance = shared * s * s;
        }
        (shared - space.noise) / space.kernel.variance
    }

    /// Writes the mean of the standardised pose, and returns its variance, which all columns share.
    fn standard_prediction(&self, space: usize, x: &[f64], mean: &mut [f64], row: &mut [f64]) -> f64 {
        let (space, marginal) = (&self.spaces[space], &self.marginals[space]);
        assert_eq!(mean.len(), space.dimensions(), "columns of {}", space.name);
        self.covariances(space, x, row);
        let simd = Simd::new();
        for (mean, weights) in mean.iter_mut().zip(marginal.weights.chunks_exact(row.len())) {
            *mean = simd.dot(row, weights);
        }
        marginal.factor.solve_lower(row);
        (space.kernel.variance - simd.dot(row, row)).max(0.0) + space.noise
    }

    fn covariances(&self, space: &super::Space, x: &[f64], row: &mut [f64]) {
        assert_eq!(x.len(), self.latents(), "dimensions of the latent");
        crate::kernel::stationary_row(&space.kernel, x, &self.points, row);
    }

    /// Returns the latent point of a new pose, by the back constraint if the space has one, and otherwise by
    /// [`infer`](Self::infer).
    ///
    /// # Panics
    /// If the space does not exist or the pose has the wrong number of columns.
    pub fn latent_of_pose(&self, space: usize, pose: &[f64]) -> Vec<f64> {
        match &self.back {
            Some(back) if back.space == space => {
                let mut standard = vec![0.0; pose.len()];
                let mut x = vec![0.0; self.latents()];
                self.map_back(pose, &mut standard, &mut x);
                x
            }
            _ => self.infer(space, pose),
        }
    }

    /// Maps a new pose to its latent point by the back constraint, and writes this point to `x`. `standard`
    /// is a workspace for the standardised pose. Returns `false` if there is no back constraint. Does not
    /// allocate.
    ///
    /// # Panics
    /// If a slice has the wrong length; `standard` must have the length of the pose.
    pub fn map_back(&self, pose: &[f64], standard: &mut [f64], x: &mut [f64]) -> bool {
        let Some(back) = &self.back else { return false };
        let space = &self.spaces[back.space];
        assert_eq!((pose.len(), x.len()), (space.dimensions(), self.latents()), "columns of {}", space.name);
        space.standardise(pose, standard);
        back.map(standard, x);
        true
    }

    /// Returns the latent point that minimises `D ln s(x) / 2 + |y - m(x)|^2 / (2 s(x)) + |x|^2 / 2` for a
    /// new pose `y`. The minimisation uses L-BFGS and starts at the latent point of the nearest training
    /// pose.
    ///
    /// # Panics
    /// If the space does not exist or the pose has the wrong number of columns.
    pub fn infer(&self, space: usize, pose: &[f64]) -> Vec<f64> {
        let own = &self.spaces[space];
        assert_eq!(pose.len(), own.dimensions(), "columns of {}", own.name);
        let mut y = vec![0.0; pose.len()];
        own.standardise(pose, &mut y);
        let n = self.poses();
        let mut distances = vec![0.0; n];
        for (column, y) in own.targets.chunks_exact(n).zip(&y) {
            distances.iter_mut().zip(column).for_each(|(d, v)| *d += (v - y) * (v - y));
        }
        let nearest = (0..n).min_by(|a, b| distances[*a].total_cmp(&distances[*b])).unwrap_or(0);
        let mut x = vec![0.0; self.latents()];
        self.points.copy_point(nearest, &mut x);
        let mut memory = Inference::new(n, y.len());
        let options = Options { iterations: 50, gradient: 1e-5, improvement: 1e-8, ..Options::default() };
        minimise(&mut x, &options, |x, gradient| self.mismatch(space, &y, x, gradient, &mut memory));
        x
    }

    /// The objective of [`infer`](Self::infer) and its gradient.
    fn mismatch(
        &self,
        index: usize,
        y: &[f64],
        x: &[f64],
        gradient: &mut [f64],
        memory: &mut Inference,
    ) -> f64 {
        let (space, marginal) = (&self.spaces[index], &self.marginals[index]);
        let n = self.poses();
        let simd = Simd::new();
        let Inference { row, solved, pull, error } = memory;
        self.covariances(space, x, row);
        for ((error, y), weights) in error.iter_mut().zip(y).zip(marginal.weights.chunks_exact(n)) {
            *error = simd.dot(row, weights) - y;
        }
        solved.copy_from_slice(row);
        marginal.factor.solve(solved);
        let variance = (space.kernel.variance - simd.dot(row, solved)).max(0.0) + space.noise;
        let (columns, squares) = (y.len() as f64, simd.dot(error, error));
        // dE/dk = e^T W / s - 2 (dE/ds) K^-1 k, with e = m - y
        let by_variance = 0.5 * columns / variance - 0.5 * squares / (variance * variance);
        pull.iter_mut().zip(&*solved).for_each(|(pull, v)| *pull = -2.0 * by_variance * v);
        for (error, weights) in error.iter().zip(marginal.weights.chunks_exact(n)) {
            simd.add_scaled(error / variance, weights, pull);
        }
        pull.iter_mut().zip(&*row).for_each(|(pull, k)| *pull *= k);
        let mut prior = 0.0;
        for (d, (gradient, x)) in gradient.iter_mut().zip(x).enumerate() {
            let length = space.kernel.lengths[d];
            let sum: f64 = pull.iter().zip(self.points.coordinate(d)).map(|(p, z)| p * (z - x)).sum();
            *gradient = sum / (length * length) + x;
            prior += x * x;
        }
        0.5 * (columns * variance.ln() + squares / variance + prior)
    }
}

struct Inference {
    row: Vec<f64>,
    solved: Vec<f64>,
    pull: Vec<f64>,
    error: Vec<f64>,
}

impl Inference {
    fn new(n: usize, columns: usize) -> Self {
        Self { row: vec![0.0; n], solved: vec![0.0; n], pull: vec![0.0; n], error: vec![0.0; columns] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gplvm::{Settings, SpaceData};

    #[test]
    fn the_gradient_of_inference_equals_finite_differences() {
        let values: Vec<f64> = (0..60).map(|i| (0.6 * f64::from(i / 3) + f64::from(i % 3)).sin()).collect();
        let columns = vec!["a".to_string(), "b".to_string(), "c".to_string()];
        let data = [SpaceData { name: "a", columns, values: &values }];
        let settings = Settings { latents: Some(2), iterations: 10, back: None, ..Settings::default() };
        let model = LatentModel::train(&data, &settings).expect("a model").0;
        let (x, y) = ([0.3, -0.4], [0.2, -0.5, 0.9]);
        let mut memory = Inference::new(20, 3);
        let mut gradient = [0.0; 2];
        model.mismatch(0, &y, &x, &mut gradient, &mut memory);
        for d in 0..2 {
            let mut side = |step: f64| {
                let mut moved = x;
                moved[d] += step;
                model.mismatch(0, &y, &moved, &mut [0.0; 2], &mut memory)
            };
            let difference = (side(1e-6) - side(-1e-6)) / 2e-6;
            assert!(
                (difference - gradient[d]).abs() < 1e-6 * difference.abs().max(1.0),
                "{difference} {gradient:?}"
            );
        }
    }
}
