//! Errors of latent models on held-out poses, compared with the errors of simple methods.

use motorium_algebra::Cholesky;

use super::poses::Poses;
use super::{LatentError, LatentModel, Settings};
use crate::gp::GaussianProcess;
use crate::kernel::Kernel;
use crate::optimise::Options;

/// Error of one method on held-out poses.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodError {
    /// Name of the method.
    pub method: &'static str,
    /// Mean squared error over all columns, in the squared unit of the columns.
    pub mean: f64,
    /// Standard deviation of the error over the folds.
    pub deviation: f64,
}

/// Computes the errors of several methods that predict a robot's poses from human poses. Each fold holds out
/// every `folds`th pose and trains on the remaining poses. The methods are `latent` (a latent space shared by
/// human and robot), `gaussian_process` (directly from pose to pose), `ridge`, `nearest` and `mean`.
///
/// # Errors
/// [`LatentError`] if sizes do not match, or `folds` is below 2 or above half the number of poses.
pub fn compare(
    human: &Poses,
    robot: &Poses,
    settings: &Settings,
    folds: usize,
) -> Result<Vec<MethodError>, LatentError> {
    check_pair(human, robot, folds)?;
    let methods: Vec<&'static str> =
        std::iter::once("latent").chain(Baseline::ALL.map(Baseline::name)).collect();
    let mut errors = vec![vec![]; methods.len()];
    for fold in 0..folds {
        let [train_human, train_robot] = [human, robot].map(|poses| poses.select(|i| i % folds != fold));
        let [test_human, test_robot] = [human, robot].map(|poses| poses.select(|i| i % folds == fold));
        let predictions = latent(&train_human, &train_robot, &test_human, settings)?;
        errors[0].push(mean_square(&predictions, &test_robot));
        for (errors, baseline) in errors[1..].iter_mut().zip(Baseline::ALL) {
            errors.push(baseline.error(&train_human, &train_robot, &test_human, &test_robot)?);
        }
    }
    let made = methods.into_iter().zip(errors).map(|(method, errors)| {
        let mean = errors.iter().sum::<f64>() / folds as f64;
        let squares: f64 = errors.iter().map(|e| (e - mean) * (e - mean)).sum();
        MethodError { method, mean, deviation: (squares / (folds - 1) as f64).sqrt() }
    });
    Ok(made.collect())
}

/// Checks that two spaces have poses at the same instants, and enough poses for the folds.
pub(super) fn check_pair(human: &Poses, robot: &Poses, folds: usize) -> Result<(), LatentError> {
    let n = human.len();
    if robot.len() != n {
        let error = crate::gp::GpError::Shape { what: "poses", found: robot.len(), expected: n };
        return Err(LatentError::Space { space: robot.name.clone(), error });
    }
    if folds < 2 || folds > n / 2 {
        let expected = format!("2 to {}", n / 2);
        return Err(LatentError::Setting { setting: "folds", found: folds.to_string(), expected });
    }
    Ok(())
}

fn mean_square(predictions: &[f64], truth: &Poses) -> f64 {
    let squares: f64 = predictions.iter().zip(&truth.values).map(|(p, t)| (p - t) * (p - t)).sum();
    squares / predictions.len() as f64
}

/// A method that predicts a robot's poses from a human's without a latent space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Baseline {
    GaussianProcess,
    Ridge,
    Nearest,
    Mean,
}

impl Baseline {
    pub(super) const ALL: [Self; 4] = [Self::GaussianProcess, Self::Ridge, Self::Nearest, Self::Mean];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::GaussianProcess => "gaussian_process",
            Self::Ridge => "ridge",
            Self::Nearest => "nearest",
            Self::Mean => "mean",
        }
    }

    /// Returns the mean squared error on held-out poses.
    pub(super) fn error(
        self,
        human: &Poses,
        robot: &Poses,
        test_human: &Poses,
        test_robot: &Poses,
    ) -> Result<f64, LatentError> {
        let predictions = match self {
            Self::GaussianProcess => direct(human, robot, test_human)?,
            Self::Ridge => ridge(human, robot, test_human),
            Self::Nearest => nearest(human, robot, test_human),
            Self::Mean => mean(robot, test_human),
        };
        Ok(mean_square(&predictions, test_robot))
    }
}

