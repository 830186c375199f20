//! Further primitives, against independent code (`golden/generate_movements.py`) and their documented
//! properties.

use motorium_primitives::dmp::{
    Coupling, Demonstration, DiscreteDmp, DmpModel, MoveError, ObstacleAvoidance, PhaseStop, Regression,
    RhythmicDmp, RhythmicModel, RhythmicSettings, SampledDmp, SampledModel, Scaling, Settings, Variant,
    orientation_demonstration,
};
use motorium_robots::lie::so3;
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use serde_json::Value as Json;

const VARIANTS: [Variant; 4] =
    [Variant::Classic, Variant::GoalSafe, Variant::QuinticGoal, Variant::FinalVelocity];

fn golden(part: &str) -> Json {
    serde_json::from_str::<Json>(include_str!("../golden/movements.json")).unwrap()[part].take()
}

fn numbers(value: &Json) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

fn number(value: &Json) -> f64 {
    value.as_f64().unwrap()
}

fn matrix(value: &Json) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

fn difference(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn model(variant: Variant, weights: DMatrix<f64>) -> DmpModel {
    let displacement = DVector::from_element(weights.ncols(), 1.0);
    let settings = Settings { variant, kernels: weights.nrows(), ..Settings::default() };
    DmpModel::with_weights(settings, weights, displacement).unwrap()
}

#[test]
fn rhythm_solves_its_equation() {
    let golden = golden("rhythmic");
    let weights = matrix(&golden["weights"]);
    let settings = RhythmicSettings {
        kernels: weights.nrows(),
        width: Some(number(&golden["width"])),
        ..RhythmicSettings::default()
    };
    let baseline = DVector::from_vec(numbers(&golden["baseline"]));
    let mut dmp = RhythmicDmp::new(RhythmicModel::with_weights(settings, weights, baseline).unwrap());
    dmp.set_period(number(&golden["period"])).unwrap();
    dmp.set_amplitude(number(&golden["amplitude"])).unwrap();
    dmp.start(number(&golden["phase"]), &numbers(&golden["start"]), &numbers(&golden["velocity"])).unwrap();
    let mut steps = 0;
    for sample in golden["samples"].as_array().unwrap() {
        let until = (number(&sample["t"]) * 1e4).round() as usize;
        (steps..until).for_each(|_| dmp.step(1e-4));
        steps = until;
        assert!(difference(dmp.position(), &numbers(&sample["y"])) < 1e-6);
        let error = difference(dmp.velocity(), &numbers(&sample["v"]));
        assert!(error < 5e-5, "{error}");
    }
    assert_eq!(dmp.cycles(), 3, "2.4 s of 0.8 s each");
}

#[test]
fn fitted_rhythm_repeats_at_any_speed_and_amplitude() {
    let fit = &golden("rhythmic")["fit"];
    let positions = matrix(&fit["positions"]);
    let settings = RhythmicSettings { kernels: 20, ..RhythmicSettings::default() };
    let model = RhythmicModel::fit(settings, std::slice::from_ref(&positions), 1e-12).unwrap();
    assert!(difference(model.baseline().as_slice(), &numbers(&fit["baseline"])) < 1e-15);
    let expected = matrix(&fit["weights"]);
    assert!((model.weights() - &expected).amax() / expected.amax() < 1e-8);
    for (period, amplitude) in [(1.0, 1.0), (0.25, 1.0), (3.0, 0.5)] {
        let mut dmp = RhythmicDmp::new(model.clone());
        dmp.set_period(period).unwrap();
        dmp.set_amplitude(amplitude).unwrap();
        // a few periods to settle, then one to compare
        let dt = period / 2000.0;
        (0..10_000).for_each(|_| dmp.step(dt));
        for k in 0..200 {
            let shown: Vec<f64> = (0..2)
                .map(|d| model.baseline()[d] + amplitude * (positions[(k, d)] - model.baseline()[d]))
                .collect();
            let error = difference(dmp.position(), &shown);
            assert!(error < 5e-3, "period {period}, amplitude {amplitude}, sample {k}: {error}");
            (0..10).for_each(|_| dmp.step(dt));
        }
    }
}

#[test]
fn locally_weighted_rhythm_matches_the_formula() {
    let fit = &golden("rhythmic")["fit"];
    let settings = RhythmicSettings { kernels: 20, ..RhythmicSettings::default() };
    let model = RhythmicModel::fit_locally_weighted(settings, &[matrix(&fit["positions"])]).unwrap();
    let expected = matrix(&fit["locally_weighted"]);
    assert!((model.weights() - &expected).amax() / expected.amax() < 1e-12);
}

#[test]
fn rhythm_parameters_change_without_a_jump() {
    let positions = matrix(&golden("rhythmic")["fit"]["positions"]);
    let mut dmp =
        RhythmicDmp::new(RhythmicModel::fit(RhythmicSettings::default(), &[positions], 1e-12).unwrap());
    (0..1234).for_each(|_| dmp.step(1e-3));
    let (position, velocity) = (dmp.position().to_vec(), dmp.velocity().to_vec());
    dmp.set_period(0.4).unwrap();
    dmp.set_amplitude(2.0).unwrap();
    dmp.set_baseline(&[1.0, 1.0]).unwrap();
    assert!(difference(dmp.position(), &position) == 0.0);
    assert!(difference(dmp.velocity(), &velocity) < 1e-12);
}

#[test]
fn rhythm_survives_json() {
    let positions = matrix(&golden("rhythmic")["fit"]["positions"]);
    let model = RhythmicModel::fit(RhythmicSettings::default(), &[positions], 1e-12).unwrap();
    let text = serde_json::to_string(&model).unwrap();
    let back = serde_json::from_str::<RhythmicModel>(&text).unwrap();
    assert_eq!(back.settings(), model.settings());
    assert!((back.weights() - model.weights()).amax() < 1e-12, "up to the precision of the text");
    let torn = text.replacen(r#""kernels":30"#, r#""kernels":31"#, 1);
    let error = serde_json::from_str::<RhythmicModel>(&torn).unwrap_err().to_string();
    assert!(error.contains("a dimension of weights has 30 entries, expected 31"), "{error}");
}

#[test]
fn stroke_solves_its_equation_and_passes_its_goal() {
    let golden = golden("striking");
    let vector = |name: &str| numbers(&golden[name]);
    let mut dmp = DiscreteDmp::new(model(Variant::FinalVelocity, matrix(&golden["weights"])));
    let from = [&vector("start")[..], &vector("velocity")[..], &[0.0; 2]];
    let to = [&vector("goal")[..], &vector("final_velocity")[..]];
    dmp.start_striking(from, to, number(&golden["duration"])).unwrap();
    let mut steps = 0;
    for sample in golden["samples"].as_array().unwrap() {
        let until = (number(&sample["t"]) * 1e4).round() as usize;
        (steps..until).for_each(|_| dmp.step(1e-4));
        steps = until;
        assert!(difference(dmp.position(), &numbers(&sample["y"])) < 1e-6);
        assert!(difference(dmp.velocity(), &numbers(&sample["v"])) < 1e-5);
    }
    // without forcing it arrives exactly
    let mut plain = DiscreteDmp::new(model(Variant::FinalVelocity, DMatrix::zeros(8, 2)));
    plain.start_striking(from, to, 1.0).unwrap();
    (0..1000).for_each(|_| plain.step(1e-3));
    assert!(difference(plain.position(), to[0]) < 1e-12 && difference(plain.velocity(), to[1]) < 1e-11);
}

#[test]
fn learned_stroke_ends_with_the_demonstrated_velocity() {
    let stroke = |p: f64| p * p * p * (1.0 + (5.0 * p).sin() * (1.0 - p));
    let positions = DMatrix::from_fn(301, 1, |k, _| stroke(k as f64 / 300.0));
    let demonstration = Demonstration::from_positions(0.6, positions).unwrap();
    let settings = Settings { variant: Variant::FinalVelocity, ..Settings::default() };
    let model = DmpModel::fit(settings, &[demonstration], Regression::default()).unwrap();
    let mut dmp = DiscreteDmp::new(model);
    let last = 3.0 - 5.0_f64.sin(); // the derivative of the stroke at its end
    dmp.start_striking([&[0.0]; 3], [&[1.0], &[last / 0.6]], 0.6).unwrap();
    for k in 1..=600 {
        dmp.step(1e-3);
        assert!((dmp.position()[0] - stroke(f64::from(k) / 600.0)).abs() < 3e-3);
    }
    assert!((dmp.velocity()[0] / (last / 0.6) - 1.0).abs() < 0.02, "{} {}", dmp.velocity()[0], last / 0.6);
}

#[test]
fn final_velocity_is_rejected_by_resting_variants() {
    let mut dmp = DiscreteDmp::new(model(Variant::QuinticGoal, DMatrix::zeros(4, 1)));
    let error = dmp.start_striking([&[0.0]; 3], [&[1.0], &[1.0]], 1.0).unwrap_err();
    assert_eq!(error, MoveError::EndsAtRest { variant: Variant::QuinticGoal });
}

#[test]
fn obstacle_and_phase_stop_match_the_equation() {
    let golden = golden("coupled");
    let obstacle = Vector3::from_column_slice(&numbers(&golden["obstacle"]));
    let avoidance = ObstacleAvoidance { gamma: number(&golden["gamma"]), ..ObstacleAvoidance::default() };
    let stiffness = 156.25;
    for (name, variant, scale) in
        [("classic", Variant::Classic, 1.0), ("goal_safe", Variant::GoalSafe, 1.0 / stiffness)]
    {
        let mut dmp = DiscreteDmp::new(model(variant, matrix(&golden["weights"]) * scale));
        dmp.start(&[0.0; 3], &numbers(&golden["goal"]), number(&golden["duration"])).unwrap();
        let mut steps = 0;
        for sample in golden[name].as_array().unwrap() {
            let until = (number(&sample["t"]) * 1e4).round() as usize;
            for _ in steps..until {
                let (y, v) = (dmp.position(), dmp.velocity());
                let (y, v) = (Vector3::from_column_slice(y), Vector3::from_column_slice(v));
                let c = avoidance.acceleration(y, v, obstacle);
                let phase_rate = number(&golden["phase_rate"]);
                dmp.step_coupled(1e-4, &Coupling { acceleration: c.as_slice(), phase_rate }).unwrap();
            }
            steps = until;
            // the coupling is constant over a step: first order in the step width
            assert!(difference(dmp.position(), &numbers(&sample["y"])) < 2e-4, "{name}");
        }
    }
}

#[test]
fn obstacle_is_avoided_and_the_goal_reached() {
    for variant in VARIANTS {
        let closest = |avoid: bool| {
            let avoidance = ObstacleAvoidance::default();
            let obstacle = Vector3::new(0.5, 0.004, 0.0);
            let mut dmp = DiscreteDmp::new(model(variant, DMatrix::zeros(5, 3)));
            dmp.start(&[0.0; 3], &[1.0, 0.0, 0.0], 1.0).unwrap();
            let mut closest = f64::INFINITY;
            for _ in 0..3000 {
                let y = Vector3::from_column_slice(dmp.position());
                let v = Vector3::from_column_slice(dmp.velocity());
                closest = closest.min((y - obstacle).norm());
                let c = avoidance.acceleration(y, v, obstacle);
                let acceleration = if avoid { c.as_slice() } else { &[] };
                dmp.step_coupled(1e-3, &Coupling { acceleration, phase_rate: 1.0 }).unwrap();
            }
            assert!(difference(dmp.position(), &[1.0, 0.0, 0.0]) < 1e-3, "{variant:?}: {:?}", dmp.position());
            closest
        };
        assert!(closest(false) < 0.01 && closest(true) > 0.04, "{variant:?}: {}", closest(true));
    }
}

#[test]
fn blocked_robot_stops_the_phase_until_released() {
    let stop = PhaseStop::Quadratic { gain: 1e4 };
    for variant in VARIANTS {
        let mut dmp = DiscreteDmp::new(model(variant, DMatrix::from_element(10, 1, 30.0)));
        dmp.start(&[0.0], &[1.0], 1.0).unwrap();
        let mut held = 0.0;
        for k in 0..4000 {
            // the robot is held for two seconds, elsewhere it follows
            if !(300..2300).contains(&k) {
                held = dmp.position()[0];
            }
            let phase_rate = stop.rate(dmp.position()[0] - held);
            dmp.step_coupled(1e-3, &Coupling { acceleration: &[], phase_rate }).unwrap();
            if k == 2299 {
                assert!(dmp.progress() < 0.65, "{variant:?}: {}", dmp.progress());
            }
        }
        assert!(dmp.is_over() && (dmp.position()[0] - 1.0).abs() < 1e-2, "{variant:?}: {:?}", dmp.position());
    }
}

#[test]
fn push_deflects_the_path_temporarily() {
    let mut dmp = DiscreteDmp::new(model(Variant::Classic, DMatrix::zeros(5, 1)));
    dmp.start(&[0.5], &[0.5], 2.0).unwrap();
    for _ in 0..4000 {
        dmp.step_coupled(1e-3, &Coupling { acceleration: &[3.0], phase_rate: 1.0 }).unwrap();
    }
    // C = K / T^2 * offset
    assert!((dmp.position()[0] - 0.5 - 3.0 * 4.0 / 156.25).abs() < 1e-6);
    (0..4000).for_each(|_| dmp.step(1e-3));
    assert!((dmp.position()[0] - 0.5).abs() < 1e-6);
    let wrong = dmp.step_coupled(1e-3, &Coupling { acceleration: &[1.0, 2.0], phase_rate: 1.0 });
    assert!(matches!(wrong, Err(MoveError::Dimensions { found: 2, expected: 1, .. })));
}

/// The case in which a forcing term divided by the displacement diverges.
#[test]
fn closed_movement_with_a_new_goal_stays_bounded() {
    let wave = DMatrix::from_fn(201, 1, |k, _| (std::f64::consts::PI * k as f64 / 200.0).sin());
    let demonstration = Demonstration::from_positions(1.0, wave).unwrap();
    assert!((demonstration.goal(0) - demonstration.start(0)).abs() < 1e-15);
    for variant in VARIANTS {
        for scaling in
            [Scaling::Fixed, Scaling::Displacement { limit: 3.0 }, Scaling::Similarity { limit: 3.0 }]
        {
            let settings = Settings { variant, scaling, ..Settings::default() };
            let model =
                DmpModel::fit(settings, std::slice::from_ref(&demonstration), Regression::default()).unwrap();
            for (goal, late) in [(0.5, None), (0.0, Some(1.0)), (1e-9, None), (-2.0, Some(2.0))] {
                let mut dmp = DiscreteDmp::new(model.clone());
                dmp.start(&[0.0], &[goal], 1.0).unwrap();
                let mut largest = 0.0_f64;
                for k in 0..4000 {
                    if let (500, Some(late)) = (k, late) {
                        dmp.set_goal(&[late]).unwrap();
                    }
                    dmp.step(1e-3);
                    largest = largest.max(dmp.position()[0].abs());
                }
                let goal = late.unwrap_or(goal);
                assert!(largest < 5.0, "{variant:?} {scaling:?}: {largest}");
                assert!((dmp.position()[0] - goal).abs() < 1e-3, "{variant:?}: {:?}", dmp.position());
            }
        }
    }
}

/// A letter-like curve that starts and ends in motion.
fn curve(samples: usize) -> DMatrix<f64> {
    DMatrix::from_fn(samples, 3, |k, d| {
        let p = k as f64 / (samples - 1) as f64;
        [(7.0 * p).sin(), p * p - (3.0 * p).cos(), 100.0 * p][d]
    })
}

#[test]
fn sampled_forcing_reproduces_to_rounding() {
    let shown = curve(200);
    for variant in VARIANTS {
        let settings = Settings { variant, ..Settings::default() };
        let mut dmp = SampledDmp::new(SampledModel::new(&settings, &shown).unwrap());
        for (duration, shift) in [(1.0, 0.0), (3.7, 0.0), (1.0, 2.5)] {
            let moved = |k: usize| -> Vec<f64> { shown.row(k).iter().map(|y| y + shift).collect() };
            dmp.start(&moved(0), &moved(199), duration).unwrap();
            for k in 1..200 {
                dmp.step();
                let error = difference(dmp.position(), &moved(k));
                assert!(error < 1e-12 * 100.0, "{variant:?}, sample {k}: {error}");
            }
            assert!(dmp.is_over());
        }
    }
}

#[test]
fn sampled_orientation_reproduces_to_rounding() {
    let turn = |p: f64| Vector3::new(0.8 * p, -1.1 * p * p, 0.5 * (3.0 * p).sin());
    let orientations: Vec<UnitQuaternion<f64>> =
        (0..150).map(|k| so3::exp(&turn(f64::from(k) / 149.0))).collect();
    let demonstration = orientation_demonstration(1.0, &orientations).unwrap();
    let model = SampledModel::new(&Settings::default(), demonstration.positions()).unwrap();
    let mut dmp = SampledDmp::new(model);
    let goal = orientations[149];
    for orientation in &orientations[1..] {
        dmp.step();
        let found = so3::exp(&-Vector3::from_column_slice(dmp.position())) * goal;
        assert!(so3::log(&(found * orientation.inverse())).norm() < 1e-12);
    }
}

#[test]
fn sampled_movement_generalises_and_checks_stability() {
    let shown = DMatrix::from_fn(100, 1, |k, _| {
        let p = k as f64 / 99.0;
        p * p * (3.0 - 2.0 * p) + 0.2 * (std::f64::consts::TAU * p).sin() * p * (1.0 - p)
    });
    for variant in [Variant::Classic, Variant::GoalSafe, Variant::QuinticGoal] {
        let settings = Settings { variant, ..Settings::default() };
        let mut dmp = SampledDmp::new(SampledModel::new(&settings, &shown).unwrap());
        dmp.start(&[1.0], &[-3.0], 1.0).unwrap();
        (0..400).for_each(|_| dmp.step());
        assert!((dmp.position()[0] + 3.0).abs() < 1e-3, "{variant:?}: {:?}", dmp.position());
    }
    let coarse = DMatrix::from_fn(10, 1, |k, _| k as f64);
    let error = SampledModel::new(&Settings::default(), &coarse).unwrap_err().to_string();
    assert!(error.contains("at least 18 samples"), "{error}");
    let fine = DMatrix::from_fn(18, 1, |k, _| k as f64);
    assert!(SampledModel::new(&Settings::default(), &fine).is_ok());
}
