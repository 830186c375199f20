//! Movements of primitives in evenly spaced samples, against closed forms.

use std::f64::consts::TAU;

use motorium_primitives::dmp::{
    Demonstration, DmpModel, Regression, RhythmicModel, RhythmicSettings, Settings, Variant,
};
use motorium_primitives::file::PrimitiveFile;
use motorium_primitives::promp::{ProMp, ProMpBasis, ProMpFit};
use motorium_primitives::rollout::{Override, RolloutError, ViaPoint, reproduce, roll_out};
use nalgebra::DMatrix;

/// Minimum jerk from 0 to 1.
fn stroke(p: f64) -> f64 {
    p * p * p * (10.0 - 15.0 * p + 6.0 * p * p)
}

/// A stroke of two dimensions in 2 s, from (0, 0) to (1, -2).
fn discrete(variant: Variant) -> PrimitiveFile {
    let positions = DMatrix::from_fn(401, 2, |k, d| [1.0, -2.0][d] * stroke(k as f64 / 400.0));
    let shown = [Demonstration::from_positions(2.0, positions).unwrap()];
    let settings = Settings { variant, ..Settings::default() };
    let model = DmpModel::fit(settings, &shown, Regression::default()).unwrap();
    PrimitiveFile::discrete(vec!["x".into(), "y".into()], &shown, model)
}

fn rhythm() -> PrimitiveFile {
    let period = DMatrix::from_fn(200, 1, |k, _| 0.5 + (TAU * k as f64 / 200.0).sin());
    let model =
        RhythmicModel::fit(RhythmicSettings::default(), std::slice::from_ref(&period), 1e-12).unwrap();
    PrimitiveFile::rhythmic(vec!["a".into()], 1.5, &[period], model)
}

fn distribution() -> PrimitiveFile {
    let shown: Vec<DMatrix<f64>> = [0.8, 0.9, 1.0, 1.1, 1.2]
        .iter()
        .map(|size| DMatrix::from_fn(100, 1, |k, _| size * stroke(k as f64 / 99.0)))
        .collect();
    let basis = ProMpBasis::gaussian(12, 0.7).unwrap();
    let mut promp = ProMp::fit(basis, &shown, &ProMpFit::default()).unwrap();
    promp.set_duration(2.0).unwrap();
    PrimitiveFile::probabilistic(vec!["z".into()], promp)
}

#[test]
fn stroke_file_holds_start_and_end_states() {
    let file = discrete(Variant::QuinticGoal);
    assert_eq!((file.start.as_slice(), file.goal.as_slice()), (&[0.0, 0.0][..], &[1.0, -2.0][..]));
    assert!(file.start_velocity.iter().chain(&file.final_velocity).all(|v| v.abs() < 1e-3));
    assert_eq!(file.duration, 2.0);
    let rhythm = rhythm();
    // the derivative of a unit sine of 1.5 s at its upward crossing
    assert!((rhythm.start_velocity[0] - TAU / 1.5).abs() < 2e-3 && (rhythm.goal[0] - 0.5).abs() < 1e-9);
    let mean = distribution();
    assert!((mean.goal[0] - 1.0).abs() < 0.02 && mean.start[0].abs() < 0.02, "{mean:?}");
}

#[test]
fn stroke_is_reproduced_and_generalised() {
    for variant in [Variant::Classic, Variant::GoalSafe, Variant::QuinticGoal] {
        let file = discrete(variant);
        let shown = roll_out(&file, &Override::default(), 0.02).unwrap();
        assert_eq!((shown.time.len(), shown.time[100]), (101, 2.0));
        for k in 0..=100 {
            let expected = stroke(k as f64 / 100.0);
            assert!((shown.position[k][0] - expected).abs() < 5e-3, "{variant:?} {k}");
        }
    }
    let there = Override {
        start: Some(vec![1.0, 1.0]),
        goal: Some(vec![3.0, -3.0]),
        duration: Some(1.0),
        ..Override::default()
    };
    let moved = roll_out(&discrete(Variant::QuinticGoal), &there, 0.01).unwrap();
    for k in 0..=100 {
        // with fixed scaling the demonstrated shape is kept, and the rest of the movement is minimum-jerk
        let p = stroke(k as f64 / 100.0);
        assert!((moved.position[k][0] - (1.0 + 2.0 * p)).abs() < 5e-3, "{k}: {:?}", moved.position[k]);
        assert!((moved.position[k][1] - (1.0 - 4.0 * p)).abs() < 5e-3, "{k}: {:?}", moved.position[k]);
    }
    assert!(moved.deviation.is_none());
}

#[test]
fn strike_arrives_with_the_commanded_velocity() {
    let file = discrete(Variant::FinalVelocity);
    let strike = Override { final_velocity: Some(vec![0.5, 0.25]), ..Override::default() };
    let moved = roll_out(&file, &strike, 0.01).unwrap();
    let last = moved.velocity.last().unwrap();
    assert!((last[0] - 0.5).abs() < 2e-2 && (last[1] - 0.25).abs() < 2e-2, "{last:?}");
    let refused = roll_out(&discrete(Variant::Classic), &strike, 0.01);
    assert!(matches!(refused, Err(RolloutError::Move(_))), "{refused:?}");
}

