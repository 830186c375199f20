//! The trained model.

use super::back::{Back, BackForm};
use super::space::Scaling;
use super::{LatentError, Space, SpaceData};
use crate::gp::{GpError, Gradient, Marginal, check_finite, clamp, release};
use crate::kernel::Points;
use crate::optimise::{Minimum, Options, minimise};

/// A model of several pose spaces that share one latent space.
#[derive(Clone, Debug)]
pub struct LatentModel {
    pub(super) points: Points,
    pub(super) spaces: Vec<Space>,
    pub(super) back: Option<Back>,
    /// Factor and weights of each space.
    pub(super) marginals: Vec<Marginal>,
    /// Folder of the poses.
    pub(super) source: Option<String>,
}

/// Result of [`LatentModel::transfer`].
#[derive(Clone, Debug, PartialEq)]
pub struct Transferred {
    /// Final objective of each start: at convergence for the best start, and after a few iterations for the
    /// other starts.
    pub starts: Vec<f64>,
    /// Minimum reached from the best start.
    pub minimum: Minimum,
    /// Leave-one-out error: mean squared error of predicting each pose of the robot from its latent point and
    /// all other poses, relative to the variance of the poses.
    pub left_out: f64,
    /// Warning that the space hardly depends on the latent point, if the noise exceeds half of the variance
    /// or `left_out` exceeds 0.8.
    pub warning: Option<String>,
}

/// The result of fitting one space to the latent points.
pub(super) struct Fitted {
    /// Initial objective of the best start.
    pub(super) start: f64,
    /// Final objective of each start.
    pub(super) starts: Vec<f64>,
    /// The best start.
    pub(super) minimum: Minimum,
}

/// Iterations from each start before only the best continues. Paired poses of arms need 20 to 60 iterations
/// to converge, and the ranking of their starts no longer changes after this number.
const TRIAL: usize = 8;
/// Fraction of the noise above which a transfer warns.
const NOISY: f64 = 0.5;
/// Leave-one-out error above which a transfer warns: short length scales fit noise like the noise term.
const UNPREDICTABLE: f64 = 0.8;

pub(super) fn find(spaces: &[Space], name: &str) -> Result<usize, LatentError> {
    spaces.iter().position(|space| space.name == name).ok_or_else(|| LatentError::UnknownSpace {
        name: name.to_string(),
        known: spaces.iter().map(|space| space.name.clone()).collect(),
    })
}

pub(super) fn check_poses(space: &Space, expected: usize) -> Result<(), LatentError> {
    if space.poses() == expected {
        return Ok(());
    }
    let error = GpError::Shape { what: "poses", found: space.poses(), expected };
    Err(LatentError::Space { space: space.name.clone(), error })
}

impl LatentModel {
    pub(super) fn assemble(
        points: Points,
        spaces: Vec<Space>,
        back: Option<Back>,
    ) -> Result<Self, LatentError> {
        let mut made = Self { points, spaces: vec![], back, marginals: vec![], source: None };
        for space in spaces {
            made.add(space)?;
        }
        Ok(made)
    }

    fn add(&mut self, space: Space) -> Result<(), LatentError> {
        let mut marginal = Marginal::new();
        let fitted = marginal.fit(&space.rbf(), space.noise, &self.points, &space.targets);
        fitted.map_err(|error| LatentError::Space { space: space.name.clone(), error })?;
        self.spaces.push(space);
        self.marginals.push(marginal);
        Ok(())
    }

    /// Returns the number of latent dimensions.
    pub fn latents(&self) -> usize {
        self.points.dimensions()
    }

    /// Returns the number of poses.
    pub fn poses(&self) -> usize {
        self.points.len()
    }

    /// Returns the latent points; each row is a point.
    pub fn latent(&self) -> Vec<f64> {
        self.points.to_rows()
    }

    /// Returns the folder of the training poses, if known.
    pub fn source(&self) -> Option<&str> {
        self.source.as_deref()
    }

