//! Back constraints: the latent point as a function of a pose.

use motorium_algebra::{Cholesky, Simd, Wanted, left_singular};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::space::Scaling;

/// Functional form of a back constraint, which maps a pose to its latent point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BackForm {
    /// The standardised pose: each column is one latent dimension. If there are fewer latent dimensions than
    /// columns, the latent dimensions are the leading principal components, scaled to unit standard
    /// deviation. Training fits hyperparameters only.
    Pose,
    /// Kernel regression with `exp(-gamma |y - y'|^2)`, `gamma = 0.2 / median |y - y'|^2`.
    Kernel,
    /// A network with one hidden layer of 10 tanh units.
    Mlp,
}

impl BackForm {
    /// Returns the column scaling of a model whose latent point is this function of a pose.
    pub(super) fn scaling(self) -> Scaling {
        if self == Self::Pose { Scaling::Common } else { Scaling::Columns }
    }
}

/// Number of hidden units of a network.
const HIDDEN: usize = 10;

/// A back constraint of one space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Back {
    pub(super) space: usize,
    pub(super) form: BackForm,
    /// Standardised training poses, row by row; kernel only.
    rows: Vec<f64>,
    gamma: f64,
    inputs: usize,
    latents: usize,
    /// Kernel: `N` weights for each latent dimension. Network: `HIDDEN` rows of weights and bias, then `q`
    /// rows. Pose: `q` rows of a projection.
    pub(super) weights: Vec<f64>,
}

/// Values computed once for all training poses.
pub(super) struct Prepared {
    /// Kernel: the `N x N` matrix. Network and pose: the poses, row by row.
    matrix: Vec<f64>,
}

