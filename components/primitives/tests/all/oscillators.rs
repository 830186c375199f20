//! Pattern generators against independent code (`golden/generate_oscillators.py`) and known limits.

use std::f64::consts::{PI, TAU};

use motorium_primitives::cpg::{
    CpgError, Entrainment, Gait, HopfNetwork, HopfSettings, Kuramoto, Lag, LegSettings, MatsuokaOscillator,
    MatsuokaSettings, NetworkSettings, Node, PhaseNetwork,
};
use nalgebra::DMatrix;
use serde_json::Value as Json;

fn golden() -> Json {
    serde_json::from_str(include_str!("../golden/oscillators.json")).unwrap()
}

fn numbers(value: &Json) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

fn number(value: &Json) -> f64 {
    value.as_f64().unwrap()
}

fn apart(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(TAU);
    d.min(TAU - d)
}

fn difference(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn full(n: usize, weight: f64) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| if i == j { 0.0 } else { weight })
}

/// Calls `step` once per millisecond up to each of the golden times, and `look` there.
fn at_ends(golden: &Json, mut step: impl FnMut(usize), mut look: impl FnMut(usize)) {
    let mut steps = 0;
    for (index, end) in numbers(&golden["ends"]).into_iter().enumerate() {
        let until = (end * 1e3).round() as usize;
        (steps..until).for_each(&mut step);
        steps = until;
        look(index);
    }
}

#[test]
fn phase_network_solves_its_equation() {
    let golden = golden();
    let part = &golden["network"];
    let field = |name: &str| numbers(&part[name]);
    let (amplitude, offset, theta) = (field("amplitude"), field("offset"), field("theta"));
    let nodes: Vec<Node> =
        (0..4).map(|i| Node { amplitude: amplitude[i], offset: offset[i], phase: theta[i] }).collect();
    let settings = NetworkSettings { frequency: number(&part["frequency"]), ..NetworkSettings::default() };
    let network = PhaseNetwork::new(&nodes, full(4, number(&part["weight"])), settings).unwrap();
    let network = std::cell::RefCell::new(network);
    network.borrow_mut().set_phases(&field("start")).unwrap();
    at_ends(
        &golden,
        |_| network.borrow_mut().step(1e-3),
        |k| {
            let network = network.borrow();
            for (found, expected) in network.phases().iter().zip(numbers(&part["phases"][k])) {
                assert!(apart(*found, expected) < 1e-8, "{found} {expected}");
            }
            assert!(difference(network.output(), &numbers(&part["outputs"][k])) < 1e-8);
            assert!(difference(network.velocity(), &numbers(&part["velocities"][k])) < 1e-7);
        },
    );
}

#[test]
fn hopf_network_solves_its_equation() {
    let golden = golden();
    let part = &golden["hopf"];
    let field = |name: &str| number(&part[name]);
    let settings = HopfSettings {
        convergence: field("convergence"),
        amplitude: field("amplitude"),
        stance_speed: field("stance_speed"),
        swing_speed: field("swing_speed"),
        sharpness: field("sharpness"),
    };
    let mut network =
        HopfNetwork::new(settings, full(3, field("coupling")), &numbers(&part["theta"])).unwrap();
    for (i, state) in numbers(&part["start"]).chunks(2).enumerate() {
        network.set_state(i, (state[0], state[1])).unwrap();
    }
    let network = std::cell::RefCell::new(network);
    at_ends(
        &golden,
        |_| network.borrow_mut().step(1e-3),
        |k| {
            let found: Vec<f64> = network.borrow().states().iter().flat_map(|(x, y)| [*x, *y]).collect();
            let error = difference(&found, &numbers(&part["states"][k]));
            assert!(error < 1e-6, "{error}");
        },
    );
}

#[test]
fn matsuoka_neurons_with_feedback_solve_their_equation() {
    let golden = golden();
    let part = &golden["matsuoka"];
    let start = numbers(&part["start"]);
    let mut pair = MatsuokaOscillator::pair(MatsuokaSettings::default(), number(&part["w"])).unwrap();
    pair.set_state(&[(start[0], start[2]), (start[1], start[3])]).unwrap();
    let pair = std::cell::RefCell::new(pair);
    at_ends(
        &golden,
        |k| {
            // the feedback at the middle of the step is used for the whole step
            let feedback = [0.1 * (3.0 * (k as f64 + 0.5) * 1e-3).sin(), 0.0];
            pair.borrow_mut().step_with_feedback(1e-3, &feedback);
        },
        |k| {
            let pair = pair.borrow();
            let states = pair.states();
            let found = [states[0].0, states[1].0, states[0].1, states[1].1];
            let error = difference(&found, &numbers(&part["states"][k]));
            assert!(error < 1e-5, "{error}");
        },
    );
}

