//! Recognition of a live stream: a movement is the motion between two rests.

use super::config::RecognitionConfig;
use super::messages::{MAX_WEIGHTS, Recognition};
use motorium_library::{MotionLibrary, Recogniser, SampledSpring};

/// Observes a stream of positions. All memory is allocated at construction.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    recogniser: Recogniser,
    spring: SampledSpring,
    dofs: usize,
    still: f64,
    period: f64,
    /// Number of samples that make a rest, and largest number of stored samples.
    pause: usize,
    capacity: usize,
    /// Samples, one after the other.
    samples: Vec<f64>,
    count: usize,
    /// Number of resting samples at the end, and whether anything moved before them.
    resting: usize,
    moved: bool,
    path: Vec<f64>,
    forces: Vec<f64>,
    seen: Recognition,
}

impl Watch {
    pub(super) fn new(library: &MotionLibrary, config: &RecognitionConfig, period: f64) -> Self {
        let (dofs, spring) = (library.layout().dofs(), *library.spring());
        let capacity = ((config.longest.as_secs_f64() / period).ceil() as usize).max(8);
        let recogniser = Recogniser::new(library, config.eigenforces.min(MAX_WEIGHTS));
        Self {
            recogniser,
            dofs,
            still: config.still,
            period,
            pause: ((config.pause.as_secs_f64() / period).ceil() as usize).clamp(4, capacity / 2),
            capacity,
            samples: vec![0.0; capacity * dofs],
            count: 0,
            resting: 0,
            moved: false,
            path: vec![0.0; spring.samples()],
            forces: vec![0.0; library.rows()],
            spring,
            seen: Recognition::default(),
        }
    }

    /// Discards all samples.
    pub(super) fn reset(&mut self) {
        (self.count, self.resting, self.moved) = (0, 0, false);
        self.seen = Recognition::default();
    }

    /// Adds one position. Returns `true` if a movement has just ended and was recognised.
    pub(super) fn observe(&mut self, position: impl Fn(usize) -> f64) -> bool {
        if self.count == self.capacity {
            // too long to be a movement of the library: wait for the next rest
            (self.count, self.resting, self.moved) = (0, 0, false);
        }
        for d in 0..self.dofs {
            self.samples[self.count * self.dofs + d] = position(d);
        }
        self.count += 1;
        // the speed over several samples: the noise of a single sample has little effect
        let lag = (self.pause / 2).min(self.count - 1);
        let (now, before) = (self.count - 1, self.count - 1 - lag);
        let squared: f64 = (0..self.dofs)
            .map(|d| self.samples[now * self.dofs + d] - self.samples[before * self.dofs + d])
            .map(|way| way * way)
            .sum();
        if squared.sqrt() <= self.still * lag as f64 * self.period {
            self.resting += 1;
        } else {
            if !self.moved {
                self.forget_rest(lag);
            }
            (self.resting, self.moved) = (0, true);
        }
        if self.resting < self.pause {
            return false;
        }
        let ended = self.moved && self.recognise();
        if ended || !self.moved {
            // a continuing rest: only its last samples are needed
            self.keep_last(self.pause);
        }
        self.moved = false;
        ended
    }

    /// Returns the last movement.
    pub(super) fn recognition(&self) -> &Recognition {
        &self.seen
    }

    /// Drops most of the rest when a movement begins.
    fn forget_rest(&mut self, lag: usize) {
        self.keep_last(lag + 1);
    }

    fn keep_last(&mut self, samples: usize) {
        let kept = samples.min(self.count);
        let from = (self.count - kept) * self.dofs;
        self.samples.copy_within(from..self.count * self.dofs, 0);
        (self.count, self.resting) = (kept, self.resting.min(kept));
    }

    fn recognise(&mut self) -> bool {
        let length = self.count - self.resting;
        if length < 8 {
            return false;
        }
        let (samples, steps) = (self.spring.samples(), self.spring.forces());
        for d in 0..self.dofs {
            for (k, y) in self.path.iter_mut().enumerate() {
                let at = k as f64 * (length - 1) as f64 / (samples - 1) as f64;
                let below = (at as usize).min(length - 2);
                let value = |k: usize| self.samples[k * self.dofs + d];
                *y = value(below) + (at - below as f64) * (value(below + 1) - value(below));
            }
            let velocity = (self.path[1] - self.path[0]) / self.spring.step();
            let forces = &mut self.forces[d * steps..(d + 1) * steps];
            self.spring.forces_of(&self.path, velocity, self.path[samples - 1], forces);
        }
        self.seen.novelty = self.recogniser.novelty(&self.forces);
        let weights = self.recogniser.weights();
        let size = weights.iter().map(|w| w * w).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        self.seen.count = weights.len() as u64;
        self.seen.weights[..weights.len()].copy_from_slice(weights);
        if let Some((index, distance)) = self.recogniser.nearest() {
            (self.seen.movement, self.seen.distance) = (index as u64, distance / size);
        }
        self.seen.sequence += 1;
        self.seen.duration = (length - 1) as f64 * self.period;
        true
    }
}
