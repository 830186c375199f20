//! Recognition of movements.

use crate::{Metric, MotionLibrary, Movement, Trajectory};
use motorium_algebra::Simd;

/// Result of recognising a movement.
#[derive(Clone, Debug, PartialEq)]
pub struct Recognised {
    /// Weights of the movement.
    pub weights: Vec<f64>,
    /// Relative residual `|f - U w| / |f|` that the eigenforces leave, in the metric of the library, 0 to 1.
    pub novelty: f64,
    /// Index of the movement of the library with the nearest weights, and the distance relative to the norm
    /// of the weights.
    pub nearest: Option<(usize, f64)>,
}

/// A recogniser of movements by the first `n` eigenforces of a library. Methods other than [`new`](Self::new)
/// and [`recognise`](Self::recognise) do not allocate.
#[derive(Clone, Debug)]
pub struct Recogniser {
    simd: Simd,
    metric: Metric,
    spring: super::SampledSpring,
    /// rows x n
    analysis: Vec<f64>,
    rows: usize,
    eigenforces: usize,
    /// Weights of the library's movements, one movement after the other.
    known: Vec<f64>,
    weights: Vec<f64>,
    scratch: Vec<f64>,
}

impl Recogniser {
    /// Creates a recogniser that uses the first `eigenforces` eigenforces.
    pub fn new(library: &MotionLibrary, eigenforces: usize) -> Self {
        let eigenforces = eigenforces.clamp(1, library.rank());
        let rows = library.rows();
        Self {
            simd: Simd::new(),
            metric: library.metric(),
            spring: *library.spring(),
            analysis: library.analysis().as_slice()[..rows * eigenforces].to_vec(),
            rows,
            eigenforces,
            known: library.weights().rows(0, eigenforces).iter().copied().collect(),
            weights: vec![0.0; eigenforces],
            scratch: vec![0.0; rows],
        }
    }

    /// Returns the number of eigenforces used, which is the number of weights.
    pub fn eigenforces(&self) -> usize {
        self.eigenforces
    }

    /// Projects forces onto the eigenforces and returns the weights. The length of `forces` is the number of
    /// [`rows`](MotionLibrary::rows) of the library.
    ///
    /// # Panics
    /// If `forces` has a different length.
    pub fn project(&mut self, forces: &[f64]) -> &[f64] {
        assert_eq!(forces.len(), self.rows, "as many forces as the library has rows");
        self.simd.project(&self.analysis, forces, &mut self.weights);
        &self.weights
    }

    /// Projects forces and returns their novelty: the relative residual `|f - U w| / |f|` in the metric of
    /// the library.
    pub fn novelty(&mut self, forces: &[f64]) -> f64 {
        self.project(forces);
        let all = self.metric.norm(&self.spring, forces, &mut self.scratch);
        if all <= 0.0 {
            return 0.0;
        }
        // the basis is orthonormal, so the explained part has the norm of the weights
        let explained = self.weights.iter().map(|w| w * w).sum::<f64>().sqrt() / all;
        (1.0 - explained * explained).max(0.0).sqrt()
    }

    /// Returns the index of the movement whose weights are nearest to the last projection, and the distance
    /// between the weights; `None` for a library without movements.
    pub fn nearest(&self) -> Option<(usize, f64)> {
        let distance =
            |known: &[f64]| known.iter().zip(&self.weights).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        self.known
            .chunks_exact(self.eigenforces)
            .map(distance)
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(index, squared)| (index, squared.sqrt()))
    }

    /// Returns the weights of the last projection.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Projects a recording and returns its weights, its novelty and the nearest movement.
    pub fn recognise(&mut self, trajectory: &Trajectory) -> Recognised {
        let movement = Movement::from_trajectory(trajectory, &self.spring);
        let novelty = self.novelty(&movement.forces);
        let size = self.weights.iter().map(|w| w * w).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        let nearest = self.nearest().map(|(index, distance)| (index, distance / size));
        Recognised { weights: self.weights.clone(), novelty, nearest }
    }
}
