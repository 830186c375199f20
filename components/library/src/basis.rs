//! Bases for the forces of movements, which are compared with each other.

use nalgebra::{DMatrix, DVector};

use crate::{Layout, Metric, MotionLibrary, SampledSpring, Truncation};

/// Basis functions of forces, and the analysis matrix that yields their weights: `w = analysis^T f`, `f =
/// functions w`.
#[derive(Clone, Debug)]
pub struct Basis {
    functions: DMatrix<f64>,
    analysis: DMatrix<f64>,
}

impl Basis {
    /// Returns the first `n` eigenforces of a library as a basis.
    pub fn eigenforces(library: &MotionLibrary, n: usize) -> Self {
        let n = n.clamp(1, library.rank());
        let first = |matrix: &DMatrix<f64>| matrix.columns(0, n).into_owned();
        Self { functions: first(library.eigenforces()), analysis: first(library.analysis()) }
    }

    /// Returns a basis of the eigenforces of each DoF separately, `n / dofs` per DoF. The library must not be
    /// truncated.
    pub fn eigenforces_of_each(library: &MotionLibrary, n: usize) -> Self {
        let layout = library.layout();
        let blocks = (0..layout.dofs()).map(|dof| {
            let part = super::Part { name: layout.names()[dof].clone(), dofs: vec![dof] };
            let Ok(alone) = library.split(&part) else {
                // A DoF at rest has no eigenforces; a constant force represents it.
                let steps = library.spring().forces();
                return DMatrix::from_element(steps, 1, (steps as f64).sqrt().recip());
            };
            alone.parts().basis.columns(0, (n / layout.dofs()).clamp(1, alone.rank())).into_owned()
        });
        Self::orthonormal(block_diagonal(&blocks.collect::<Vec<_>>()))
    }

    /// Returns a Fourier basis of `n / dofs` functions per DoF: the constant, then cosines and sines with 1,
    /// 2, 3 ... periods in the duration, orthonormalised on the samples.
    pub fn fourier(layout: &Layout, spring: &SampledSpring, n: usize) -> Self {
        let steps = spring.forces();
        let each = (n / layout.dofs()).clamp(1, steps);
        let columns = DMatrix::from_fn(steps, each, |k, i| {
            let turn = std::f64::consts::TAU * i.div_ceil(2) as f64 * k as f64 / steps as f64;
            if i % 2 == 1 {
                turn.cos()
            } else if i == 0 {
                1.0
            } else {
                turn.sin()
            }
        });
        Self::orthonormal(block_diagonal(&vec![columns.qr().q(); layout.dofs()]))
    }

    /// Returns a basis of the normalised radial kernels of a movement primitive, `s psi_i(s) / sum_j
    /// psi_j(s)`, with `n / dofs` kernels per DoF. Centres are evenly spaced in time, each kernel has the
    /// value 0.8 at the centre of its successor, and `s` falls to 1 %. Weights are fitted by least squares.
    pub fn kernels(layout: &Layout, spring: &SampledSpring, n: usize) -> Self {
        let columns = kernel_functions(spring, (n / layout.dofs()).clamp(1, spring.forces()));
        Self::orthonormal(block_diagonal(&vec![columns.qr().q(); layout.dofs()]))
    }

    fn orthonormal(functions: DMatrix<f64>) -> Self {
        Self { analysis: functions.clone(), functions }
    }

    /// Returns the number of basis functions, which is the number of weights.
    pub fn size(&self) -> usize {
        self.functions.ncols()
    }

    /// Returns the basis functions, one per column.
    pub fn functions(&self) -> &DMatrix<f64> {
        &self.functions
    }

    /// Returns the weights of forces, with one movement per column.
    pub fn weights(&self, forces: &DMatrix<f64>) -> DMatrix<f64> {
        self.analysis.transpose() * forces
    }

    /// Returns the approximation of forces by the basis, with one movement per column.
    pub fn approximate(&self, forces: &DMatrix<f64>) -> DMatrix<f64> {
        &self.functions * self.weights(forces)
    }
}

/// Returns the normalised kernels of a discrete movement primitive over the steps of a spring, one per
/// column: `s psi_i / sum psi_j`. Centres are evenly spaced in time, each kernel has the value 0.8 at the
/// centre of its successor, and `s` falls to 1 %.
pub fn kernel_functions(spring: &SampledSpring, count: usize) -> DMatrix<f64> {
    let decay = -(0.01_f64.ln());
    let phase = |progress: f64| (-decay * progress).exp();
    let centre = |i: usize| phase(i as f64 / (count.max(2) - 1) as f64);
    let widths: Vec<f64> = (0..count)
        .map(|i| {
            let i = i.min(count.saturating_sub(2));
            -(0.8_f64.ln()) / (centre(i + 1) - centre(i)).powi(2)
        })
        .collect();
    let mut functions = DMatrix::zeros(spring.forces(), count);
    for k in 0..spring.forces() {
        let s = phase(k as f64 * spring.step());
        let psi: Vec<f64> = (0..count).map(|i| (-widths[i] * (s - centre(i)).powi(2)).exp()).collect();
        let total: f64 = psi.iter().sum();
        for (i, psi) in psi.iter().enumerate() {
            functions[(k, i)] = s * psi / total.max(f64::MIN_POSITIVE);
        }
    }
    functions
}

fn block_diagonal(blocks: &[DMatrix<f64>]) -> DMatrix<f64> {
    let rows = blocks.iter().map(DMatrix::nrows).sum();
    let columns = blocks.iter().map(DMatrix::ncols).sum();
    let mut all = DMatrix::zeros(rows, columns);
    let (mut row, mut column) = (0, 0);
    for block in blocks {
        all.view_mut((row, column), block.shape()).copy_from(block);
        (row, column) = (row + block.nrows(), column + block.ncols());
    }
    all
}

impl MotionLibrary {
    /// Returns a library of the same movements in another metric, computed from the weights. This library
    /// must not be truncated.
    ///
    /// # Errors
    /// [`BuildError`](super::BuildError) if all movements are at rest.
    pub fn in_metric(&self, metric: Metric, truncation: Truncation) -> Result<Self, super::BuildError> {
        let forces = self.eigenforces() * self.weights();
        let kind = (self.layout().clone(), *self.spring());
        Self::from_forces(forces, self.entries().to_vec(), kind, metric, truncation)
    }
}

/// Returns the relative error of a least-squares approximation of forces by `count` radial kernels per degree
/// of freedom. `forces` contains the degrees of freedom one after the other.
pub fn kernel_error(forces: &[f64], spring: &SampledSpring, count: usize) -> f64 {
    let steps = spring.forces();
    let q = kernel_functions(spring, count.min(steps)).qr().q();
    let (mut left, mut all) = (0.0, 0.0);
    for forces in forces.chunks_exact(steps) {
        let forces = DVector::from_column_slice(forces);
        left += (&forces - &q * (q.transpose() * &forces)).norm_squared();
        all += forces.norm_squared();
    }
    (left / all.max(f64::MIN_POSITIVE)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_reproduce_their_sums_but_not_a_spike() {
        let spring = SampledSpring::new(80, crate::DAMPING).unwrap();
        let kernels = kernel_functions(&spring, 12);
        let sum = kernels.column(1) * 2.0 - kernels.column(7) * 0.5;
        let both: Vec<f64> = sum.iter().chain(kernels.column(3).iter()).copied().collect();
        assert!(kernel_error(&both, &spring, 12) < 1e-10);
        let mut spike = vec![0.0; spring.forces()];
        spike[40] = 1.0;
        assert!(kernel_error(&spike, &spring, 12) > 0.5);
    }
}
