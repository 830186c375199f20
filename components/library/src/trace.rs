//! Traces of executed movements, and their deviations from the library's movements.

use crate::MotionLibrary;
use crate::generate::Superposition;

/// Largest number of samples of a [`Trace`].
const SAMPLES: usize = 1000;

/// Samples of an executed movement: the generated path and, if known, the measured path. Only construction
/// allocates.
#[derive(Clone, Debug)]
pub struct Trace {
    commanded: Vec<f64>,
    measured: Vec<f64>,
    dofs: usize,
    capacity: usize,
    every: usize,
    steps: usize,
}

/// Root mean square distances between the paths of a movement, in units of the library; `None` if a path is
/// unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceErrors {
    /// Distance between the generated path and the path with all eigenforces.
    pub generated: Option<f64>,
    /// Distance between the measured path and the generated path.
    pub tracking: Option<f64>,
    /// Distance between the measured path and the path with all eigenforces.
    pub path: Option<f64>,
}

impl Trace {
    /// Creates an empty trace of `dofs` degrees of freedom for a movement of `steps` steps. At most about
    /// 1000 samples are kept.
    pub fn new(dofs: usize, steps: usize) -> Self {
        let every = steps.div_ceil(SAMPLES).max(1);
        let capacity = (steps / every + 2) * dofs;
        let vector = || Vec::with_capacity(capacity);
        Self { commanded: vector(), measured: vector(), dofs, capacity, every, steps: 0 }
    }

    /// Removes all samples.
    pub fn clear(&mut self) {
        self.commanded.clear();
        self.measured.clear();
        self.steps = 0;
    }

    /// Adds the samples of a step, one number per degree of freedom. Ignored if the trace is full.
    pub fn add(&mut self, commanded: &[f64], measured: Option<&[f64]>) {
        let due = self.steps.is_multiple_of(self.every);
        self.steps += 1;
        if !due || self.commanded.len() + self.dofs > self.capacity {
            return;
        }
        self.commanded.extend_from_slice(commanded);
        if let Some(measured) = measured {
            self.measured.extend_from_slice(measured);
        }
    }

    /// Returns the distances between the recorded paths and the path that all eigenforces generate for
    /// movement `entry` of the library, at the same fractions of its duration.
    pub fn errors(&self, library: &MotionLibrary, entry: usize) -> TraceErrors {
        let count = self.commanded.len() / self.dofs.max(1);
        if count < 2 {
            return TraceErrors { generated: None, tracking: None, path: None };
        }
        let whole = Superposition::from_entry(library, entry, library.rank()).path(library);
        let known: Vec<f64> = (0..count)
            .flat_map(|k| {
                let at = k as f64 * (whole.nrows() - 1) as f64 / (count - 1) as f64;
                let below = (at as usize).min(whole.nrows() - 2);
                let part = at - below as f64;
                let whole = &whole;
                (0..self.dofs)
                    .map(move |d| whole[(below, d)] + part * (whole[(below + 1, d)] - whole[(below, d)]))
            })
            .collect();
        let distance = |a: &[f64], b: &[f64]| {
            let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
            (a.len() == b.len() && !a.is_empty()).then(|| (squares / count as f64).sqrt())
        };
        TraceErrors {
            generated: distance(&self.commanded, &known),
            tracking: distance(&self.measured, &self.commanded),
            path: distance(&self.measured, &known),
        }
    }

    /// Returns the points of the generated path in the first two degrees of freedom.
    pub fn commanded_points(&self) -> Vec<[f64; 2]> {
        self.points(&self.commanded)
    }

    /// Returns the points of the measured path in the first two degrees of freedom.
    pub fn measured_points(&self) -> Vec<[f64; 2]> {
        self.points(&self.measured)
    }

    fn points(&self, samples: &[f64]) -> Vec<[f64; 2]> {
        samples.chunks_exact(self.dofs.max(1)).map(|s| [s[0], s.get(1).copied().unwrap_or(0.0)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{Variation, letters};
    use crate::{DAMPING, Metric, SampledSpring, Truncation};

    #[test]
    fn shifted_path_deviates_by_the_shift() {
        let spring = SampledSpring::new(60, DAMPING).unwrap();
        let letters = letters(1, Variation::default(), 1);
        let library = MotionLibrary::build(&letters, spring, Metric::Position, Truncation::All).unwrap();
        let path = Superposition::from_entry(&library, 2, library.rank()).path(&library);
        let mut trace = Trace::new(2, 60);
        assert_eq!(trace.errors(&library, 2).generated, None);
        for row in path.row_iter() {
            trace.add(&[row[0], row[1]], Some(&[row[0] + 0.3, row[1] - 0.4]));
        }
        let errors = trace.errors(&library, 2);
        assert!(errors.generated.unwrap() < 1e-12, "{errors:?}");
        assert!((errors.tracking.unwrap() - 0.5).abs() < 1e-12 && (errors.path.unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(trace.commanded_points()[59], [path[(59, 0)], path[(59, 1)]]);
        trace.clear();
        assert!(trace.measured_points().is_empty());
    }

    #[test]
    fn long_movement_is_decimated_evenly() {
        let mut trace = Trace::new(1, 5000);
        let memory = trace.commanded.capacity();
        (0..20_000).for_each(|k| trace.add(&[f64::from(k)], None));
        assert_eq!(trace.commanded.capacity(), memory);
        assert_eq!(trace.commanded[..3], [0.0, 5.0, 10.0]);
        assert!(trace.measured.is_empty());
    }
}
