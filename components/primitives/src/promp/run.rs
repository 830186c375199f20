//! Execution of the mean of a probabilistic primitive.

use super::error::ProMpError;
use super::model::ProMp;
use crate::mean::{MeanMovement, MeanRunner};

/// A [`ProMp`] with scratch memory for evaluating its mean.
#[derive(Clone, Debug)]
pub struct ProMpMean {
    promp: ProMp,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl From<ProMp> for ProMpMean {
    fn from(promp: ProMp) -> Self {
        let zeros = vec![0.0; promp.basis().count()];
        Self { values: zeros.clone(), slopes: zeros, promp }
    }
}

impl MeanMovement for ProMpMean {
    fn dimensions(&self) -> usize {
        self.promp.dimensions()
    }

    fn duration(&self) -> f64 {
        self.promp.duration()
    }

    fn mean_into(&mut self, phase: f64, position: &mut [f64], slope: &mut [f64]) {
        self.promp.basis.evaluate(phase, &mut self.values, &mut self.slopes);
        for (d, weights) in self.promp.mean.as_slice().chunks_exact(self.values.len()).enumerate() {
            let inner = |functions: &[f64]| weights.iter().zip(functions).map(|(w, f)| w * f).sum::<f64>();
            (position[d], slope[d]) = (inner(&self.values), inner(&self.slopes));
        }
    }
}

/// A follower of the mean of a probabilistic primitive: `ProMpRunner::new(promp.into())`.
pub type ProMpRunner = MeanRunner<ProMpMean>;

impl MeanRunner<ProMpMean> {
    /// Returns the primitive.
    pub fn promp(&self) -> &ProMp {
        &self.movement().promp
    }

    /// Replaces the primitive by `promp`, which must have the same number of dimensions, from the next start
    /// on. Does not allocate if the bases have equal size.
    ///
    /// # Errors
    /// [`ProMpError`] if the number of dimensions differs.
    pub fn exchange(&mut self, promp: ProMp) -> Result<(), ProMpError> {
        if promp.dimensions() != self.position().len() {
            return Err(ProMpError::Different);
        }
        let mean = self.movement_mut();
        mean.values.resize(promp.basis().count(), 0.0);
        mean.slopes.resize(promp.basis().count(), 0.0);
        mean.promp = promp;
        Ok(())
    }
}
