//! Shared latent spaces compared with GPy, and tested on synthetic arms.

use motorium_models::gplvm::{
    BackForm, FileError, LatentError, LatentModel, Poses, Prior, Settings, SpaceData, Workspace, compare,
    few_poses, transfer_and_training,
};

use crate::golden::{assert_close, numbers, read};

#[test]
fn energy_and_gradients_equal_gpy() {
    let golden = read("gplvm.json");
    let [x, y, parameters] = ["x", "y", "parameters"].map(|key| numbers(&golden[key]));
    let (energy, by_points, by_parameters) =
        LatentModel::energy(&x, &y, &parameters, &mut Workspace::default()).expect("an energy");
    assert_close(&[energy], &numbers(&golden["energy"]), 1e-8, "energy");
    assert_close(&by_points, &numbers(&golden["by_points"]), 1e-8, "by points");
    assert_close(&by_parameters, &numbers(&golden["by_parameters"]), 1e-8, "by parameters");
}

/// Poses of an arm driven by two hidden variables, with arm-specific directions and gains.
fn arm(columns: usize, phase: f64, rows: std::ops::Range<usize>) -> Vec<f64> {
    rows.flat_map(|i| {
        let (u, v) = ((0.37 * i as f64).sin(), (0.23 * i as f64 + 1.0).cos());
        (0..columns).map(move |c| {
            let angle = c as f64 + phase;
            (angle.cos() * u + angle.sin() * v).tanh() + 0.2 * u * v + 0.5 * phase
        })
    })
    .collect()
}

fn data<'a>(name: &'a str, columns: usize, values: &'a [f64]) -> SpaceData<'a> {
    SpaceData { name, columns: (0..columns).map(|c| format!("joint{c}")).collect(), values }
}

fn settings(back: Option<BackForm>) -> Settings {
    let back = back.map(|form| ("human".to_string(), form));
    Settings { latents: Some(2), iterations: 100, back, ..Settings::default() }
}

/// Returns the mean squared error on unseen poses, relative to the mean predictor's.
fn error_of(model: &LatentModel, robot: &str, columns: usize, phase: f64) -> f64 {
    let (human, truth) = (arm(6, 0.3, 60..90), arm(columns, phase, 60..90));
    let (from, to) = (model.space("human").expect("a space"), model.space(robot).expect("a space"));
    let (mut mean, mut variance) = (vec![0.0; columns], vec![0.0; columns]);
    let mut scratch = model.scratch();
    let mut sum = 0.0;
    for (human, truth) in human.chunks(6).zip(truth.chunks(columns)) {
        let x = model.latent_of_pose(from, human);
        model.predict(to, &x, &mut mean, &mut variance, &mut scratch);
        assert!(variance.iter().all(|v| *v > 0.0));
        sum += mean.iter().zip(truth).map(|(m, t)| (m - t) * (m - t)).sum::<f64>();
    }
    let means = &model.spaces()[to].mean;
    let mean_error = |row: &[f64]| row.iter().zip(means).map(|(t, m)| (t - m) * (t - m)).sum::<f64>();
    sum / truth.chunks(columns).map(mean_error).sum::<f64>()
}

#[test]
fn transfer_is_about_as_accurate_as_full_training() {
    let (human, first, second) = (arm(6, 0.3, 0..60), arm(4, 1.1, 0..60), arm(5, 2.0, 0..60));
    for back in [None, Some(BackForm::Kernel), Some(BackForm::Mlp), Some(BackForm::Pose)] {
        let spaces = [data("human", 6, &human), data("first", 4, &first)];
        let (mut model, trained) = LatentModel::train(&spaces, &settings(back)).expect("a model");
        assert!(trained.minimum.value < trained.start - 100.0, "{trained:?}");
        let before = model.latent();
        let transferred = model.transfer(&data("second", 5, &second), 100).expect("a transfer");
        assert_eq!(model.latent(), before, "the latent stays");
        assert_eq!(transferred.starts.len(), 3);
        let least = transferred.starts.iter().copied().fold(f64::INFINITY, f64::min);
        assert_eq!(transferred.minimum.value, least);
        assert_eq!(transferred.warning, None);
        let error = error_of(&model, "first", 4, 1.1);
        assert!(error < 0.1, "{back:?}: {error}");
        let spaces = [data("human", 6, &human), data("second", 5, &second)];
        let (whole, _) = LatentModel::train(&spaces, &settings(back)).expect("a model");
        let [transferred, trained] = [&model, &whole].map(|model| error_of(model, "second", 5, 2.0));
        assert!(transferred < 0.2 && transferred < 1.5 * trained, "{back:?}: {transferred} and {trained}");
    }
}

