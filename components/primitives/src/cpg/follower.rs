//! Commands of an oscillator network, followed smoothly.

use super::lags::wrapped;
use super::{CpgError, finite, size};
use crate::ValueError;
use crate::dmp::Stride;

/// A value that follows its target like a critically damped spring.
#[derive(Clone, Copy, Debug)]
pub(super) struct Follower {
    /// The value and its rate.
    pub(super) state: (f64, f64),
    pub(super) target: f64,
}

impl Follower {
    pub(super) fn resting_at(value: f64) -> Self {
        Self { state: (value, 0.0), target: value }
    }

    pub(super) fn step(&mut self, stride: &Stride) {
        self.state = stride.advance(self.state, self.target, self.target);
    }

    pub(super) fn settle(&mut self) {
        self.state = (self.target, 0.0);
    }
}

/// The commanded frequency, amplitudes, offsets and pattern phases of a network, and the values that follow
/// them.
#[derive(Clone, Debug)]
pub(super) struct Commands {
    /// Frequency, Hz.
    pub(super) frequency: Follower,
    /// Amplitudes of the outputs.
    pub(super) amplitude: Vec<Follower>,
    /// Offsets of the outputs.
    pub(super) offset: Vec<Follower>,
    /// Phases of the oscillators in the pattern, rad.
    pub(super) theta: Vec<Follower>,
}

impl Commands {
    /// Creates commands for outputs (amplitude and offset) and for oscillators at given phases of the pattern
    /// (rad). Amplitudes start at 0, all other values at their targets.
    pub(super) fn new(
        frequency: f64,
        outputs: impl Iterator<Item = (f64, f64)>,
        theta: impl Iterator<Item = f64>,
    ) -> Self {
        let (amplitude, offset) = outputs
            .map(|(amplitude, offset)| {
                (Follower { state: (0.0, 0.0), target: amplitude }, Follower::resting_at(offset))
            })
            .unzip();
        Self {
            frequency: Follower::resting_at(frequency),
            amplitude,
            offset,
            theta: theta.map(Follower::resting_at).collect(),
        }
    }

    /// Commands amplitude and offset of one output; `name` names the network in errors.
    pub(super) fn set_amplitude_offset(
        &mut self,
        name: &'static str,
        output: usize,
        [amplitude, offset]: [f64; 2],
    ) -> Result<(), CpgError> {
        finite("amplitude and offset", &[amplitude, offset])?;
        let found = self.amplitude.len();
        if output >= found {
            return Err(CpgError::Value(ValueError::Size { name, found, expected: output + 1 }));
        }
        self.amplitude[output].target = amplitude;
        self.offset[output].target = offset;
        Ok(())
    }

    /// Commands the phase of every oscillator in the pattern, rad. Each phase turns the shorter way round.
    pub(super) fn set_pattern(&mut self, phases: impl Iterator<Item = f64>) {
        for (theta, phase) in self.theta.iter_mut().zip(phases) {
            theta.target = theta.state.0 + wrapped(phase - theta.state.0);
        }
    }

    /// Sets all values to their targets immediately.
    pub(super) fn settle(&mut self) {
        let all = self.amplitude.iter_mut().chain(&mut self.offset).chain(&mut self.theta);
        all.chain([&mut self.frequency]).for_each(Follower::settle);
    }

    /// Largest deviation of a phase difference from the pattern, relative to the first oscillator, rad.
    pub(super) fn pattern_error(&self, phases: &[f64]) -> f64 {
        let deviation = |i: usize| phases[i] - self.theta[i].state.0;
        (1..phases.len()).map(|i| wrapped(deviation(i) - deviation(0)).abs()).fold(0.0, f64::max)
    }

    /// Returns an output `o + a value` and its rate per second, given the oscillator's value in \[-1, 1\] and
    /// that value's rate.
    pub(super) fn output(&self, output: usize, value: f64, rate: f64) -> (f64, f64) {
        let ((a, a_rate), (o, o_rate)) = (self.amplitude[output].state, self.offset[output].state);
        (o + a * value, o_rate + a_rate * value + a * rate)
    }
}

/// Checks phases of oscillators.
pub(super) fn check_phases(name: &'static str, phases: &[f64], expected: usize) -> Result<(), CpgError> {
    size(name, phases.len(), expected)?;
    finite(name, phases)
}