    /// Sets the folder of the training poses, which is stored in the model file.
    pub fn set_source(&mut self, folder: &str) {
        self.source = Some(folder.to_string());
    }

    /// Returns the spaces.
    pub fn spaces(&self) -> &[Space] {
        &self.spaces
    }

    /// Returns the index of a space.
    ///
    /// # Errors
    /// [`LatentError`] if there is no space with this name.
    pub fn space(&self, name: &str) -> Result<usize, LatentError> {
        find(&self.spaces, name)
    }

    /// Returns the logarithms of variance, length scales and noise variance of a space.
    ///
    /// # Panics
    /// If the space does not exist.
    pub fn parameters(&self, space: usize) -> Vec<f64> {
        self.spaces[space].parameters()
    }

    /// Replaces the logarithms of the hyperparameters of a space, in the order of
    /// [`parameters`](Self::parameters).
    ///
    /// # Errors
    /// [`LatentError`] if the number of logarithms is wrong, a logarithm is not finite, or the covariance is
    /// not positive definite. The model is then unchanged.
    ///
    /// # Panics
    /// If the space does not exist.
    pub fn set_parameters(&mut self, space: usize, logarithms: &[f64]) -> Result<(), LatentError> {
        let mut changed = self.spaces[space].clone();
        let wrong = |error| LatentError::Space { space: changed.name.clone(), error };
        let expected = changed.kernel.lengths.len() + 2;
        if logarithms.len() != expected {
            return Err(wrong(GpError::Shape { what: "parameters", found: logarithms.len(), expected }));
        }
        check_finite("parameter", logarithms).map_err(wrong)?;
        changed.set_parameters(logarithms);
        let mut marginal = Marginal::new();
        let fitted = marginal.fit(&changed.rbf(), changed.noise, &self.points, &changed.targets);
        fitted.map_err(|error| LatentError::Space { space: changed.name.clone(), error })?;
        (self.spaces[space], self.marginals[space]) = (changed, marginal);
        Ok(())
    }

    /// Returns the space whose pose determines the latent point; `None` without a back constraint.
    pub fn back_constrained(&self) -> Option<&Space> {
        self.back.as_ref().map(|back| &self.spaces[back.space])
    }

    /// Returns the model restricted to its first `poses` poses. The latent points of these poses, the
    /// hyperparameters and the back constraint are kept. A robot with only these poses can be added to the
    /// restricted model.
    ///
    /// # Errors
    /// [`LatentError`] if the number of poses is out of range.
    pub fn at_first_poses(&self, poses: usize) -> Result<Self, LatentError> {
        if poses == 0 || poses > self.poses() {
            let expected = format!("1 to {}", self.poses());
            return Err(LatentError::Setting {
                setting: "number of poses",
                found: poses.to_string(),
                expected,
            });
        }
        let points = Points::from_rows(&self.latent()[..poses * self.latents()], self.latents());
        let spaces = self.spaces.iter().map(|space| space.at_first_poses(poses)).collect();
        Self::assemble(points, spaces, self.back.clone())
    }

