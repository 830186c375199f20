//! Properties of discrete primitives, common to all variants.

use motorium_primitives::dmp::{DiscreteDmp, DmpModel, MoveError, Scaling, Settings, Variant};
use nalgebra::{DMatrix, DVector};

const VARIANTS: [Variant; 3] = [Variant::Classic, Variant::GoalSafe, Variant::QuinticGoal];

/// A model of `dimensions` with weights that bend the path by some tenths, and the displacement 1 in every
/// dimension.
fn bent(dimensions: usize, settings: Settings) -> DmpModel {
    let size = if settings.variant == Variant::GoalSafe { 0.8 } else { 120.0 };
    let weights =
        DMatrix::from_fn(settings.kernels, dimensions, |i, d| size * (1.7 * i as f64 + 0.9 * d as f64).sin());
    DmpModel::with_weights(settings, weights, DVector::from_element(dimensions, 1.0)).unwrap()
}

fn variant(variant: Variant) -> Settings {
    Settings { variant, ..Settings::default() }
}

fn run(dmp: &mut DiscreteDmp, dt: f64, steps: usize) -> Vec<Vec<f64>> {
    (0..steps)
        .map(|_| {
            dmp.step(dt);
            dmp.position().to_vec()
        })
        .collect()
}

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= tolerance, "{found:?} instead of {expected:?}");
    }
}

#[test]
fn unforced_classic_is_a_critically_damped_spring() {
    let mut dmp = DiscreteDmp::new(DmpModel::new(1, variant(Variant::Classic)).unwrap());
    let (start, goal, duration) = (0.3, -0.9, 2.5);
    dmp.start(&[start], &[goal], duration).unwrap();
    let mut t = 0.0;
    for dt in [1e-3, 0.02, 0.3, 1e-4, 0.5].into_iter().cycle().take(40) {
        dmp.step(dt);
        t += dt;
        let x = 12.5 * t / duration;
        let expected = goal + (start - goal) * (1.0 + x) * (-x).exp();
        assert!((dmp.position()[0] - expected).abs() < 1e-12, "at {t} s");
    }
}

#[test]
fn unforced_quintic_goal_arrives_at_rest_on_time() {
    let mut dmp = DiscreteDmp::new(DmpModel::new(2, variant(Variant::QuinticGoal)).unwrap());
    dmp.start(&[0.0, 1.0], &[2.0, -1.0], 1.5).unwrap();
    for k in 1..=1500 {
        dmp.step(1e-3);
        let t = f64::from(k) / 1500.0;
        let share = t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t);
        assert_close(dmp.position(), &[2.0 * share, 1.0 - 2.0 * share], 1e-12);
    }
    assert_close(dmp.position(), &[2.0, -1.0], 1e-15);
    assert_close(dmp.velocity(), &[0.0; 2], 1e-10);
    assert_close(dmp.acceleration(), &[0.0; 2], 1e-8);
}

#[test]
fn longer_duration_preserves_the_path() {
    for form in VARIANTS {
        let (mut quick, mut slow) =
            (DiscreteDmp::new(bent(2, variant(form))), DiscreteDmp::new(bent(2, variant(form))));
        quick.start(&[0.1, 0.2], &[0.8, -0.3], 0.5).unwrap();
        slow.start(&[0.1, 0.2], &[0.8, -0.3], 3.5).unwrap();
        for _ in 0..600 {
            quick.step(1e-3);
            slow.step(7e-3);
            assert_close(quick.position(), slow.position(), 1e-11);
            let velocity: Vec<f64> = slow.velocity().iter().map(|v| 7.0 * v).collect();
            assert_close(quick.velocity(), &velocity, 1e-10);
            let acceleration: Vec<f64> = slow.acceleration().iter().map(|a| 49.0 * a).collect();
            assert_close(quick.acceleration(), &acceleration, 1e-8);
        }
    }
}

#[test]
fn displacement_scaling_preserves_proportions() {
    for form in VARIANTS {
        let settings = Settings { scaling: Scaling::Displacement { limit: 100.0 }, ..variant(form) };
        let mut once = DiscreteDmp::new(bent(1, settings.clone()));
        let mut other = DiscreteDmp::new(bent(1, settings));
        once.start(&[0.0], &[1.0], 1.0).unwrap();
        other.start(&[0.5], &[-3.5], 1.0).unwrap();
        for (a, b) in run(&mut once, 1e-3, 1200).iter().zip(run(&mut other, 1e-3, 1200)) {
            assert!((b[0] - (0.5 - 4.0 * a[0])).abs() < 1e-11);
        }
    }
}

