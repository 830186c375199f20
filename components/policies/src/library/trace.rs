//! How far what was drawn is from what should have been.

use motorium_library::MotionLibrary;

use super::episode::Planned;

/// One movement: samples of where it should have been by the library, and where it was.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    /// Degrees of freedom as generated, one sample after the other, in units of the library.
    pub(super) commanded: Vec<f64>,
    /// As measured, likewise; as long, or empty.
    pub(super) measured: Vec<f64>,
    dofs: usize,
    capacity: usize,
    every: usize,
    steps: usize,
}

impl Trace {
    /// For a movement of so many steps.
    pub(super) fn new(dofs: usize, steps: usize) -> Self {
        const SAMPLES: usize = 1000;
        let every = steps.div_ceil(SAMPLES).max(1);
        let capacity = (steps / every + 2) * dofs;
        let vector = || Vec::with_capacity(capacity);
        Self { commanded: vector(), measured: vector(), dofs, capacity, every, steps: 0 }
    }

    pub(super) fn clear(&mut self) {
        self.commanded.clear();
        self.measured.clear();
        self.steps = 0;
    }

    /// Takes in a step, as long as there is room.
    pub(super) fn add(&mut self, commanded: &[f64], measured: Option<&[f64]>) {
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

    /// Root mean square distances, in units of the library: of the generated path from that by all eigenforces, of the
    /// measured from the generated, and of the measured from that by all.
    pub(super) fn errors(&self, library: &MotionLibrary, planned: &Planned) -> [Option<f64>; 3] {
        let whole = motorium_library::Superposition::of(library, planned.entry, library.rank()).path(library);
        let count = self.commanded.len() / self.dofs.max(1);
        if count < 2 {
            return [None; 3];
        }
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
        [
            distance(&self.commanded, &known),
            distance(&self.measured, &self.commanded),
            distance(&self.measured, &known),
        ]
    }

    /// Samples, each a point of the first two degrees of freedom.
    pub(super) fn points(samples: &[f64], dofs: usize) -> Vec<[f64; 2]> {
        samples.chunks_exact(dofs.max(1)).map(|s| [s[0], s.get(1).copied().unwrap_or(0.0)]).collect()
    }
}
