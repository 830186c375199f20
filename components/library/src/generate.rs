//! Generation of movements from weights: as a whole path, or step by step in a control loop.

use crate::{Frame, MotionLibrary, SampledSpring};
use motorium_algebra::Simd;

/// Weights and a frame that together define a movement to generate.
#[derive(Clone, Debug, PartialEq)]
pub struct Superposition {
    /// Weights of the first eigenforces.
    pub weights: Vec<f64>,
    /// Start, goal, initial velocity and duration.
    pub frame: Frame,
}

impl Superposition {
    /// Returns a movement of the library, reconstructed from its first `eigenforces` eigenforces.
    pub fn from_entry(library: &MotionLibrary, entry: usize, eigenforces: usize) -> Self {
        let eigenforces = eigenforces.clamp(1, library.rank());
        let weights = library.weights().column(entry).rows(0, eigenforces).iter().copied().collect();
        Self { weights, frame: library.entries()[entry].frame.clone() }
    }

    /// Returns the mean of the movements with a label, reconstructed from the first `eigenforces`
    /// eigenforces; `None` if no movement has this label.
    pub fn mean_of(library: &MotionLibrary, label: &str, eigenforces: usize) -> Option<Self> {
        let members: Vec<usize> = (0..library.entries().len())
            .filter(|k| library.entries()[*k].label.as_deref() == Some(label))
            .collect();
        let (&first, rest) = members.split_first()?;
        let mut mean = Self::from_entry(library, first, eigenforces);
        for (count, &k) in rest.iter().enumerate() {
            mean = mean.blend(&Self::from_entry(library, k, eigenforces), 1.0 / (count + 2) as f64);
        }
        Some(mean)
    }

    /// Returns the interpolation `self + part * (other - self)`. Weights and frame are interpolated alike,
    /// since the path is linear in both.
    #[must_use]
    pub fn blend(&self, other: &Self, part: f64) -> Self {
        let n = self.weights.len().max(other.weights.len());
        let at = |weights: &[f64], k: usize| weights.get(k).copied().unwrap_or(0.0);
        let mix = |k| at(&self.weights, k) + part * (at(&other.weights, k) - at(&self.weights, k));
        Self { weights: (0..n).map(mix).collect(), frame: self.frame.towards(&other.frame, part) }
    }

    /// Returns the movement with a new start, goal and duration \[s\]; `None` keeps the current value. A new
    /// start translates the movement, including its goal, before a new goal is set.
    #[must_use]
    pub fn placed(mut self, start: Option<&[f64]>, goal: Option<&[f64]>, duration: Option<f64>) -> Self {
        if let Some(start) = start {
            for (d, start) in start.iter().enumerate() {
                self.frame.goal[d] += start - self.frame.start[d];
                self.frame.start[d] = *start;
            }
        }
        if let Some(goal) = goal {
            self.frame.goal.copy_from_slice(goal);
        }
        self.frame.duration = duration.unwrap_or(self.frame.duration);
        self
    }

    /// Returns the path, samples x DoFs.
    pub fn path(&self, library: &MotionLibrary) -> nalgebra::DMatrix<f64> {
        super::movement::path(&self.frame, &library.forces(&self.weights), library.spring())
    }
}

/// Error returned when a movement cannot be started. The current movement continues unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GenerateError {
    /// There are more weights than eigenforces.
    #[error("found {found} weights, expected at most {rank}, one per eigenforce")]
    Weights {
        /// Number of weights found.
        found: usize,
        /// Number of eigenforces of the library.
        rank: usize,
    },
    /// The number of DoFs differs.
    #[error("the frame has {found} degrees of freedom, expected {expected} as in the library")]
    Dofs {
        /// Number of DoFs in the frame.
        found: usize,
        /// Number of DoFs in the library.
        expected: usize,
    },
    /// A value is NaN or infinite.
    #[error("found {0}, expected a finite number")]
    NotFinite(f64),
    /// The duration is not positive.
    #[error("a duration of {0} s, expected a positive time")]
    Duration(f64),
}

/// A generator of movements of a library in a control loop. Starting, steering and stepping do not allocate.
///
/// The forces are superposed at the start, and the spring follows them to the end of the movement. The spring
/// then settles without forces for another quarter of the duration, while the remaining velocity decays.
/// Between samples the path is a cubic with continuous velocity.
#[derive(Clone, Debug)]
pub struct Generator {
    simd: Simd,
    spring: SampledSpring,
    eigenforces: Vec<f64>,
    rank: usize,
    forces: Vec<f64>,
    /// Samples including the settling phase, one DoF after the other.
    path: Vec<f64>,
    length: usize,
    duration: f64,
    time: f64,
    position: Vec<f64>,
    velocity: Vec<f64>,
}

