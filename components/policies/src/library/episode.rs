//! The sequence of movements of a policy.

use motorium_library::{Frame, Generator, MotionLibrary, Superposition};

/// A planned movement with its reference.
#[derive(Clone, Debug)]
pub(super) struct Planned {
    pub(super) entry: usize,
    pub(super) name: String,
    pub(super) eigenforces: usize,
    pub(super) movement: Superposition,
}

/// Plans the configured movements.
pub(super) fn plan(
    library: &MotionLibrary,
    movements: &[(usize, String)],
    eigenforces: &[usize],
    duration: Option<f64>,
) -> Vec<Planned> {
    let all = [library.rank()];
    let eigenforces = if eigenforces.is_empty() { &all[..] } else { eigenforces };
    let mut planned = Vec::new();
    for (entry, name) in movements {
        for &eigenforces in eigenforces {
            let movement =
                Superposition::from_entry(library, *entry, eigenforces).placed(None, None, duration);
            planned.push(Planned { entry: *entry, name: name.clone(), eigenforces, movement });
        }
    }
    planned
}

/// State of a policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stage {
    /// Waiting for a state to start from.
    Waiting,
    /// Moving to the start of a movement: seconds since the start of the transit.
    Transit(f64),
    /// At rest before or after a movement.
    Rest {
        /// `true` after a movement, `false` before it.
        after: bool,
        /// Seconds since it came to rest.
        time: f64,
    },
    /// Executing a movement.
    Moving,
    /// At the end of the last movement, permanently.
    Finished,
}

/// Weights and frame of the current movement, in memory that is never reallocated.
#[derive(Clone, Debug)]
pub(super) struct Current {
    pub(super) weights: Vec<f64>,
    pub(super) count: usize,
    pub(super) frame: Frame,
}

impl Current {
    pub(super) fn new(library: &MotionLibrary, first: &Planned) -> Self {
        let mut current =
            Self { weights: vec![0.0; library.rank()], count: 0, frame: first.movement.frame.clone() };
        current.set(&first.movement.weights);
        current
    }

    pub(super) fn set(&mut self, weights: &[f64]) {
        self.count = weights.len().min(self.weights.len());
        self.weights[..self.count].copy_from_slice(&weights[..self.count]);
    }

    pub(super) fn set_frame(&mut self, frame: &Frame) {
        self.frame.start.copy_from_slice(&frame.start);
        self.frame.goal.copy_from_slice(&frame.goal);
        self.frame.velocity.copy_from_slice(&frame.velocity);
        self.frame.duration = frame.duration;
    }

    pub(super) fn start(&self, generator: &mut Generator) -> Result<(), motorium_library::GenerateError> {
        generator.start(&self.weights[..self.count], &self.frame)
    }
}

/// Returns a minimum-jerk transition from 0 to 1, without a discontinuity in acceleration, and its slope.
pub(super) fn ease(part: f64) -> [f64; 2] {
    let p = part.clamp(0.0, 1.0);
    [p * p * p * (10.0 + p * (6.0 * p - 15.0)), 30.0 * p * p * (1.0 - p) * (1.0 - p)]
}
