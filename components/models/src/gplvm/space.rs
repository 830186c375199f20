//! One space of a latent model.

use serde::{Deserialize, Serialize};

use super::LatentError;
use crate::gp::{GpError, check_finite};
use crate::kernel::{Kernel, Stationary};

/// Training poses of one space.
#[derive(Clone, Debug, PartialEq)]
pub struct SpaceData<'a> {
    /// Name of the space, such as `human` or a robot's name.
    pub name: &'a str,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Values of the poses, row by row; each row is a pose.
    pub values: &'a [f64],
}

/// A space of a latent model: its poses and hyperparameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Space {
    /// Name of the space.
    pub name: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Mean of each column.
    pub mean: Vec<f64>,
    /// Scale of each column: its standard deviation, or 1 for a constant column. If the latent point is a
    /// pose, the scale is the square root of the mean variance of all columns.
    pub scale: Vec<f64>,
    /// Kernel of the Gaussian process from latent points to standardised poses.
    pub kernel: Stationary,
    /// Noise variance of the standardised poses.
    pub noise: f64,
    /// Standardised poses, column by column.
    pub(super) targets: Vec<f64>,
}

/// Column scaling of a space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scaling {
    /// Each column is divided by its standard deviation.
    Columns,
    /// All columns are divided by the square root of their mean variance, so that errors keep their relative
    /// weights.
    Common,
}

impl Space {
    pub(super) fn new(data: &SpaceData<'_>, latents: usize, scaling: Scaling) -> Result<Self, LatentError> {
        let wrong = |error| LatentError::Space { space: data.name.to_string(), error };
        let d = data.columns.len();
        if d == 0 || data.values.is_empty() || !data.values.len().is_multiple_of(d) {
            let expected = d.max(1) * (data.values.len() / d.max(1)).max(1);
            return Err(wrong(GpError::Shape { what: "values", found: data.values.len(), expected }));
        }
        check_finite("value", data.values).map_err(wrong)?;
        let n = data.values.len() / d;
        let (mut mean, mut deviations, mut targets) = (vec![], vec![], Vec::with_capacity(n * d));
        for column in 0..d {
            let values = || data.values.iter().skip(column).step_by(d);
            let m = values().sum::<f64>() / n as f64;
            let deviation = (values().map(|v| (v - m) * (v - m)).sum::<f64>() / n as f64).sqrt();
            let is_constant = deviation <= 1e-9 * m.abs().max(1e-3);
            mean.push(m);
            deviations.push(if is_constant { 0.0 } else { deviation });
        }
        if scaling == Scaling::Common {
            let common = (deviations.iter().map(|s| s * s).sum::<f64>() / d as f64).sqrt();
            deviations.fill(common);
        }
        let scale: Vec<f64> = deviations.into_iter().map(|s| if s > 0.0 { s } else { 1.0 }).collect();
        for (column, (m, s)) in mean.iter().zip(&scale).enumerate() {
            targets.extend(data.values.iter().skip(column).step_by(d).map(|v| (v - m) / s));
        }
        let kernel = Stationary::new(1.0, &vec![1.0; latents]);
        let (name, columns) = (data.name.to_string(), data.columns.clone());
        Ok(Self { name, columns, mean, scale, kernel, noise: 0.01, targets })
    }

    pub(super) fn at_first_poses(&self, poses: usize) -> Self {
        let columns = self.targets.chunks(self.poses());
        let targets = columns.flat_map(|column| &column[..poses]).copied().collect();
        Self { targets, ..self.clone() }
    }

    /// Returns the number of columns.
    pub fn dimensions(&self) -> usize {
        self.mean.len()
    }

    /// Returns the number of poses.
    pub fn poses(&self) -> usize {
        self.targets.len() / self.mean.len()
    }

    /// Returns the fraction of noise in the variance of the space's poses. Near 1, the poses do not depend on
    /// the latent point.
    pub fn noise_share(&self) -> f64 {
        self.noise / (self.noise + self.kernel.variance)
    }

    pub(super) fn rbf(&self) -> Kernel {
        Kernel::Rbf(self.kernel.clone())
    }

    /// Returns the logarithms of variance, length scales and noise.
    pub(super) fn parameters(&self) -> Vec<f64> {
        let mut found = self.rbf().parameters();
        found.push(self.noise.ln());
        found
    }

    pub(super) fn set_parameters(&mut self, logarithms: &[f64]) {
        let mut kernel = self.rbf();
        kernel.set_parameters(logarithms);
        if let Kernel::Rbf(found) = kernel {
            self.kernel = found;
        }
        self.noise = logarithms[self.kernel.lengths.len() + 1].exp();
    }

    pub(super) fn standardise(&self, pose: &[f64], out: &mut [f64]) {
        for (((out, y), mean), scale) in out.iter_mut().zip(pose).zip(&self.mean).zip(&self.scale) {
            *out = (y - mean) / scale;
        }
    }

    /// Returns the standardised poses, row by row.
    pub(super) fn rows(&self) -> Vec<f64> {
        let n = self.poses();
        (0..n).flat_map(|i| self.targets.chunks(n).map(move |column| column[i])).collect()
    }
}