#[test]
fn kuramoto_phases_solve_their_equation() {
    let golden = golden();
    let part = &golden["kuramoto"];
    let rows: Vec<Vec<f64>> = part["couplings"].as_array().unwrap().iter().map(numbers).collect();
    let couplings = DMatrix::from_fn(5, 5, |i, j| rows[i][j]);
    let mut kuramoto = Kuramoto::new(numbers(&part["omega"]), couplings, numbers(&part["theta"])).unwrap();
    kuramoto.set_phases(&numbers(&part["start"])).unwrap();
    let kuramoto = std::cell::RefCell::new(kuramoto);
    at_ends(
        &golden,
        |_| kuramoto.borrow_mut().step(1e-3),
        |k| {
            for (found, expected) in kuramoto.borrow().phases().iter().zip(numbers(&part["phases"][k])) {
                assert!(apart(*found, expected) < 1e-8);
            }
        },
    );
}

/// `psi' = -2 k sin(psi)` has the solution `tan(psi / 2) = tan(psi_0 / 2) exp(-2 k t)`.
#[test]
fn two_phases_converge_like_the_closed_form() {
    let (k, lag, off) = (1.5, 0.7, 1.9);
    let mut pair = Kuramoto::new(vec![6.0, 6.0], full(2, k), vec![0.0, lag]).unwrap();
    pair.set_phases(&[0.0, lag + off]).unwrap();
    for step in 1..=2000 {
        pair.step(1e-3);
        let t = f64::from(step) * 1e-3;
        let expected = 2.0 * ((0.5 * off).tan() * (-2.0 * k * t).exp()).atan();
        assert!(apart(pair.phases()[1] - pair.phases()[0], lag + expected) < 1e-10);
    }
    assert!(pair.order() > 0.999);
}

#[test]
fn two_phases_lock_only_under_sufficient_coupling() {
    let run = |k: f64| {
        let mut pair = Kuramoto::new(vec![6.0, 7.0], full(2, k), vec![0.0; 2]).unwrap();
        (0..20_000).for_each(|_| pair.step(1e-3));
        let before = pair.phases()[1] - pair.phases()[0];
        (0..1000).for_each(|_| pair.step(1e-3));
        (apart(pair.phases()[1] - pair.phases()[0], before), pair.phases()[1] - pair.phases()[0])
    };
    // locked: sin(psi) = (omega_1 - omega_0) / 2k
    let (drift, psi) = run(0.8);
    assert!(drift < 1e-9 && apart(psi, (1.0_f64 / 1.6).asin()) < 1e-9);
    assert!(run(0.4).0 > 0.05, "it drifts");
}

#[test]
fn entrainment_locks_within_adlers_range_only() {
    for (measured_speed, locks) in [(TAU + 1.5, true), (TAU - 1.5, true), (TAU + 3.0, false)] {
        let entrainment = Entrainment { gain: 2.0, lead: 0.0 };
        let legs = [LegSettings::default(); 2];
        let mut network = PhaseNetwork::of_gait(Gait::Walk, &legs, 5.0).unwrap();
        let mut measured = 1.0;
        let mut slips = 0.0_f64;
        for k in 0..20_000 {
            // the phase half a millisecond ahead is used for the whole step
            let at = measured + 0.5e-3 * measured_speed;
            let [a, b] = [0, 1].map(|i| network.phases()[i]);
            let half = 0.5e-3 * TAU;
            let pull = [entrainment.pull(at, a + half), entrainment.pull(at + PI, b + half)];
            network.step_entrained(1e-3, &pull);
            measured += 1e-3 * measured_speed;
            if k > 15_000 {
                slips = slips.max(apart(measured, network.phases()[0]));
            }
        }
        let lag = ((measured_speed - TAU) / 2.0).asin().abs();
        if locks {
            assert!((slips - lag).abs() < 1e-3, "{slips} {lag}");
        } else {
            assert!(slips > 3.0, "it slips through all phases: {slips}");
        }
    }
}

#[test]
fn gaits_settle_and_change_without_jumps() {
    let gaits = |legs| match legs {
        2 => vec![Gait::Walk, Gait::Bound],
        4 => vec![Gait::Walk, Gait::Trot, Gait::Pace, Gait::Bound],
        _ => vec![Gait::Walk, Gait::Tripod],
    };
    for legs in [2, 4, 6] {
        for from in gaits(legs) {
            for to in gaits(legs) {
                let mut network =
                    PhaseNetwork::of_gait(from, &vec![LegSettings::default(); legs], 6.0).unwrap();
                let scattered: Vec<f64> =
                    (0..legs).map(|i| from.phases(legs).unwrap()[i] + 0.3 * i as f64).collect();
                network.set_phases(&scattered).unwrap();
                (0..4000).for_each(|_| network.step(1e-3));
                assert!(network.pattern_error() < 1e-3, "{legs} {from:?}: {}", network.pattern_error());
                network.set_gait(to).unwrap();
                let (mut position, mut velocity) = (network.output().to_vec(), network.velocity().to_vec());
                for _ in 0..4000 {
                    network.step(1e-3);
                    assert!(difference(network.output(), &position) < 0.005);
                    assert!(difference(network.velocity(), &velocity) < 0.1, "{from:?} {to:?}");
                    position.copy_from_slice(network.output());
                    velocity.copy_from_slice(network.velocity());
                }
                let phases = to.phases(legs).unwrap();
                for i in 0..legs {
                    let lag = network.phases()[i] - network.phases()[0];
                    assert!(apart(lag, phases[i] - phases[0]) < 1e-2, "{legs} {from:?} {to:?} leg {i}");
                }
            }
        }
    }
}