    /// Adds a robot while the latent points and all other spaces stay fixed. The hyperparameters are fitted
    /// from three starts: the hyperparameters of the last space; the standard deviations of the latent points
    /// as length scales, with noise 0.01; and these length scales divided by e, with noise 0.1. If the latent
    /// point is the pose itself ([`BackForm::Pose`]), the length scales of the last two starts are multiplied
    /// by the square root of the number of latent dimensions. After a few iterations from each start, only
    /// the best start continues.
    ///
    /// # Errors
    /// [`LatentError`] if the poses do not match the model or no start has a positive definite covariance.
    pub fn transfer(&mut self, data: &SpaceData<'_>, iterations: usize) -> Result<Transferred, LatentError> {
        let scaling = self.back.as_ref().map_or(Scaling::Columns, |back| back.form.scaling());
        let space = Space::new(data, self.latents(), scaling)?;
        check_poses(&space, self.poses())?;
        if self.spaces.iter().any(|other| other.name == space.name) {
            return Err(LatentError::SameName { name: space.name });
        }
        let fitted = self.fit_space(space, iterations, &mut |_, _| ())?;
        let Fitted { starts, minimum, .. } = fitted;
        let added = self.spaces.last().expect("the space that was added");
        let (share, name, targets) = (added.noise_share(), added.name.clone(), added.targets.clone());
        let left_out =
            self.marginals.last_mut().map_or(f64::NAN, |marginal| marginal.leave_one_out(&targets));
        let warning = (share > NOISY || left_out > UNPREDICTABLE).then(|| {
            let (share, left_out) = (100.0 * share, 100.0 * left_out);
            format!(
                "the latent points hardly predict the poses of {name}: {share:.0} % of the variance is \
                 noise, and the leave-one-out error is {left_out:.0} % of the variance"
            )
        });
        Ok(Transferred { starts, minimum, left_out, warning })
    }

    /// Fits the hyperparameters of a space to the latent points, from several starts, and adds the space.
    pub(super) fn fit_space(
        &mut self,
        mut space: Space,
        iterations: usize,
        report: &mut dyn FnMut(&str, f64),
    ) -> Result<Fitted, LatentError> {
        let n = self.poses() as f64;
        let is_pose = self.back.as_ref().is_some_and(|back| back.form == BackForm::Pose);
        let longer = if is_pose { 0.5 * (self.latents() as f64).ln() } else { 0.0 };
        let spread: Vec<f64> = (0..self.latents())
            .map(|d| {
                let x = self.points.coordinate(d);
                let mean = x.iter().sum::<f64>() / n;
                longer + 0.5 * (x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n).max(1e-12).ln()
            })
            .collect();
        let start = |shift: f64, noise: f64| {
            let mut made = vec![0.0];
            made.extend(spread.iter().map(|l| l - shift));
            made.push(noise.ln());
            made
        };
        let mut starts = vec![start(0.0, 0.01), start(1.0, 0.1)];
        if let Some(last) = self.spaces.last() {
            starts.insert(0, last.parameters());
        }
        let mut marginal = Marginal::new();
        // minimises from `parameters`; also returns the initial objective
        let mut descend = |parameters: &mut Vec<f64>, iterations: usize| {
            let options = Options { iterations, improvement: 1e-8, ..Options::default() };
            let mut first = None;
            clamp(parameters);
            let minimum = minimise(parameters, &options, |variables, gradient| {
                let mut inside = variables.to_vec();
                clamp(&mut inside);
                space.set_parameters(&inside);
                gradient.fill(0.0);
                let into = Gradient { parameters: gradient, by_points: None };
                let value =
                    marginal.evaluate(&space.rbf(), space.noise, &self.points, &space.targets, Some(into));
                release(variables, gradient);
                let value = value.unwrap_or(f64::INFINITY);
                first.get_or_insert(value);
                report(&space.name, value);
                value
            });
            clamp(parameters);
            (first.unwrap_or(f64::NAN), minimum)
        };
        let trial = TRIAL.min(iterations);
        let mut tried = starts.iter_mut().map(|parameters| descend(parameters, trial)).collect::<Vec<_>>();
        let objective = |k: &usize| tried[*k].1.value;
        let best = (0..tried.len()).min_by(|a, b| objective(a).total_cmp(&objective(b))).expect("a start");
        let mut minimum = tried[best].1;
        if minimum.iterations == trial && trial < iterations {
            let (_, rest) = descend(&mut starts[best], iterations - trial);
            minimum.value = rest.value;
            minimum.iterations += rest.iterations;
            minimum.evaluations += rest.evaluations;
            tried[best].1 = minimum;
        }
        space.set_parameters(&starts[best]);
        let start = tried[best].0;
        let starts = tried.iter().map(|(_, minimum)| minimum.value).collect();
        self.add(space)?;
        Ok(Fitted { start, starts, minimum })
    }
}