fn rows(poses: &Poses) -> std::slice::ChunksExact<'_, f64> {
    poses.values.chunks_exact(poses.columns.len())
}

fn latent(human: &Poses, robot: &Poses, test: &Poses, settings: &Settings) -> Result<Vec<f64>, LatentError> {
    let model = LatentModel::train(&[human.data(), robot.data()], settings)?.0;
    let d = robot.columns.len();
    let (mut mean, mut variance, mut scratch) = (vec![0.0; d], vec![0.0; d], model.scratch());
    let mut made = vec![];
    for pose in rows(test) {
        let x = model.latent_of_pose(0, pose);
        model.predict(1, &x, &mut mean, &mut variance, &mut scratch);
        made.extend_from_slice(&mean);
    }
    Ok(made)
}

fn column_means(poses: &Poses) -> Vec<f64> {
    let n = poses.len() as f64;
    (0..poses.columns.len()).map(|c| rows(poses).map(|row| row[c]).sum::<f64>() / n).collect()
}

fn centred(poses: &Poses, mean: &[f64]) -> Vec<f64> {
    rows(poses).flat_map(|row| row.iter().zip(mean).map(|(v, m)| v - m)).collect()
}

fn direct(human: &Poses, robot: &Poses, test: &Poses) -> Result<Vec<f64>, LatentError> {
    let wrong = |error| LatentError::Space { space: robot.name.clone(), error };
    let (dimensions, outputs) = (human.columns.len(), robot.columns.len());
    let offset = column_means(robot);
    let y = centred(robot, &offset);
    let mut gp =
        GaussianProcess::new(Kernel::rbf(dimensions, 1.0), 0.01, &human.values, dimensions, &y, outputs)
            .map_err(wrong)?;
    gp.optimise(&Options::default()).map_err(wrong)?;
    let (mut mean, mut scratch, mut made) = (vec![0.0; outputs], gp.scratch(), vec![]);
    for pose in rows(test) {
        gp.predict(pose, &mut mean, &mut scratch);
        made.extend(mean.iter().zip(&offset).map(|(m, o)| m + o));
    }
    Ok(made)
}

/// Predicts by ridge regression on centred poses, with 1e-3 of the inputs' mean square as penalty.
fn ridge(human: &Poses, robot: &Poses, test: &Poses) -> Vec<f64> {
    let (d, outputs) = (human.columns.len(), robot.columns.len());
    let (from, to) = (column_means(human), column_means(robot));
    let (x, y) = (centred(human, &from), centred(robot, &to));
    let penalty = 1e-3 * x.iter().map(|x| x * x).sum::<f64>() / d as f64 + 1e-12;
    let mut factor = Cholesky::with_capacity(d);
    let product = |i: usize, j: usize| x.chunks_exact(d).map(|row| row[i] * row[j]).sum::<f64>();
    let fill = |i: usize, out: &mut [f64]| {
        out.iter_mut().enumerate().for_each(|(j, out)| *out = product(i, i + j));
        out[0] += penalty;
    };
    factor.factorise(d, fill).expect("a Gram matrix with a penalty is positive definite");
    let weights: Vec<Vec<f64>> = (0..outputs)
        .map(|output| {
            let pairs = || x.chunks_exact(d).zip(y.chunks_exact(outputs));
            let mut column: Vec<f64> = (0..d).map(|i| pairs().map(|(x, y)| x[i] * y[output]).sum()).collect();
            factor.solve(&mut column);
            column
        })
        .collect();
    let predict = |pose: &[f64]| -> Vec<f64> {
        let columns = weights.iter().zip(&to);
        columns
            .map(|(w, m)| m + w.iter().zip(pose).zip(&from).map(|((w, v), f)| w * (v - f)).sum::<f64>())
            .collect()
    };
    rows(test).flat_map(predict).collect()
}

fn nearest(human: &Poses, robot: &Poses, test: &Poses) -> Vec<f64> {
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    let predict = |pose: &[f64]| {
        let pairs = rows(human).zip(rows(robot));
        let best = pairs.min_by(|a, b| distance(a.0, pose).total_cmp(&distance(b.0, pose)));
        best.map_or(vec![], |(_, robot)| robot.to_vec())
    };
    rows(test).flat_map(predict).collect()
}

fn mean(robot: &Poses, test: &Poses) -> Vec<f64> {
    column_means(robot).repeat(test.len())
}
