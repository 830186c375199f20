//! Transfer experiments: comparison with full training, and transfer with few poses of the robot.

use std::time::Instant;

use rand_distr::{Distribution, StandardUniform};
use rand_pcg::Pcg64;

use super::evaluate::{Baseline, check_pair};
use super::poses::Poses;
use super::{LatentError, LatentModel, Settings, SpaceData};

/// A mean over splits with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Mean over the splits.
    pub mean: f64,
    /// Standard error of the mean.
    pub error: f64,
}

impl Estimate {
    /// Computes the estimate from one value per split.
    pub fn from_splits(values: &[f64]) -> Self {
        let n = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        Self { mean, error: (squares / (n - 1.0).max(1.0) / n).sqrt() }
    }
}

/// Comparison of two models: in one, the robot was added after training; the other was trained with the robot
/// from the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransferResult {
    /// Mean squared error of the added robot on held-out poses.
    pub transferred: Estimate,
    /// Mean squared error of a model trained for the human and this robot.
    pub trained: Estimate,
    /// Duration of adding the robot, s.
    pub transfer_seconds: Estimate,
    /// Duration of the training, s.
    pub training_seconds: Estimate,
}

/// Errors for a given number of poses of the robot.
#[derive(Clone, Debug, PartialEq)]
pub struct FewPoses {
    /// Number of poses of the robot.
    pub poses: usize,
    /// Mean squared error of each method on held-out poses: `transferred` (the robot was added to the latent
    /// space of `source`), `alone` (a model of the human and the robot, trained with only these poses), and
    /// methods without a latent space.
    pub errors: Vec<(&'static str, Estimate)>,
}

/// Returns the mean squared error of a robot's poses predicted from the human's; the spaces of the model are
/// `0` and `robot`.
fn error_of(model: &LatentModel, robot: usize, human: &Poses, truth: &Poses) -> f64 {
    let d = truth.columns.len();
    let (mut mean, mut variance, mut scratch) = (vec![0.0; d], vec![0.0; d], model.scratch());
    let rows = human.values.chunks_exact(human.columns.len()).zip(truth.values.chunks_exact(d));
    let squares: f64 = rows
        .map(|(pose, truth)| {
            let x = model.latent_of_pose(0, pose);
            model.predict(robot, &x, &mut mean, &mut variance, &mut scratch);
            mean.iter().zip(truth).map(|(m, t)| (m - t) * (m - t)).sum::<f64>()
        })
        .sum();
    squares / truth.values.len() as f64
}

/// For each split, trains a model of the human and `source`, to which `robot` is then transferred, and a
/// second model of the human and `robot`. Split `k` of `folds` holds out every `folds`th pose.
///
/// # Errors
/// [`LatentError`] if sizes do not match, or `folds` is out of range.
pub fn transfer_and_training(
    human: &Poses,
    source: &Poses,
    robot: &Poses,
    settings: &Settings,
    folds: usize,
) -> Result<TransferResult, LatentError> {
    check_pair(human, source, folds)?;
    check_pair(human, robot, folds)?;
    let mut found = [const { vec![] }; 4];
    for fold in 0..folds {
        let [train_human, train_source, train_robot] =
            [human, source, robot].map(|poses| poses.select(|i| i % folds != fold));
        let [test_human, test_robot] = [human, robot].map(|poses| poses.select(|i| i % folds == fold));
        let mut model = LatentModel::train(&[train_human.data(), train_source.data()], settings)?.0;
        let start = Instant::now();
        model.transfer(&train_robot.data(), settings.iterations)?;
        found[2].push(start.elapsed().as_secs_f64());
        found[0].push(error_of(&model, 2, &test_human, &test_robot));
        // a back constraint on the source's space applies to the robot's space here
        let mut own = settings.clone();
        if let Some((space, _)) = own.back.as_mut().filter(|(space, _)| *space == source.name) {
            space.clone_from(&robot.name);
        }
        let start = Instant::now();
        let whole = LatentModel::train(&[train_human.data(), train_robot.data()], &own)?.0;
        found[3].push(start.elapsed().as_secs_f64());
        found[1].push(error_of(&whole, 1, &test_human, &test_robot));
    }
    let [transferred, trained, transfer_seconds, training_seconds] =
        found.map(|values| Estimate::from_splits(&values));
    Ok(TransferResult { transferred, trained, transfer_seconds, training_seconds })
}

/// Trains one model of the human and all `robots` for each split, as in [`transfer_and_training`]. Returns
/// the mean squared error of each robot's held-out poses.
///
/// # Errors
/// [`LatentError`] if sizes do not match, or `folds` is out of range.
pub fn trained_together(
    human: &Poses,
    robots: &[&Poses],
    settings: &Settings,
    folds: usize,
) -> Result<Vec<Estimate>, LatentError> {
    for robot in robots {
        check_pair(human, robot, folds)?;
    }
    let mut found = vec![vec![]; robots.len()];
    for fold in 0..folds {
        let known = |poses: &Poses| poses.select(|i| i % folds != fold);
        let held = |poses: &Poses| poses.select(|i| i % folds == fold);
        let spaces: Vec<Poses> = std::iter::once(human).chain(robots.iter().copied()).map(known).collect();
        let data: Vec<SpaceData<'_>> = spaces.iter().map(Poses::data).collect();
        let model = LatentModel::train(&data, settings)?.0;
        let test_human = held(human);
        for (k, (robot, found)) in robots.iter().zip(&mut found).enumerate() {
            found.push(error_of(&model, k + 1, &test_human, &held(robot)));
        }
    }
    Ok(found.iter().map(|values| Estimate::from_splits(values)).collect())
}

/// Computes the errors with few poses of the robot. In each split a fifth of the poses is held out. The robot
/// has `counts` of the remaining poses, sampled at random; the human and `source` have all remaining poses.
///
/// # Errors
/// [`LatentError`] if sizes do not match, or a count is below 2 or above the number of poses of a split.
pub fn few_poses(
    human: &Poses,
    source: &Poses,
    robot: &Poses,
    settings: &Settings,
    counts: &[usize],
    splits: u64,
) -> Result<Vec<FewPoses>, LatentError> {
    check_pair(human, source, 5)?;
    check_pair(human, robot, 5)?;
    let n = human.len();
    let train = n - n.div_ceil(5);
    if let Some(count) = counts.iter().find(|count| !(2..=train).contains(*count)) {
        let expected = format!("2 to {train}");
        return Err(LatentError::Setting {
            setting: "poses of the robot",
            found: count.to_string(),
            expected,
        });
    }
    let names: Vec<&'static str> =
        ["transferred", "alone"].into_iter().chain(Baseline::ALL.map(Baseline::name)).collect();
    let mut found = vec![vec![vec![]; names.len()]; counts.len()];
    for split in 0..splits {
        let mut order: Vec<usize> = (0..n).collect();
        let mut random = Pcg64::new(u128::from(split), 1);
        for i in (1..n).rev() {
            let share: f64 = StandardUniform.sample(&mut random);
            order.swap(i, ((i + 1) as f64 * share) as usize);
        }
        let (known, held) = order.split_at(train);
        let [all_human, all_source] = [human, source].map(|poses| poses.rows_at(known));
        let [test_human, test_robot] = [human, robot].map(|poses| poses.rows_at(held));
        let shared = LatentModel::train(&[all_human.data(), all_source.data()], settings)?.0;
        for (found, count) in found.iter_mut().zip(counts) {
            let [few_human, few_robot] = [human, robot].map(|poses| poses.rows_at(&known[..*count]));
            let mut model = shared.at_first_poses(*count)?;
            model.transfer(&few_robot.data(), settings.iterations)?;
            found[0].push(error_of(&model, 2, &test_human, &test_robot));
            let alone = LatentModel::train(&[few_human.data(), few_robot.data()], settings)?.0;
            found[1].push(error_of(&alone, 1, &test_human, &test_robot));
            for (found, baseline) in found[2..].iter_mut().zip(Baseline::ALL) {
                found.push(baseline.error(&few_human, &few_robot, &test_human, &test_robot)?);
            }
        }
    }
    let made = counts.iter().zip(found).map(|(poses, found)| FewPoses {
        poses: *poses,
        errors: names
            .iter()
            .zip(found)
            .map(|(name, values)| (*name, Estimate::from_splits(&values)))
            .collect(),
    });
    Ok(made.collect())
}