#[test]
fn commands_are_followed_smoothly() {
    let mut network = PhaseNetwork::of_gait(Gait::Trot, &[LegSettings::default(); 4], 5.0).unwrap();
    (0..3000).for_each(|_| network.step(1e-3));
    network.set_frequency(2.5).unwrap();
    network.set_amplitude_offset(1, 0.6, -0.2).unwrap();
    let mut velocity = network.velocity().to_vec();
    for _ in 0..3000 {
        network.step(1e-3);
        assert!(difference(network.velocity(), &velocity) < 0.2);
        velocity.copy_from_slice(network.velocity());
    }
    let (mut low, mut high, mut turns, mut before) = (f64::INFINITY, f64::NEG_INFINITY, 0, 0.0);
    for _ in 0..4000 {
        network.step(1e-3);
        low = low.min(network.output()[1]);
        high = high.max(network.output()[1]);
        turns += u32::from(network.phases()[1] < before);
        before = network.phases()[1];
    }
    assert_eq!(turns, 10, "four seconds at 2.5 Hz");
    assert!((low + 0.8).abs() < 1e-3 && (high - 0.4).abs() < 1e-3, "{low} {high}");
}

#[test]
fn contradictory_lags_are_rejected() {
    let node = Node { amplitude: 1.0, offset: 0.0, phase: 0.0 };
    let lag = |follower, leader, ahead| Lag { follower, leader, ahead };
    let make = |lags: &[Lag]| PhaseNetwork::from_lags(&[node; 3], lags, 2.0, NetworkSettings::default());
    assert!(matches!(make(&[lag(0, 1, 1.0), lag(1, 2, 1.0), lag(2, 0, 1.0)]), Err(CpgError::Lags(_))));
    let mut network = make(&[lag(0, 1, 1.0), lag(1, 2, 1.0), lag(2, 0, -2.0)]).unwrap();
    network.set_phases(&[0.0, 0.5, 0.1]).unwrap();
    (0..5000).for_each(|_| network.step(1e-3));
    assert!(apart(network.phases()[2] - network.phases()[0], 2.0) < 1e-6);
}

#[test]
fn hopf_leg_has_the_given_stance_and_swing_times() {
    for duty in [0.5, 0.75] {
        let settings =
            HopfSettings { amplitude: 0.4, convergence: 50.0, sharpness: 500.0, ..HopfSettings::default() };
        let settings = settings.with_stride(0.8, duty);
        let mut leg = HopfNetwork::new(settings, DMatrix::zeros(1, 1), &[0.0]).unwrap();
        leg.set_state(0, (0.01, 0.0)).unwrap();
        (0..8000).for_each(|_| leg.step(1e-3));
        let (mut stance, mut largest) = (0, 0.0_f64);
        for _ in 0..8000 {
            leg.step(1e-3);
            stance += u32::from(leg.is_stance(0));
            largest = largest.max(leg.output()[0]);
        }
        assert!((f64::from(stance) / 8000.0 - duty).abs() < 0.01, "{stance}");
        assert!((largest - 0.4).abs() < 2e-3);
    }
}

#[test]
fn neuron_pair_oscillates_near_the_predicted_frequency() {
    let settings = MatsuokaSettings::default();
    for (w, oscillates) in [(1.2, false), (2.2, true), (4.0, false)] {
        assert_eq!(settings.pair_oscillates(w), oscillates);
        let mut pair = MatsuokaOscillator::pair(settings, w).unwrap();
        (0..60_000).for_each(|_| pair.step(1e-3));
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for _ in 0..10_000 {
            pair.step(1e-3);
            low = low.min(pair.difference());
            high = high.max(pair.difference());
        }
        assert_eq!(high - low > 0.1, oscillates, "w = {w}: {low} to {high}");
    }
    let measured = number(&golden()["matsuoka"]["frequency"]);
    let estimated = settings.pair_frequency(2.2).unwrap();
    assert!((estimated / measured - 1.0).abs() < 0.15, "{estimated} Hz against {measured} Hz");
}