/// Returns the identity, or the projection of poses (row by row) to their leading principal components of
/// unit standard deviation.
fn projection(rows: &[f64], inputs: usize, latents: usize) -> Vec<f64> {
    let n = rows.len() / inputs;
    let mut made = vec![0.0; latents * inputs];
    if latents == inputs {
        made.iter_mut().step_by(inputs + 1).for_each(|one| *one = 1.0);
        return made;
    }
    // the left singular vectors of the transpose are the principal directions
    let found = left_singular(&DMatrix::from_column_slice(inputs, n, rows), Wanted::Rank(latents));
    for (direction, out) in found.vectors.column_iter().zip(made.chunks_exact_mut(inputs)) {
        let along = |row: &[f64]| row.iter().zip(direction.iter()).map(|(y, d)| y * d).sum::<f64>();
        let variance = rows.chunks_exact(inputs).map(|row| along(row).powi(2)).sum::<f64>() / n as f64;
        // the sign of a direction is arbitrary: its largest entry is positive
        let largest = direction.iter().fold(0.0_f64, |most, v| if v.abs() > most.abs() { *v } else { most });
        let scale = (1.0 / variance.max(1e-12).sqrt()).copysign(largest);
        out.iter_mut().zip(direction.iter()).for_each(|(out, d)| *out = scale * d);
    }
    made
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

impl Back {
    /// Creates a back constraint that approximately reproduces `latent` (dimension by dimension).
    pub(super) fn new(
        space: usize,
        form: BackForm,
        rows: Vec<f64>,
        inputs: usize,
        latent: &[f64],
    ) -> (Self, Prepared) {
        let n = rows.len() / inputs;
        let latents = latent.len() / n;
        let mut made = Self { space, form, rows: vec![], gamma: 0.0, inputs, latents, weights: vec![] };
        match form {
            BackForm::Pose => {
                made.weights = projection(&rows, inputs, latents);
                (made, Prepared { matrix: rows })
            }
            BackForm::Kernel => {
                let mut distances: Vec<f64> = (0..n)
                    .flat_map(|a| (0..a).map(move |b| (a, b)))
                    .map(|(a, b)| squared(&rows[a * inputs..][..inputs], &rows[b * inputs..][..inputs]))
                    .collect();
                distances.sort_by(f64::total_cmp);
                let median = distances.get(distances.len() / 2).copied().filter(|d| *d > 0.0).unwrap_or(1.0);
                made.gamma = 0.2 / median;
                let matrix: Vec<f64> = (0..n * n)
                    .map(|i| {
                        let (a, b) = (&rows[i / n * inputs..][..inputs], &rows[i % n * inputs..][..inputs]);
                        (-made.gamma * squared(a, b)).exp()
                    })
                    .collect();
                // ridge regression; the matrix plus 1e-3 is positive definite
                let mut factor = Cholesky::with_capacity(n);
                made.weights = latent.to_vec();
                let fill = |i: usize, out: &mut [f64]| {
                    out.copy_from_slice(&matrix[i * n + i..(i + 1) * n]);
                    out[0] += 1e-3;
                };
                factor.factorise(n, fill).expect("a kernel matrix with a ridge is positive definite");
                made.weights.chunks_exact_mut(n).for_each(|column| factor.solve(column));
                made.rows = rows;
                (made, Prepared { matrix })
            }
            BackForm::Mlp => {
                // fixed weights in [-1, 1] / sqrt(inputs), from the fractional parts of multiples of the
                // golden ratio
                let scale = 1.0 / (inputs as f64).sqrt();
                let draw = |i: usize| 2.0 * ((i + 1) as f64 * 0.618_033_988_749_894_9).fract() - 1.0;
                let first = HIDDEN * (inputs + 1);
                made.weights = (0..first).map(|i| scale * draw(i)).collect();
                made.weights.resize(first + latents * (HIDDEN + 1), 0.0);
                made.fit_output(&rows, latent);
                (made, Prepared { matrix: rows })
            }
        }
    }

    /// Fits the output layer by ridge regression.
    fn fit_output(&mut self, rows: &[f64], latent: &[f64]) {
        let size = HIDDEN + 1;
        let n = rows.len() / self.inputs;
        let mut features = vec![1.0; n * size];
        for (row, out) in rows.chunks_exact(self.inputs).zip(features.chunks_exact_mut(size)) {
            self.hidden(row, &mut out[..HIDDEN]);
        }
        let mut gram = vec![0.0; size * size];
        for row in features.chunks_exact(size) {
            for (a, out) in row.iter().zip(gram.chunks_exact_mut(size)) {
                out.iter_mut().zip(row).for_each(|(out, b)| *out += a * b);
            }
        }
        let mut factor = Cholesky::with_capacity(size);
        let fill = |i: usize, out: &mut [f64]| {
            out.copy_from_slice(&gram[i * size + i..(i + 1) * size]);
            out[0] += 1e-3;
        };
        factor.factorise(size, fill).expect("a Gram matrix with a ridge is positive definite");
        let first = HIDDEN * (self.inputs + 1);
        for (column, out) in latent.chunks_exact(n).zip(self.weights[first..].chunks_exact_mut(size)) {
            out.fill(0.0);
            for (row, x) in features.chunks_exact(size).zip(column) {
                out.iter_mut().zip(row).for_each(|(out, value)| *out += x * value);
            }
            factor.solve(out);
        }
    }

    fn hidden(&self, row: &[f64], out: &mut [f64]) {
        for (weights, out) in self.weights.chunks_exact(self.inputs + 1).zip(out) {
            let sum: f64 = weights.iter().zip(row).map(|(w, y)| w * y).sum();
            *out = (sum + weights[self.inputs]).tanh();
        }
    }

    /// Returns the number of trainable weights.
    pub(super) fn variables(&self) -> usize {
        if self.form == BackForm::Pose { 0 } else { self.weights.len() }
    }

    /// Writes the latent points of all training poses, dimension by dimension.
    pub(super) fn latent(&self, prepared: &Prepared, out: &mut [f64]) {
        match self.form {
            BackForm::Kernel => {
                let n = self.weights.len() / self.latents;
                for (weights, out) in self.weights.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
                    Simd::new().project(&prepared.matrix, weights, out);
                }
            }
            BackForm::Pose | BackForm::Mlp => {
                let n = prepared.matrix.len() / self.inputs;
                let mut x = vec![0.0; self.latents];
                for (i, row) in prepared.matrix.chunks_exact(self.inputs).enumerate() {
                    self.map(row, &mut x);
                    x.iter().enumerate().for_each(|(d, x)| out[d * n + i] = *x);
                }
            }
        }
    }

    /// Writes the gradient with respect to the weights, computed from the gradient with respect to the latent
    /// points.
    pub(super) fn gradient(&self, prepared: &Prepared, by_latent: &[f64], out: &mut [f64]) {
        if self.variables() == 0 {
            return;
        }
        if self.form == BackForm::Kernel {
            let n = self.weights.len() / self.latents;
            for (gradient, out) in by_latent.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
                Simd::new().project(&prepared.matrix, gradient, out);
            }
            return;
        }
        out.fill(0.0);
        let (size, first) = (HIDDEN + 1, HIDDEN * (self.inputs + 1));
        let n = prepared.matrix.len() / self.inputs;
        let mut hidden = [0.0; HIDDEN];
        for (i, row) in prepared.matrix.chunks_exact(self.inputs).enumerate() {
            self.hidden(row, &mut hidden);
            let mut back = [0.0; HIDDEN];
            for d in 0..self.latents {
                let slope = by_latent[d * n + i];
                let weights = &self.weights[first + d * size..][..size];
                let out = &mut out[first + d * size..][..size];
                for h in 0..HIDDEN {
                    out[h] += slope * hidden[h];
                    back[h] += slope * weights[h];
                }
                out[HIDDEN] += slope;
            }
            for (h, out) in out[..first].chunks_exact_mut(self.inputs + 1).enumerate() {
                let slope = back[h] * (1.0 - hidden[h] * hidden[h]);
                out.iter_mut().zip(row).for_each(|(out, y)| *out += slope * y);
                out[self.inputs] += slope;
            }
        }
    }

    /// Writes the latent point of a standardised pose. Does not allocate.
    pub(super) fn map(&self, pose: &[f64], x: &mut [f64]) {
        match self.form {
            BackForm::Pose => Simd::new().project(&self.weights, pose, x),
            BackForm::Kernel => {
                let n = self.rows.len() / self.inputs;
                x.fill(0.0);
                for (i, row) in self.rows.chunks_exact(self.inputs).enumerate() {
                    let value = (-self.gamma * squared(row, pose)).exp();
                    x.iter_mut().enumerate().for_each(|(d, x)| *x += value * self.weights[d * n + i]);
                }
            }
            BackForm::Mlp => {
                let mut hidden = [0.0; HIDDEN];
                self.hidden(pose, &mut hidden);
                let rows = self.weights[HIDDEN * (self.inputs + 1)..].chunks_exact(HIDDEN + 1);
                for (x, row) in x.iter_mut().zip(rows) {
                    *x = row[HIDDEN] + row.iter().zip(&hidden).map(|(w, h)| w * h).sum::<f64>();
                }
            }
        }
    }

    /// Returns `true` if the numbers of weights read from a file are consistent.
    pub(super) fn is_valid(&self, spaces: &[super::Space], latents: usize, points: usize) -> bool {
        let Some(space) = spaces.get(self.space) else { return false };
        let (weights, rows) = match self.form {
            BackForm::Pose => (latents * self.inputs, 0),
            BackForm::Kernel => (points * latents, points * self.inputs),
            BackForm::Mlp => (HIDDEN * (self.inputs + 1) + latents * (HIDDEN + 1), 0),
        };
        self.inputs == space.dimensions()
            && self.latents == latents
            && self.weights.len() == weights
            && self.rows.len() == rows
            && self.gamma.is_finite()
            && self.weights.iter().chain(&self.rows).all(|value| value.is_finite())
    }
}