#[test]
fn similarity_rotates_and_scales_the_whole_path() {
    for form in VARIANTS {
        let settings = Settings { scaling: Scaling::Similarity { limit: 100.0 }, ..variant(form) };
        let mut once = DiscreteDmp::new(bent(2, settings.clone()));
        let mut other = DiscreteDmp::new(bent(2, settings));
        // the displacement (1, 1), rotated by a quarter turn and three times as long
        once.start(&[0.0, 0.0], &[1.0, 1.0], 1.0).unwrap();
        other.start(&[2.0, 2.0], &[-1.0, 5.0], 1.0).unwrap();
        for (a, b) in run(&mut once, 1e-3, 1200).iter().zip(run(&mut other, 1e-3, 1200)) {
            assert_close(&b, &[2.0 - 3.0 * a[1], 2.0 + 3.0 * a[0]], 1e-11);
        }
    }
}

#[test]
fn velocity_and_acceleration_match_position_differences() {
    for form in VARIANTS {
        let mut dmp = DiscreteDmp::new(bent(3, variant(form)));
        dmp.start_moving([&[0.0, 0.5, 1.0], &[0.3, 0.0, -1.0], &[0.0; 3]], &[1.0, -1.0, 1.0], 1.3).unwrap();
        let h = 1e-4;
        let mut states = Vec::new();
        for _ in 0..16_000 {
            dmp.step(h);
            states.push([dmp.position().to_vec(), dmp.velocity().to_vec(), dmp.acceleration().to_vec()]);
        }
        for three in states.windows(3) {
            let [before, here, after] = three else { unreachable!("windows of three") };
            let slopes =
                |which: usize| after[which].iter().zip(&before[which]).map(move |(b, a)| (b - a) / (2.0 * h));
            assert!(slopes(0).zip(&here[1]).all(|(slope, v)| (slope - v).abs() < 2e-5), "{form:?}");
            // the finite gate has a kink at the end of the movement
            assert!(slopes(1).zip(&here[2]).all(|(slope, a)| (slope - a).abs() < 1e-2), "{form:?}");
        }
    }
}

#[test]
fn goal_at_the_start_is_reached_with_a_bounded_path() {
    for scaling in [Scaling::Fixed, Scaling::Displacement { limit: 5.0 }, Scaling::Similarity { limit: 5.0 }]
    {
        for form in VARIANTS {
            let mut dmp = DiscreteDmp::new(bent(2, Settings { scaling, ..variant(form) }));
            dmp.start(&[0.4, 0.4], &[0.4, 0.4], 1.0).unwrap();
            let path = run(&mut dmp, 1e-3, 3000);
            assert!(path.iter().flatten().all(|y| (y - 0.4).abs() < 1.0), "{form:?} {scaling:?}");
            assert_close(&path[2999], &[0.4, 0.4], 1e-3);
        }
    }
}

#[test]
fn scale_limit_bounds_nearly_closed_demonstrations() {
    let settings = Settings { scaling: Scaling::Displacement { limit: 2.0 }, ..variant(Variant::Classic) };
    let weights = bent(1, settings.clone()).weights().clone();
    let model = DmpModel::with_weights(settings, weights, DVector::from_element(1, 1e-7)).unwrap();
    let mut dmp = DiscreteDmp::new(model);
    dmp.start(&[0.0], &[1.0], 1.0).unwrap();
    assert!(run(&mut dmp, 1e-3, 2000).iter().all(|y| y[0].abs() < 3.0));
}

#[test]
fn changed_goal_is_reached_without_a_jump() {
    for form in VARIANTS {
        for change_at in [1, 300, 900, 999, 1400] {
            let mut dmp = DiscreteDmp::new(bent(1, variant(form)));
            dmp.start(&[0.0], &[1.0], 1.0).unwrap();
            run(&mut dmp, 1e-3, change_at);
            let before = [dmp.position()[0], dmp.velocity()[0], dmp.acceleration()[0]];
            dmp.set_goal(&[-0.7]).unwrap();
            let after = [dmp.position()[0], dmp.velocity()[0], dmp.acceleration()[0]];
            assert_close(&after[..2], &before[..2], 1e-12);
            if form == Variant::QuinticGoal {
                assert_close(&after, &before, 1e-9);
            }
            run(&mut dmp, 1e-3, 3000);
            assert!(dmp.is_over());
            assert!((dmp.position()[0] + 0.7).abs() < 1e-3, "{form:?}: {}", dmp.position()[0]);
        }
    }
}

