//! The limit cycle of a pair of neurons: its period, its size, and where in time each state lies.

use std::f64::consts::TAU;

use super::{CpgError, MatsuokaOscillator, MatsuokaSettings};
use crate::ValueError;

/// Samples of the cycle, and steps between two of them.
const SAMPLES: usize = 512;
const STEPS: usize = 4;
/// Periods (by harmonic balance) after which the pair is on its cycle.
const PERIODS: f64 = 60.0;

/// The cycle of a pair, measured once. Its output is the difference of the fatigues, `d = v_0 - v_1`: that of the firing
/// rates has corners where a neuron falls silent, and `v` is just that, smoothed by the model itself.
#[derive(Clone, Debug)]
pub(super) struct Cycle {
    fatigue_time: f64,
    /// Own time of one turn, s.
    pub(super) period: f64,
    /// Largest `d`.
    amplitude: f64,
    /// States of both neurons, evenly spaced in time from the maximum of `d`.
    states: Vec<[(f64, f64); 2]>,
    /// Angles of `(d, -d' / omega)` there, ascending from 0.
    angles: Vec<f64>,
}

impl Cycle {
    /// Of two neurons that inhibit each other with `inhibition`.
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
        // from maximum to maximum: where the slope falls through zero, the state a little before
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
            // the first may be a rounding below a whole turn
            let angle = if cycle.angles.is_empty() { 0.0 } else { angle };
            cycle.angles.push(angle.max(least));
            (0..STEPS).for_each(|_| pair.step(step));
        }
        Ok(cycle)
    }

    /// Output of a pair and its rate in own time, of amplitude 1.
    pub(super) fn output(&self, pair: &MatsuokaOscillator) -> (f64, f64) {
        let (d, rate) = difference(pair, self.fatigue_time);
        (d / self.amplitude, rate / self.amplitude)
    }

    fn angle(&self, pair: &MatsuokaOscillator) -> f64 {
        let (d, rate) = difference(pair, self.fatigue_time);
        (-rate * self.period / TAU).atan2(d).rem_euclid(TAU)
    }

    /// The part of a turn in time since the maximum, rad in \[0, 2 pi).
    pub(super) fn phase(&self, pair: &MatsuokaOscillator) -> f64 {
        let angle = self.angle(pair);
        let after = self.angles.partition_point(|known| *known <= angle).max(1);
        let low = self.angles[after - 1];
        let high = self.angles.get(after).copied().unwrap_or(TAU);
        let part = if high > low { (angle - low) / (high - low) } else { 0.0 };
        TAU * ((after - 1) as f64 + part) / SAMPLES as f64
    }

    /// The state at a phase.
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
    fn a_pair_that_runs_alone_advances_evenly_in_phase() {
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
    fn a_pair_that_would_fall_silent_is_refused_with_the_range() {
        let error = Cycle::measure(MatsuokaSettings::default(), 4.0).unwrap_err().to_string();
        assert_eq!(
            error,
            "inhibition = 4: expected more than 1 + tau_1 / tau_2 and less than 1 + beta, for the pair to oscillate"
        );
    }
}
