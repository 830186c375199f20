//! Gaits of Hopf's, Matsuoka's and Kuramoto's oscillators.

use std::f64::consts::{PI, TAU};

use motorium_primitives::ValueError;
use motorium_primitives::cpg::{
    CpgError, Gait, HopfSettings, JointOscillation, Kuramoto, MatsuokaSettings, Oscillator,
    OscillatorNetwork, OscillatorNetworkSettings,
};
use nalgebra::DMatrix;

fn models() -> [Oscillator; 3] {
    let matsuoka = Oscillator::Matsuoka { settings: MatsuokaSettings::default(), inhibition: 2.2 };
    [Oscillator::Kuramoto, Oscillator::Hopf(HopfSettings::default()), matsuoka]
}

fn legs(n: usize) -> Vec<JointOscillation> {
    (0..n).map(|leg| JointOscillation { leg, amplitude: 0.3, offset: 0.1, phase: 0.0 }).collect()
}

fn rhythm(model: Oscillator, gait: Gait, n: usize, settings: OscillatorNetworkSettings) -> OscillatorNetwork {
    OscillatorNetwork::new(model, &legs(n), gait.phases(n).unwrap(), settings).unwrap()
}

fn apart(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(TAU);
    d.min(TAU - d)
}

#[test]
fn gaits_settle_and_change_without_jumps() {
    for model in models() {
        for (n, gaits) in [(2, Gait::for_legs(2)), (4, Gait::for_legs(4)), (6, Gait::for_legs(6))] {
            for (from, to) in gaits.iter().flat_map(|from| gaits.iter().map(move |to| (*from, *to))) {
                let what = format!("{model:?}, {n} legs, {from:?} to {to:?}");
                let mut rhythm = rhythm(model, from, n, OscillatorNetworkSettings::default());
                let phases = from.phases(n).unwrap();
                let scattered: Vec<f64> = (0..n).map(|i| phases[i] + 0.3 * i as f64).collect();
                rhythm.set_phases(&scattered).unwrap();
                (0..3000).for_each(|_| rhythm.step(1e-3));
                assert!(rhythm.gait_error() < 2e-2, "{what}: {}", rhythm.gait_error());
                rhythm.set_gait(to.phases(n).unwrap()).unwrap();
                let (mut q, mut v) = (rhythm.output().to_vec(), rhythm.velocity().to_vec());
                for _ in 0..3000 {
                    rhythm.step(1e-3);
                    for i in 0..n {
                        // the mean of the velocities at both ends predicts the change of position
                        let step = 5e-4 * (v[i] + rhythm.velocity()[i]);
                        assert!((rhythm.output()[i] - q[i] - step).abs() < 2e-5, "{what}: leg {i}");
                        assert!((rhythm.velocity()[i] - v[i]).abs() < 0.15, "{what}: leg {i} jumps");
                    }
                    q.copy_from_slice(rhythm.output());
                    v.copy_from_slice(rhythm.velocity());
                }
                let phases = to.phases(n).unwrap();
                for i in 0..n {
                    let lag = rhythm.phases()[i] - rhythm.phases()[0];
                    assert!(apart(lag, phases[i] - phases[0]) < 3e-2, "{what}: leg {i}");
                }
            }
        }
    }
}

#[test]
fn strides_have_the_given_period_and_amplitude() {
    for model in models() {
        for (frequency, amplitude) in [(0.5, 0.2), (2.0, 0.4)] {
            let mut rhythm = rhythm(model, Gait::Trot, 4, OscillatorNetworkSettings::default());
            rhythm.set_frequency(frequency).unwrap();
            (0..4).for_each(|leg| rhythm.set_amplitude_offset(leg, amplitude, -0.5).unwrap());
            (0..4000).for_each(|_| rhythm.step(1e-3));
            let (mut low, mut high, mut turns, mut before) = (f64::MAX, f64::MIN, 0, rhythm.phases()[2]);
            let start = before;
            for _ in 0..8000 {
                rhythm.step(1e-3);
                low = low.min(rhythm.output()[2]);
                high = high.max(rhythm.output()[2]);
                turns += u32::from(rhythm.phases()[2] < before - PI);
                before = rhythm.phases()[2];
            }
            assert_eq!(f64::from(turns), 8.0 * frequency, "{model:?}");
            assert!(apart(before, start) < 2e-2, "{model:?}: {before} {start}");
            assert!((high + 0.5 - amplitude).abs() < 0.01 * amplitude, "{model:?}: {low} to {high}");
            // the cycle of a pair of neurons is symmetric: both have the same cycle, half a period apart
            assert!((low + 0.5 + amplitude).abs() < 0.01 * amplitude, "{model:?}: {low} to {high}");
        }
    }
}

