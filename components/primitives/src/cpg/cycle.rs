//! The limit cycle of a pair of neurons: period, amplitude and phase of each state.

use std::f64::consts::TAU;

use super::{CpgError, MatsuokaOscillator, MatsuokaSettings};
use crate::ValueError;

/// Number of samples of the cycle; states in between are interpolated.
const SAMPLES: usize = 512;
const STEPS: usize = 4;
/// Periods (by harmonic balance) after which the transient of the pair has decayed.
const PERIODS: f64 = 60.0;

/// Limit cycle of a pair, measured once. The output is the difference of the fatigues, `d = v_0 - v_1`,
/// because the difference of the firing rates has corners where a neuron falls silent. `v` is the firing rate
/// smoothed by the model itself.
#[derive(Clone, Debug)]
pub(super) struct Cycle {
    fatigue_time: f64,
    /// Period in the pair's own time, s.
    pub(super) period: f64,
    /// Largest `d`.
    amplitude: f64,
    /// States of both neurons, evenly spaced in time from the maximum of `d`.
    states: Vec<[(f64, f64); 2]>,
    /// Angles of `(d, -d' / omega)` at these states, ascending from 0.
    angles: Vec<f64>,
}

impl Cycle {
    /// Measures the cycle of two neurons that inhibit each other with `inhibition`.
    pub(super) fn measure(settings: MatsuokaSettings, inhibition: f64) -> Result<Self, CpgError> {
        let mut pair = MatsuokaOscillator::pair(settings, inhibition)?;
        let guess = settings.pair_frequency(inhibition).filter(|_| settings.pair_oscillates(inhibition));
        let Some(guess) = guess.map(f64::recip) else {
            return Err(CpgError::Value(ValueError::OutOfRange {
                name: "inhibition",
                value: inhibition,
                expected: "more than 1 + tau_1 / tau_2 and less than 1 + beta, for the pair to oscillate",
            }));
        };
        let dt = guess / (SAMPLES * STEPS) as f64;
        (0..(PERIODS * guess / dt) as usize).for_each(|_| pair.step(dt));
        let slope = |pair: &MatsuokaOscillator| difference(pair, settings.fatigue_time).1;
        // A period runs from maximum to maximum, where the slope crosses zero downwards.
        let mut time = 0.0;
        let mut peaks = Vec::with_capacity(3);
        let mut begin = pair.clone();
        while peaks.len() < 3 && time < 20.0 * guess {
            let before = (pair.clone(), slope(&pair));
            pair.step(dt);
            if before.1 > 0.0 && slope(&pair) <= 0.0 {
                let part = before.1 / (before.1 - slope(&pair));
                begin = before.0;
                begin.step(part * dt);
                peaks.push(time + part * dt);
            }
            time += dt;
        }
        let (Some(first), Some(last)) = (peaks.first(), peaks.last()) else {
            return Err(CpgError::Value(ValueError::OutOfRange {
                name: "inhibition",
                value: inhibition,
                expected: "a pair that oscillates",
            }));
        };
        let period = (last - first) / (peaks.len() - 1).max(1) as f64;
        let mut cycle = Self {
            fatigue_time: settings.fatigue_time,
            period,
            amplitude: difference(&begin, settings.fatigue_time).0,
            states: Vec::with_capacity(SAMPLES),
            angles: Vec::with_capacity(SAMPLES),
        };
        let (mut pair, step) = (begin, period / (SAMPLES * STEPS) as f64);
        for _ in 0..SAMPLES {
            let states = pair.states();
            cycle.states.push([states[0], states[1]]);
            let angle = cycle.angle(&pair);
            let least = cycle.angles.last().copied().unwrap_or(0.0);
            // rounding can put the first angle just below a full turn
            let angle = if cycle.angles.is_empty() { 0.0 } else { angle };
            cycle.angles.push(angle.max(least));
            (0..STEPS).for_each(|_| pair.step(step));
        }
        Ok(cycle)
    }

    /// Returns the pair's output, normalised to amplitude 1, and its rate in the pair's own time.
    pub(super) fn output(&self, pair: &MatsuokaOscillator) -> (f64, f64) {
        let (d, rate) = difference(pair, self.fatigue_time);
        (d / self.amplitude, rate / self.amplitude)
    }

    fn angle(&self, pair: &MatsuokaOscillator) -> f64 {
        let (d, rate) = difference(pair, self.fatigue_time);
        (-rate * self.period / TAU).atan2(d).rem_euclid(TAU)
    }

    /// Fraction of the period elapsed since the maximum, as an angle in \[0, 2 pi) rad.
    pub(super) fn phase(&self, pair: &MatsuokaOscillator) -> f64 {
        let angle = self.angle(pair);
        let after = self.angles.partition_point(|known| *known <= angle).max(1);
        let low = self.angles[after - 1];
        let high = self.angles.get(after).copied().unwrap_or(TAU);
        let part = if high > low { (angle - low) / (high - low) } else { 0.0 };
        TAU * ((after - 1) as f64 + part) / SAMPLES as f64
    }

    /// Returns the states of both neurons at a phase.
    pub(super) fn state(&self, phase: f64) -> [(f64, f64); 2] {
        let at = phase.rem_euclid(TAU) / TAU * SAMPLES as f64;
        let before = at as usize % SAMPLES;
        let part = at.fract();
        let (a, b) = (&self.states[before], &self.states[(before + 1) % SAMPLES]);
        let mix = |a: f64, b: f64| a + part * (b - a);
        [0, 1].map(|neuron| (mix(a[neuron].0, b[neuron].0), mix(a[neuron].1, b[neuron].1)))
    }
}

/// `v_0 - v_1` and its rate.
fn difference(pair: &MatsuokaOscillator, fatigue_time: f64) -> (f64, f64) {
    match (pair.states(), pair.output()) {
        ([(_, a), (_, b)], [firing_a, firing_b]) => (a - b, (firing_a - a - firing_b + b) / fatigue_time),
        _ => (0.0, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_of_an_uncoupled_pair_advances_evenly() {
        let settings = MatsuokaSettings::default();
        let cycle = Cycle::measure(settings, 2.2).unwrap();
        let mut pair = MatsuokaOscillator::pair(settings, 2.2).unwrap();
        for begin in [0.0, 1.0, 4.5] {
            pair.set_state(&cycle.state(begin)).unwrap();
            for k in 0..=1000 {
                let expected = begin + TAU * f64::from(k) / 1000.0;
                let off = (cycle.phase(&pair) - expected + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
                assert!(off.abs() < 5e-3, "{begin} {k}: {off}");
                pair.step(cycle.period / 1000.0);
            }
        }
    }

    #[test]
    fn inhibition_outside_the_oscillating_range_is_rejected() {
        let error = Cycle::measure(MatsuokaSettings::default(), 4.0).unwrap_err().to_string();
        assert_eq!(
            error,
            "inhibition = 4: expected more than 1 + tau_1 / tau_2 and less than 1 + beta, for the pair to oscillate"
        );
    }
}