#[test]
fn a_robot_of_pure_noise_raises_a_warning() {
    let (human, first) = (arm(6, 0.3, 0..60), arm(4, 1.1, 0..60));
    let spaces = [data("human", 6, &human), data("first", 4, &first)];
    let (mut model, _) = LatentModel::train(&spaces, &settings(None)).expect("a model");
    // the order of the poses is unrelated to the human
    let noise: Vec<f64> = (0..180).map(|i| ((i * i * 7919) as f64 * 0.618_034).fract()).collect();
    let transferred = model.transfer(&data("noise", 3, &noise), 100).expect("a transfer");
    assert!(
        transferred.warning.is_some_and(|text| text.contains("hardly predict the poses of noise")),
        "a warning"
    );
}

/// Returns the errors of the default model and of the direct process on held-out poses, each with its
/// standard error.
fn default_and_direct(human: &Poses, robot: &Poses, folds: usize) -> [(f64, f64); 2] {
    let errors = compare(human, robot, &Settings::default(), folds).expect("errors");
    ["latent", "gaussian_process"].map(|name| {
        let found = errors.iter().find(|error| error.method == name).expect("a method");
        (found.mean, found.deviation / (folds as f64).sqrt())
    })
}

fn poses(name: &str, columns: usize, phase: f64) -> Poses {
    let values = arm(columns, phase, 0..60);
    let columns = (0..columns).map(|c| format!("joint{c}")).collect();
    Poses { name: name.into(), columns, values, starts: vec![0] }
}

#[test]
fn transfer_is_compared_with_training() {
    let (human, source, robot) = (poses("human", 6, 0.3), poses("first", 4, 1.1), poses("second", 5, 2.0));
    for (space, form) in [("human", BackForm::Pose), ("first", BackForm::Kernel)] {
        let settings = Settings { back: Some((space.to_string(), form)), ..settings(None) };
        let found = transfer_and_training(&human, &source, &robot, &settings, 3).expect("a result");
        let (transferred, trained) = (found.transferred, found.trained);
        assert!(transferred.mean < 2.0 * trained.mean && trained.error > 0.0, "{found:?}");
        assert!(found.transfer_seconds.mean > 0.0 && found.training_seconds.mean > 0.0);
    }
    let few = few_poses(&human, &source, &robot, &Settings::default(), &[6, 40], 2).expect("errors");
    let names: Vec<_> = few[0].errors.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["transferred", "alone", "gaussian_process", "ridge", "nearest", "mean"]);
    for method in [0, 1, 2, 4] {
        assert!(few[1].errors[method].1.mean < few[0].errors[method].1.mean, "{few:?}");
    }
    let error = few_poses(&human, &source, &robot, &Settings::default(), &[49], 2).expect_err("too many");
    assert_eq!(error.to_string(), "poses of the robot is 49, expected 2 to 48");
}

#[test]
fn the_default_is_as_good_as_a_direct_process() {
    let [latent, direct] = default_and_direct(&poses("human", 6, 0.3), &poses("first", 4, 1.1), 3);
    assert!(latent.0 <= direct.0 + direct.1, "{latent:?} and {direct:?}");
}

#[test]
fn the_default_is_as_good_as_a_direct_process_on_recorded_arms() {
    let folder =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/human-robot-arms");
    if !folder.is_dir() {
        return;
    }
    let read = |name: &str| Poses::read(&folder.join(format!("{name}.csv"))).expect("poses");
    for robot in ["coman", "walkman", "centauro"] {
        let [latent, direct] = default_and_direct(&read("human"), &read(robot), 2);
        println!("{robot}: latent {latent:?}, direct {direct:?}");
        assert!(latent.0 <= direct.0 + direct.1, "{robot}: {latent:?} and {direct:?}");
    }
}

#[test]
fn a_pose_may_keep_its_leading_components() {
    let (human, first) = (arm(6, 0.3, 0..60), arm(4, 1.1, 0..60));
    let spaces = [data("human", 6, &human), data("first", 4, &first)];
    let (model, _) = LatentModel::train(&spaces, &settings(Some(BackForm::Pose))).expect("a model");
    let x = model.latent();
    for d in 0..2 {
        let column = || x.iter().skip(d).step_by(2);
        let mean = column().sum::<f64>() / 60.0;
        let variance = column().map(|x| x * x).sum::<f64>() / 60.0;
        assert!(mean.abs() < 1e-9 && (variance - 1.0).abs() < 1e-9, "{mean} and {variance}");
    }
    let pose = &human[18..24];
    let mapped = model.latent_of_pose(0, pose);
    assert!(mapped.iter().zip(&x[6..8]).all(|(a, b)| (a - b).abs() < 1e-12), "{mapped:?}");
    let whole = Settings { latents: None, ..settings(Some(BackForm::Pose)) };
    let (model, _) = LatentModel::train(&spaces, &whole).expect("a model");
    assert_eq!(model.latents(), 6);
    let space = &model.spaces()[0];
    let standard: Vec<f64> =
        pose.iter().zip(&space.mean).zip(&space.scale).map(|((y, m), s)| (y - m) / s).collect();
    assert_eq!(model.latent_of_pose(0, pose), standard);
    let many = Settings { latents: Some(7), ..whole };
    let error = LatentModel::train(&spaces, &many).expect_err("too many").to_string();
    assert_eq!(error, "latents is 7, expected 1 to 6, the columns of the space human");
}