/// With a duty factor of 0.7 and legs half a stride apart, both legs stand 0.4 of the time and never swing
/// simultaneously.
#[test]
fn duty_factor_and_leg_timing_are_kept() {
    let settings = HopfSettings { sharpness: 500.0, ..HopfSettings::default() };
    let numbers = OscillatorNetworkSettings { duty_factor: 0.7, ..OscillatorNetworkSettings::default() };
    let mut rhythm = rhythm(Oscillator::Hopf(settings), Gait::Walk, 2, numbers);
    (0..5000).for_each(|_| rhythm.step(1e-3));
    let stands = |phase: f64| phase < TAU * 0.7;
    let (mut one, mut both, mut none, mut backwards) = (0, 0, 0, 0);
    for _ in 0..10_000 {
        rhythm.step(1e-3);
        let [a, b] = [stands(rhythm.phases()[0]), stands(rhythm.phases()[1])];
        one += u32::from(a);
        both += u32::from(a && b);
        none += u32::from(!a && !b);
        backwards += u32::from(rhythm.velocity()[0] < 0.0);
    }
    assert!((f64::from(one) / 1e4 - 0.7).abs() < 0.01, "{one}");
    assert!((f64::from(both) / 1e4 - 0.4).abs() < 0.01 && none < 50, "{both} {none}");
    assert!((f64::from(backwards) / 1e4 - 0.7).abs() < 0.01, "a leg in stance moves backwards: {backwards}");
    rhythm.set_duty_factor(0.5).unwrap();
    (0..5000).for_each(|_| rhythm.step(1e-3));
    let backwards = (0..10_000).filter(|_| {
        rhythm.step(1e-3);
        rhythm.velocity()[0] < 0.0
    });
    assert!((backwards.count() as f64 / 1e4 - 0.5).abs() < 0.01);
}

/// Compares with the model itself, integrated by another method.
#[test]
fn phases_match_the_kuramoto_model() {
    let settings = OscillatorNetworkSettings { coupling: 3.0, ..OscillatorNetworkSettings::default() };
    let theta = Gait::Walk.phases(4).unwrap();
    let mut rhythm = OscillatorNetwork::new(Oscillator::Kuramoto, &legs(4), theta, settings).unwrap();
    let weights = DMatrix::from_fn(4, 4, |i, j| if i == j { 0.0 } else { 1.0 });
    let mut kuramoto = Kuramoto::new(vec![TAU; 4], weights, theta.to_vec()).unwrap();
    let start = [0.1, 2.0, 4.0, 5.5];
    rhythm.set_phases(&start).unwrap();
    kuramoto.set_phases(&start).unwrap();
    for _ in 0..2000 {
        rhythm.step(1e-3);
        kuramoto.step(1e-3);
        for (a, b) in rhythm.phases().iter().zip(kuramoto.phases()) {
            assert!(apart(*a, *b) < 2e-3, "{a} {b}");
        }
    }
}

/// A joint driven at another frequency entrains the rhythm if the gain exceeds the difference.
#[test]
fn rhythm_locks_to_a_measured_joint() {
    for model in models() {
        for (gain, locks) in [(4.0, true), (0.3, false)] {
            let mut rhythm = rhythm(model, Gait::Walk, 2, OscillatorNetworkSettings::default());
            // 1.25 Hz against 1 Hz: 1.6 rad/s apart
            let omega = TAU * 1.25;
            let (mut before, mut advanced) = (0.0, 0.0);
            for k in 0..20_000 {
                let t = f64::from(k) * 1e-3;
                let pull: Vec<f64> = (0..2)
                    .map(|joint| {
                        let phase = omega * t + PI * joint as f64;
                        rhythm.pull(joint, 0.1 + 0.3 * phase.cos(), -0.3 * omega * phase.sin(), gain)
                    })
                    .collect();
                rhythm.step_entrained(1e-3, &pull);
                let phase = rhythm.phases()[0];
                if k >= 10_000 {
                    advanced += (phase - before + PI).rem_euclid(TAU) - PI;
                }
                before = phase;
            }
            let off = (advanced - 10.0 * omega).abs();
            assert_eq!(off < 1.0, locks, "{model:?}, gain {gain}: {off} rad off after 10 s");
        }
    }
}

#[test]
fn invalid_networks_are_rejected() {
    let settings = OscillatorNetworkSettings::default();
    let gait = Gait::Walk.phases(2).unwrap();
    let make = |model, oscillations: &[JointOscillation], settings| {
        OscillatorNetwork::new(model, oscillations, gait, settings)
    };
    let error = make(Oscillator::Kuramoto, &legs(3), settings).unwrap_err();
    assert_eq!(error, CpgError::Value(ValueError::Size { name: "the gait", found: 2, expected: 3 }));
    let duty = OscillatorNetworkSettings { duty_factor: 1.0, ..settings };
    assert!(make(Oscillator::Kuramoto, &legs(2), duty).is_err());
    let silent = Oscillator::Matsuoka { settings: MatsuokaSettings::default(), inhibition: 1.0 };
    assert!(make(silent, &legs(2), settings).unwrap_err().to_string().contains("to oscillate"));
    let rigid = Oscillator::Hopf(HopfSettings { convergence: 0.0, ..HopfSettings::default() });
    assert!(make(rigid, &legs(2), settings).is_err());
}
