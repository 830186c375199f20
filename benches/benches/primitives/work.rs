//! The measured calls.

use std::hint::black_box;

use motorium_benches::peers::Work;
use motorium_primitives::cpg::{Gait, LegSettings, PhaseNetwork};
use motorium_primitives::dmp::{
    Demonstration, DiscreteDmp, DmpModel, Regression, RhythmicDmp, RhythmicModel, RhythmicSettings, Settings,
    Variant,
};
use motorium_primitives::promp::{ProMp, ProMpBasis, ProMpFit};
use nalgebra::{DMatrix, DVector};

/// Degrees of freedom, kernels and samples of the figures.
pub(crate) const DIMENSIONS: usize = 14;
pub(crate) const KERNELS: usize = 50;
pub(crate) const SAMPLES: usize = 200;

/// The movement that all sides learn: `sin((d + 1) pi p / 4) + p^2`, one second long. The peers generate the
/// same.
fn positions() -> DMatrix<f64> {
    DMatrix::from_fn(SAMPLES, DIMENSIONS, |k, d| {
        let p = k as f64 / (SAMPLES - 1) as f64;
        ((d + 1) as f64 * std::f64::consts::PI * p / 4.0).sin() + p * p
    })
}

fn settings(variant: Variant) -> Settings {
    Settings { variant, kernels: KERNELS, ..Settings::default() }
}

fn demonstration() -> Demonstration {
    Demonstration::from_positions(1.0, positions()).expect("the movement is smooth and finite")
}

fn fitted(variant: Variant) -> DiscreteDmp {
    let model = DmpModel::fit(settings(variant), &[demonstration()], Regression::default());
    DiscreteDmp::new(model.expect("200 samples determine 50 kernels"))
}

/// Steps endlessly: restarts at the end.
fn stepping(variant: Variant) -> Box<dyn FnMut()> {
    let mut dmp = fitted(variant);
    let dt = 1.0 / (SAMPLES - 1) as f64;
    let mut left = 0;
    Box::new(move || {
        if left == 0 {
            dmp.start(&[0.0; DIMENSIONS], &[1.0; DIMENSIONS], 1.0).expect("finite numbers");
            left = SAMPLES;
        }
        left -= 1;
        dmp.step(black_box(dt));
        black_box(dmp.position());
    })
}

fn rolling_out(variant: Variant) -> Box<dyn FnMut()> {
    let mut dmp = fitted(variant);
    let dt = 1.0 / (SAMPLES - 1) as f64;
    Box::new(move || {
        dmp.start(&[0.0; DIMENSIONS], black_box(&[1.0; DIMENSIONS]), 1.0).expect("finite numbers");
        for _ in 0..SAMPLES {
            dmp.step(dt);
        }
        black_box(dmp.position());
    })
}

fn fitting(variant: Variant) -> Box<dyn FnMut()> {
    let positions = positions();
    Box::new(move || {
        let demonstration = Demonstration::from_positions(1.0, black_box(&positions).clone());
        let demonstration = demonstration.expect("the movement is smooth and finite");
        let model = DmpModel::fit(settings(variant), &[demonstration], Regression::default());
        black_box(model.expect("200 samples determine 50 kernels"));
    })
}

fn rhythm() -> Box<dyn FnMut()> {
    let period = DMatrix::from_fn(SAMPLES, DIMENSIONS, |k, d| {
        ((d + 1) as f64 * std::f64::consts::TAU * k as f64 / SAMPLES as f64).sin()
    });
    let settings = RhythmicSettings { kernels: KERNELS, ..RhythmicSettings::default() };
    let model = RhythmicModel::fit(settings, &[period], 1e-12).expect("200 samples determine 50 kernels");
    let mut dmp = RhythmicDmp::new(model);
    Box::new(move || {
        dmp.step(black_box(1e-3));
        black_box(dmp.position());
    })
}

fn gait() -> Box<dyn FnMut()> {
    let settings = vec![LegSettings::default(); 6];
    let mut network =
        PhaseNetwork::of_gait(Gait::Tripod, &settings, 5.0).expect("six legs have a tripod gait");
    Box::new(move || {
        network.step(black_box(1e-3));
        black_box(network.output());
    })
}

/// Ten noisy demonstrations of two dimensions, 101 samples each. The peers generate the same ones with other
/// noise.
fn demonstrations() -> Vec<DMatrix<f64>> {
    (0..10)
        .map(|n| {
            DMatrix::from_fn(101, 2, |k, d| {
                let p = k as f64 / 100.0;
                let wobble = ((n * 7 + d * 3 + 1) as f64).sin();
                (std::f64::consts::PI * (p + 0.2 * d as f64)).sin() * (1.0 + 0.1 * wobble) + 0.05 * wobble * p
            })
        })
        .collect()
}

fn promp_fitting() -> Box<dyn FnMut()> {
    let demonstrations = demonstrations();
    let basis = ProMpBasis::gaussian(20, 0.7).expect("twenty kernels are some");
    Box::new(move || {
        let promp = ProMp::fit(basis, black_box(&demonstrations), &ProMpFit::default());
        black_box(promp.expect("ten demonstrations are enough"));
    })
}

fn promp_conditioning() -> Box<dyn FnMut()> {
    let basis = ProMpBasis::gaussian(20, 0.7).expect("twenty kernels are some");
    let promp = ProMp::fit(basis, &demonstrations(), &ProMpFit::default()).expect("ten are enough");
    let (place, noise) = (DVector::from_vec(vec![0.9, 0.8]), DMatrix::identity(2, 2) * 1e-6);
    Box::new(move || {
        black_box(promp.conditioned(black_box(0.5), &place, &noise).expect("a place within reach"));
    })
}

/// Returns all calls, in the order of the table.
pub(crate) fn all() -> Vec<Work> {
    let work = |name, run| Work { name, run };
    vec![
        work("step_classic", stepping(Variant::Classic)),
        work("step_quintic_goal", stepping(Variant::QuinticGoal)),
        work("fit_classic", fitting(Variant::Classic)),
        work("fit_quintic_goal", fitting(Variant::QuinticGoal)),
        work("rollout_classic", rolling_out(Variant::Classic)),
        work("rollout_quintic_goal", rolling_out(Variant::QuinticGoal)),
        work("step_rhythmic", rhythm()),
        work("step_tripod_gait", gait()),
        work("promp_em", promp_fitting()),
        work("promp_condition", promp_conditioning()),
    ]
}