/// Trains on two noisy repetitions of a movement, with a prior.
fn rounds(prior: Prior) -> Result<LatentModel, LatentError> {
    let noise = |i: usize, c: usize| ((i * i + 31 * c) as f64 * 0.754_877).sin();
    let pose = |i: usize| {
        let angle = 0.2 * i as f64;
        (0..6).map(move |c| (angle + c as f64).cos() + 0.2 * noise(i, c))
    };
    let values: Vec<f64> = (0..60).flat_map(pose).collect();
    let columns = (0..6).map(|c| format!("joint{c}")).collect();
    let data = [SpaceData { name: "human", columns, values: &values }];
    let settings = Settings { latents: Some(2), back: None, prior, iterations: 100 };
    LatentModel::train(&data, &settings).map(|(model, _)| model)
}

#[test]
fn dynamics_smooth_the_latent_points_of_movements() {
    // mean second difference compared with the mean square
    let roughness = |model: &LatentModel| {
        let x = model.latent();
        let rows: Vec<&[f64]> = x.chunks_exact(2).take(30).collect();
        let second = |d: usize, i: usize| rows[i][d] - 2.0 * rows[i + 1][d] + rows[i + 2][d];
        let sum: f64 =
            (0..2).flat_map(|d| (0..28).map(move |i| (d, i))).map(|(d, i)| second(d, i).powi(2)).sum();
        sum / rows.iter().flat_map(|row| row.iter()).map(|x| x * x).sum::<f64>()
    };
    let dynamics = Prior::Dynamics { starts: vec![0, 30] };
    let (smooth, rough) = (rounds(dynamics).expect("a model"), rounds(Prior::Normal).expect("a model"));
    assert!(roughness(&smooth) < 0.5 * roughness(&rough), "{} {}", roughness(&smooth), roughness(&rough));
    let no_movement = rounds(Prior::Dynamics { starts: (0..60).collect() });
    assert!(matches!(no_movement, Err(LatentError::Setting { setting: "start of a movement", .. })));
}

#[test]
fn files_restore_the_model_bit_for_bit() {
    let (human, first) = (arm(6, 0.3, 0..30), arm(4, 1.1, 0..30));
    let spaces = [data("human", 6, &human), data("first", 4, &first)];
    for back in [None, Some(BackForm::Kernel), Some(BackForm::Mlp), Some(BackForm::Pose)] {
        let (model, _) = LatentModel::train(&spaces, &settings(back)).expect("a model");
        let text = model.to_text();
        let read = LatentModel::from_text(&text).expect("a model");
        assert_eq!(read.to_text(), text);
        assert_eq!(error_of(&read, "first", 4, 1.1), error_of(&model, "first", 4, 1.1));
        let damaged = text.replacen("\"latents\":2", "\"latents\":3", 1);
        assert!(matches!(LatentModel::from_text(&damaged), Err(FileError::Checksum { .. })));
        let newer = text.replacen(" 1 ", " 2 ", 1);
        assert!(matches!(LatentModel::from_text(&newer), Err(FileError::Version { .. })));
        assert!(matches!(LatentModel::from_text("{}"), Err(FileError::Header { .. })));
    }
}

#[test]
fn mistakes_are_named() {
    let (human, first) = (arm(6, 0.3, 0..30), arm(4, 1.1, 0..29));
    let spaces = [data("human", 6, &human), data("first", 4, &first)];
    let error = LatentModel::train(&spaces, &settings(None)).expect_err("poses");
    assert_eq!(error.to_string(), "space first: found 29 poses, expected 30");
    let error = LatentModel::train(&spaces[..1], &Settings { latents: Some(7), ..settings(None) })
        .expect_err("latents");
    assert!(matches!(error, LatentError::Setting { setting: "latents", .. }), "{error}");
    let back = Some(("robot".to_string(), BackForm::Mlp));
    let error = LatentModel::train(&spaces[..1], &Settings { back, ..settings(None) }).expect_err("unknown");
    assert_eq!(error.to_string(), "unknown space robot, expected one of [\"human\"]");
    let twice = [data("human", 6, &human), data("human", 6, &human)];
    let error = LatentModel::train(&twice, &settings(None)).expect_err("twice");
    assert!(matches!(error, LatentError::SameName { .. }), "{error}");
}