#[test]
fn goal_reset_to_the_start_has_bounded_overshoot() {
    for form in VARIANTS {
        let mut dmp = DiscreteDmp::new(DmpModel::new(1, variant(form)).unwrap());
        dmp.start(&[0.0], &[1.0], 1.0).unwrap();
        let made = run(&mut dmp, 1e-3, 400)[399][0];
        dmp.set_goal(&[0.0]).unwrap();
        let rest = run(&mut dmp, 1e-3, 3000);
        let (low, high) =
            rest.iter().fold((f64::MAX, f64::MIN), |(low, high), y| (low.min(y[0]), high.max(y[0])));
        assert!(low > -0.05 && high < made + 0.5, "{form:?}: between {low} and {high}");
    }
}

#[test]
fn moving_goal_is_reached_after_it_stops() {
    for form in VARIANTS {
        let mut dmp = DiscreteDmp::new(bent(1, variant(form)));
        dmp.start(&[0.0], &[1.0], 0.8).unwrap();
        let mut fastest = 0.0_f64;
        for k in 0..2000 {
            let t = 1e-3 * f64::from(k);
            dmp.set_goal(&[1.0 + 0.3 * (4.0 * t).sin()]).unwrap();
            dmp.step(1e-3);
            fastest = fastest.max(dmp.velocity()[0].abs());
        }
        assert!(fastest < 10.0, "{form:?}: {fastest}");
        run(&mut dmp, 1e-3, 3000);
        assert!((dmp.position()[0] - dmp.goal()[0]).abs() < 1e-4, "{form:?}");
    }
}

#[test]
fn goal_filter_follows_the_published_rate() {
    let settings = Settings { goal_rate: Some(10.0), ..variant(Variant::GoalSafe) };
    let mut dmp = DiscreteDmp::new(DmpModel::new(1, settings).unwrap());
    // long after the start the spring is at rest, and its acceleration shows its equilibrium
    dmp.start(&[0.0], &[0.0], 1.0).unwrap();
    run(&mut dmp, 1e-3, 20_000);
    dmp.set_goal(&[1.0]).unwrap();
    assert!(dmp.acceleration()[0].abs() < 1e-9, "the goal jumped");
    for _ in 0..100 {
        dmp.step(1e-3);
    }
    let drawn_to = (dmp.acceleration()[0] + 25.0 * dmp.velocity()[0]) / 156.25 + dmp.position()[0];
    assert!((drawn_to - (1.0 - (-1.0_f64).exp())).abs() < 1e-9, "{drawn_to}");
}

#[test]
fn new_duration_keeps_position_and_velocity_continuous() {
    for form in VARIANTS {
        let mut dmp = DiscreteDmp::new(bent(2, variant(form)));
        dmp.start(&[0.0, 1.0], &[1.0, 0.0], 1.0).unwrap();
        run(&mut dmp, 1e-3, 400);
        let before = [dmp.position().to_vec(), dmp.velocity().to_vec()];
        dmp.set_duration(4.0).unwrap();
        assert_close(dmp.position(), &before[0], 1e-12);
        assert_close(dmp.velocity(), &before[1], 1e-12);
        let steps = (0..10_000).take_while(|_| {
            dmp.step(1e-3);
            !dmp.is_over()
        });
        assert!((steps.count() as i64 - 2400).abs() <= 1, "0.6 of 4 s remain");
        run(&mut dmp, 1e-3, 8000);
        assert_close(dmp.position(), &[1.0, 0.0], 1e-3);
    }
}

#[test]
fn invalid_commands_leave_the_movement_unchanged() {
    let mut dmp = DiscreteDmp::new(bent(2, variant(Variant::QuinticGoal)));
    dmp.start(&[0.0, 0.0], &[1.0, 1.0], 1.0).unwrap();
    run(&mut dmp, 1e-3, 100);
    let before = format!("{dmp:?}");
    let error = dmp.start(&[0.0], &[1.0, 1.0], 1.0).unwrap_err();
    assert_eq!(error, MoveError::Dimensions { name: "start", found: 1, expected: 2 });
    assert_eq!(error.to_string(), "start has 1 entries, expected 2, one per dimension of the primitive");
    let error = dmp.start(&[0.0, 0.0], &[1.0, f64::NAN], 1.0).unwrap_err();
    assert_eq!(error.to_string(), "goal contains NaN, expected only finite numbers");
    assert_eq!(dmp.set_duration(0.0).unwrap_err(), MoveError::Duration { found: 0.0 });
    assert!(dmp.set_goal(&[f64::INFINITY, 0.0]).is_err());
    dmp.step(f64::NAN);
    dmp.step(-1.0);
    assert_eq!(format!("{dmp:?}"), before);
}