#[test]
fn rhythm_lasts_the_given_periods_and_amplitude() {
    let overrides = Override {
        duration: Some(0.5),
        periods: Some(3.0),
        amplitude: Some(2.0),
        goal: Some(vec![1.0]),
        ..Override::default()
    };
    let moved = roll_out(&rhythm(), &overrides, 0.005).unwrap();
    assert_eq!(moved.time.len(), 301);
    // the last period, after the transient of the start
    for k in 200..=300 {
        let expected = 1.0 + 2.0 * (TAU * k as f64 / 100.0).sin();
        assert!((moved.position[k][0] - expected).abs() < 0.05, "{k}: {}", moved.position[k][0]);
    }
}

#[test]
fn distribution_passes_via_points_with_less_variance() {
    let via = ViaPoint { phase: 0.5, position: vec![0.6], deviation: 1e-3 };
    let free = roll_out(&distribution(), &Override::default(), 0.02).unwrap();
    let bent = roll_out(&distribution(), &Override { via: vec![via], ..Override::default() }, 0.02).unwrap();
    assert!((bent.position[50][0] - 0.6).abs() < 2e-3, "{}", bent.position[50][0]);
    let deviation =
        |moved: &motorium_primitives::rollout::Trajectory| moved.deviation.as_ref().unwrap()[50][0];
    assert!(deviation(&bent) < 2e-3 && deviation(&free) > 0.03, "{} {}", deviation(&bent), deviation(&free));
}

#[test]
fn demonstrations_are_reproduced_sample_by_sample() {
    let demonstrations = |rows: usize, f: &dyn Fn(f64) -> f64| {
        vec![(2.0, DMatrix::from_fn(rows, 2, |k, d| [1.0, -2.0][d] * f(k as f64 / (rows - 1) as f64)))]
    };
    let shown = demonstrations(101, &stroke);
    let reproduced = reproduce(&discrete(Variant::QuinticGoal), &shown).unwrap();
    assert_eq!(reproduced[0].position.len(), 101);
    let off = (0..101).map(|k| (reproduced[0].position[k][1] - shown[0].1[(k, 1)]).abs()).fold(0.0, f64::max);
    assert!(off < 1e-2, "{off}");
    let period = vec![(1.5, DMatrix::from_fn(150, 1, |k, _| 0.5 + (TAU * k as f64 / 150.0).sin()))];
    let reproduced = reproduce(&rhythm(), &period).unwrap();
    assert!(reproduced[0].position.len() >= 150);
    let off =
        (0..150).map(|k| (reproduced[0].position[k][0] - period[0].1[(k, 0)]).abs()).fold(0.0, f64::max);
    assert!(off < 0.02, "{off}");
}

#[test]
fn unsupported_overrides_are_rejected() {
    let via = ViaPoint { phase: 0.5, position: vec![0.6], deviation: 1e-3 };
    let refused =
        |file: &PrimitiveFile, overrides: Override| roll_out(file, &overrides, 0.01).unwrap_err().to_string();
    let error = refused(&discrete(Variant::Classic), Override { via: vec![via], ..Override::default() });
    assert!(
        error.starts_with("a discrete primitive accepts a start, a goal and a duration, but no via"),
        "{error}"
    );
    let error = refused(&rhythm(), Override { final_velocity: Some(vec![1.0]), ..Override::default() });
    assert!(error.starts_with("a rhythmic primitive"), "{error}");
    let error = refused(&distribution(), Override { periods: Some(1.0), ..Override::default() });
    assert!(error.starts_with("a probabilistic primitive"), "{error}");
    let error = refused(&rhythm(), Override { goal: Some(vec![1.0, 2.0]), ..Override::default() });
    assert!(error.contains('2'), "{error}");
    let error = refused(&rhythm(), Override { duration: Some(1e9), ..Override::default() });
    assert!(error.contains("choose a lower rate"), "{error}");
}

#[test]
fn contradictory_via_points_are_rejected() {
    let via = |place: f64, deviation| ViaPoint { phase: 0.5, position: vec![place], deviation };
    let both =
        |deviation| Override { via: vec![via(0.55, deviation), via(0.6, deviation)], ..Override::default() };
    let error = roll_out(&distribution(), &both(1e-4), 0.02).unwrap_err();
    assert!(matches!(error, RolloutError::Unmet { phase: 0.5, dimension: 0, .. }), "{error}");
    assert!(roll_out(&distribution(), &both(0.02), 0.02).is_ok());
}

#[test]
fn integration_steps_are_bounded() {
    let years = Override { duration: Some(2e9), ..Override::default() };
    let moved = roll_out(&discrete(Variant::QuinticGoal), &years, 1e7).unwrap();
    assert_eq!(moved.time.len(), 201);
    assert!((moved.position[200][0] - 1.0).abs() < 5e-3, "{:?}", moved.position[200]);
}