impl Generator {
    /// Creates a generator for movements of a library.
    pub fn new(library: &MotionLibrary) -> Self {
        let (dofs, spring) = (library.layout().dofs(), *library.spring());
        let length = spring.samples() + spring.samples() / 4;
        Self {
            simd: Simd::new(),
            spring,
            eigenforces: library.eigenforces().as_slice().to_vec(),
            rank: library.rank(),
            forces: vec![0.0; library.rows()],
            path: vec![0.0; length * dofs],
            length,
            duration: 1.0,
            time: 0.0,
            position: vec![0.0; dofs],
            velocity: vec![0.0; dofs],
        }
    }

    /// Starts a movement from weights of the first eigenforces, with the boundary conditions `frame`.
    ///
    /// # Errors
    /// [`GenerateError`] if sizes do not match, or a value is not finite.
    pub fn start(&mut self, weights: &[f64], frame: &Frame) -> Result<(), GenerateError> {
        let dofs = self.position.len();
        if weights.len() > self.rank {
            return Err(GenerateError::Weights { found: weights.len(), rank: self.rank });
        }
        for values in [&frame.start, &frame.goal, &frame.velocity] {
            if values.len() != dofs {
                return Err(GenerateError::Dofs { found: values.len(), expected: dofs });
            }
            finite(values)?;
        }
        finite(weights)?;
        if !(frame.duration > 0.0 && frame.duration.is_finite()) {
            return Err(GenerateError::Duration(frame.duration));
        }
        self.forces.fill(0.0);
        let columns = &self.eigenforces[..weights.len() * self.forces.len()];
        self.simd.superpose(columns, weights, &mut self.forces);
        (self.duration, self.time) = (frame.duration, 0.0);
        for d in 0..dofs {
            self.follow(d, 0, [frame.start[d], frame.velocity[d], frame.goal[d]]);
        }
        self.read();
        Ok(())
    }

    /// Changes the goal from the next sample on; the forces stay unchanged.
    ///
    /// # Errors
    /// [`GenerateError`] if the number of DoFs differs, or a value is not finite.
    pub fn set_goal(&mut self, goal: &[f64]) -> Result<(), GenerateError> {
        if goal.len() != self.position.len() {
            return Err(GenerateError::Dofs { found: goal.len(), expected: self.position.len() });
        }
        finite(goal)?;
        let next = ((self.time / self.duration / self.spring.step()).ceil() as usize).max(1);
        if next + 1 < self.length {
            for (d, goal) in goal.iter().enumerate() {
                let path = &self.path[d * self.length..(d + 1) * self.length];
                let velocity = (path[next] - path[next - 1]) / self.spring.step();
                self.follow(d, next, [path[next], velocity, *goal]);
            }
        }
        Ok(())
    }

    /// Advances by `dt` seconds.
    pub fn step(&mut self, dt: f64) {
        self.time = (self.time + dt.max(0.0)).min(self.duration * self.settled());
        self.read();
    }

    /// Returns the position of each DoF.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the velocity of each DoF, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Returns the time since the start divided by the duration. The value is 1 at the end of the movement,
    /// when settling starts.
    pub fn progress(&self) -> f64 {
        self.time / self.duration
    }

    /// Returns `true` once the movement has settled.
    pub fn is_finished(&self) -> bool {
        self.progress() >= self.settled() - 1e-12
    }

    /// Returns the progress at the end of the settling phase.
    fn settled(&self) -> f64 {
        (self.length - 1) as f64 * self.spring.step()
    }

    fn follow(&mut self, dof: usize, from: usize, [start, velocity, goal]: [f64; 3]) {
        let each = self.spring.forces();
        let path = &mut self.path[dof * self.length..(dof + 1) * self.length];
        let forces = &self.forces[dof * each..(dof + 1) * each];
        let last = self.spring.samples() - 1;
        let mut state = [start, velocity];
        path[from] = start;
        for k in from + 1..path.len() {
            let force = if k <= last { forces[k - 1] } else { 0.0 };
            state = self.spring.advance(state, goal, force);
            path[k] = state[0];
        }
    }

    fn read(&mut self) {
        let at = self.progress() / self.spring.step();
        let k = (at as usize).min(self.length - 2);
        let (x, per_second) = (at - k as f64, 1.0 / (self.spring.step() * self.duration));
        for (d, path) in self.path.chunks_exact(self.length).enumerate() {
            let y = |k: usize| path[k.min(self.length - 1)];
            let slope = |k: usize| 0.5 * (y(k + 1) - if k == 0 { 2.0 * y(0) - y(1) } else { y(k - 1) });
            let (y0, y1, m0, m1) = (y(k), y(k + 1), slope(k), slope(k + 1));
            let (a, b) = (2.0 * (y0 - y1) + m0 + m1, 3.0 * (y1 - y0) - 2.0 * m0 - m1);
            self.position[d] = y0 + x * (m0 + x * (b + x * a));
            self.velocity[d] = (m0 + x * (2.0 * b + x * 3.0 * a)) * per_second;
        }
        if self.is_finished() {
            self.velocity.fill(0.0);
        }
    }
}

fn finite(values: &[f64]) -> Result<(), GenerateError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(GenerateError::NotFinite(*value)),
        None => Ok(()),
    }
}
