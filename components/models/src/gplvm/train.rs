//! Joint training of the latent points and all hyperparameters.

use motorium_algebra::{Wanted, left_singular};
use nalgebra::DMatrix;

use super::back::{Back, BackForm, Prepared};
use super::dynamics::Dynamics;
use super::space::Scaling;
use super::{LatentError, LatentModel, Space, SpaceData};
use crate::gp::{Gradient, Marginal, clamp, release};
use crate::kernel::Points;
use crate::optimise::{Minimum, Options, minimise};

/// Prior on the latent points during training.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Prior {
    /// Flat prior.
    None,
    /// Standard normal prior. If the latent point is a pose, the prior is constant.
    #[default]
    Normal,
    /// Dynamic prior: a Gaussian process from each latent point to the next, with an RBF and a linear kernel
    /// whose hyperparameters are also trained, and a standard normal prior on the points that start a
    /// movement. This prior keeps the latent points of a movement close together. Not allowed if the latent
    /// point is a pose.
    Dynamics {
        /// Rows of the poses that start a movement. The first row always starts a movement.
        starts: Vec<usize>,
    },
}

/// Settings of [`LatentModel::train`].
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Number of latent dimensions, at least 1. Default: the number of columns of the space with a back
    /// constraint of [`BackForm::Pose`], otherwise 6.
    pub latents: Option<usize>,
    /// Back constraint: the name of the space whose pose determines the latent point, and the functional
    /// form. Default: the pose of the space `human`, which has the smallest errors on held-out poses.
    pub back: Option<(String, BackForm)>,
    /// Prior on the latent points. Default: [`Prior::Normal`].
    pub prior: Prior,
    /// Maximum number of iterations. If the latent point is a pose, the maximum applies to each start of each
    /// space. Default: 300.
    pub iterations: usize,
}

impl Default for Settings {
    fn default() -> Self {
        let back = Some(("human".to_string(), BackForm::Pose));
        Self { latents: None, back, prior: Prior::Normal, iterations: 300 }
    }
}

/// Number of latent dimensions if the latent point is not a pose.
const LATENTS: usize = 6;

/// Result of training a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trained {
    /// Objective before the first iteration.
    pub start: f64,
    /// Final objective, and the numbers of iterations and evaluations.
    pub minimum: Minimum,
}

/// Workspace of [`LatentModel::energy`], reused between calls.
#[derive(Clone, Debug)]
pub struct Workspace(Marginal);

impl Default for Workspace {
    fn default() -> Self {
        Self(Marginal::new())
    }
}

/// The objective of a training, with reused memory.
struct Objective<'a> {
    spaces: &'a mut [Space],
    marginals: Vec<Marginal>,
    back: Option<(Back, Prepared)>,
    points: Points,
    by_points: Vec<f64>,
    prior: PriorTerm,
}

/// A prior with its workspace.
enum PriorTerm {
    None,
    Normal,
    Dynamics(Box<Dynamics>),
}

impl PriorTerm {
    fn new(prior: &Prior, points: usize, latents: usize) -> Result<Self, LatentError> {
        Ok(match prior {
            Prior::None => Self::None,
            Prior::Normal => Self::Normal,
            Prior::Dynamics { starts } => Self::Dynamics(Box::new(Dynamics::new(starts, points, latents)?)),
        })
    }

    /// Logarithms of the hyperparameters.
    fn parameters(&self) -> Vec<f64> {
        match self {
            Self::None | Self::Normal => vec![],
            Self::Dynamics(dynamics) => dynamics.parameters(),
        }
    }
}

impl Objective<'_> {
    /// Number of variables before the hyperparameters.
    fn latent_variables(&self) -> usize {
        match &self.back {
            Some((back, _)) => back.variables(),
            None => self.points.len() * self.points.dimensions(),
        }
    }

    /// Sets the variables: the latent points or the weights of the back constraint, then each space's
    /// hyperparameters and the prior's.
    fn set(&mut self, variables: &[f64]) {
        let (latent, mut rest) = variables.split_at(self.latent_variables());
        let n = self.points.len();
        let mut x = latent.to_vec();
        if let Some((back, prepared)) = &mut self.back {
            back.weights[..latent.len()].copy_from_slice(latent);
            x = vec![0.0; n * self.points.dimensions()];
            back.latent(prepared, &mut x);
        }
        for (d, column) in x.chunks_exact(n).enumerate() {
            self.points.coordinate_mut(d).copy_from_slice(column);
        }
        for space in self.spaces.iter_mut() {
            let (own, others) = rest.split_at(space.kernel.lengths.len() + 2);
            let mut own = own.to_vec();
            clamp(&mut own);
            space.set_parameters(&own);
            rest = others;
        }
    }

    fn evaluate(&mut self, variables: &[f64], gradient: &mut [f64]) -> f64 {
        self.set(variables);
        let latent = self.latent_variables();
        gradient.fill(0.0);
        self.by_points.fill(0.0);
        let mut energy = 0.0;
        let mut first = latent;
        for (space, marginal) in self.spaces.iter().zip(&mut self.marginals) {
            let end = first + space.kernel.lengths.len() + 2;
            let parameters = &mut gradient[first..end];
            let into = Gradient { parameters, by_points: Some(&mut self.by_points) };
            match marginal.evaluate(&space.rbf(), space.noise, &self.points, &space.targets, Some(into)) {
                Ok(value) => energy += value,
                Err(_) => return f64::INFINITY,
            }
            first = end;
        }
        release(&variables[latent..first], &mut gradient[latent..first]);
        match &mut self.prior {
            PriorTerm::None => {}
            PriorTerm::Normal => {
                for d in 0..self.points.dimensions() {
                    let x = self.points.coordinate(d);
                    energy += 0.5 * x.iter().map(|x| x * x).sum::<f64>();
                    let n = x.len();
                    self.by_points[d * n..(d + 1) * n].iter_mut().zip(x).for_each(|(g, x)| *g += x);
                }
            }
            PriorTerm::Dynamics(dynamics) => {
                let (parameters, by_parameters) = (&variables[first..], &mut gradient[first..]);
                match dynamics.evaluate(parameters, &self.points, &mut self.by_points, by_parameters) {
                    Ok(value) => energy += value,
                    Err(_) => return f64::INFINITY,
                }
            }
        }
        match &self.back {
            Some((back, prepared)) => back.gradient(prepared, &self.by_points, &mut gradient[..latent]),
            None => gradient[..latent].copy_from_slice(&self.by_points),
        }
        energy
    }
}

/// Returns the principal components of unit standard deviation, dimension by dimension.
fn principal_components(space: &Space, latents: usize) -> Vec<f64> {
    let n = space.poses();
    let matrix = DMatrix::from_column_slice(n, space.dimensions(), &space.targets);
    let found = left_singular(&matrix, Wanted::Rank(latents));
    let mut x = vec![0.0; n * latents];
    for (column, out) in found.vectors.column_iter().zip(x.chunks_exact_mut(n)) {
        // the sign of a component is arbitrary: its largest entry is positive
        let largest = column.iter().fold(0.0_f64, |most, v| if v.abs() > most.abs() { *v } else { most });
        let scale = (n as f64).sqrt().copysign(largest);
        out.iter_mut().zip(column.iter()).for_each(|(out, v)| *out = scale * v);
    }
    x
}

impl LatentModel {
    /// Trains one latent space for several pose spaces. Rows with the same index must be poses at the same
    /// instant in all spaces.
    ///
    /// # Errors
    /// [`LatentError`] if sizes or names do not match, a value is not finite, or a setting is out of range.
    pub fn train(data: &[SpaceData<'_>], settings: &Settings) -> Result<(Self, Trained), LatentError> {
        Self::train_with_progress(data, settings, &mut |_, _| ())
    }

    /// Trains like [`train`](Self::train), and calls `report` with each evaluation of an objective. The
    /// arguments of `report` are a name and the value of the objective. The name is the name of the space if
    /// the spaces are fitted one after the other, and `all spaces` if they are fitted together.
    ///
    /// # Errors
    /// Same as [`train`](Self::train).
    pub fn train_with_progress(
        data: &[SpaceData<'_>],
        settings: &Settings,
        report: &mut dyn FnMut(&str, f64),
    ) -> Result<(Self, Trained), LatentError> {
        let back = settings.back.as_ref();
        let pose = back.filter(|(_, form)| *form == BackForm::Pose);
        let columns = pose.and_then(|(name, _)| data.iter().find(|space| space.name == name));
        let q = settings.latents.unwrap_or_else(|| columns.map_or(LATENTS, |space| space.columns.len()));
        let mut spaces: Vec<Space> = vec![];
        for data in data {
            let space = Space::new(data, q, back.map_or(Scaling::Columns, |(_, form)| form.scaling()))?;
            if let Some(first) = spaces.first() {
                super::model::check_poses(&space, first.poses())?;
            }
            if spaces.iter().any(|other| other.name == space.name) {
                return Err(LatentError::SameName { name: space.name });
            }
            spaces.push(space);
        }
        let Some(first) = spaces.first() else {
            let expected = "at least 1".to_string();
            return Err(LatentError::Setting {
                setting: "number of spaces",
                found: "0".to_string(),
                expected,
            });
        };
        // the space whose principal components initialise the training, or whose poses are the latent points
        let first = match pose {
            Some((name, _)) => &spaces[super::model::find(&spaces, name)?],
            None => first,
        };
        let rank = first.dimensions().min(first.poses());
        let most = if pose.is_some() { first.dimensions() } else { rank };
        if q == 0 || q > most {
            let what = if pose.is_some() { "columns" } else { "rank" };
            let expected = format!("1 to {most}, the {what} of the space {}", first.name);
            return Err(LatentError::Setting { setting: "latents", found: q.to_string(), expected });
        }
        if let Some((name, _)) = pose {
            if let Prior::Dynamics { .. } = settings.prior {
                let expected = "none or normal for a latent point that is a pose".to_string();
                let found = "dynamics".to_string();
                return Err(LatentError::Setting { setting: "prior", found, expected });
            }
            let index = super::model::find(&spaces, name)?;
            return Self::train_on_poses(spaces, index, q, settings.iterations, report);
        }
        let n = first.poses();
        let x = principal_components(first, q);
        let mut points = Points::from_rows(&vec![0.0; n * q], q);
        x.chunks_exact(n).enumerate().for_each(|(d, x)| points.coordinate_mut(d).copy_from_slice(x));
        let mut back = None;
        if let Some((name, form)) = &settings.back {
            let index = super::model::find(&spaces, name)?;
            back = Some(Back::new(index, *form, spaces[index].rows(), spaces[index].dimensions(), &x));
        }
        let mut variables = back.as_ref().map_or(x, |(back, _)| back.weights.clone());
        variables.extend(spaces.iter().flat_map(Space::parameters));
        let prior = PriorTerm::new(&settings.prior, n, q)?;
        variables.extend(prior.parameters());
        let marginals = vec![Marginal::new(); spaces.len()];
        let by_points = vec![0.0; n * q];
        let mut objective = Objective { spaces: &mut spaces, marginals, back, points, by_points, prior };
        let start = objective.evaluate(&variables, &mut vec![0.0; variables.len()]);
        let options = Options { iterations: settings.iterations, improvement: 1e-9, ..Options::default() };
        let minimum = minimise(&mut variables, &options, |x, gradient| {
            let value = objective.evaluate(x, gradient);
            report("all spaces", value);
            value
        });
        objective.set(&variables);
        let (points, back) = (objective.points.clone(), objective.back.take().map(|(back, _)| back));
        let model = Self::assemble(points, spaces, back)?;
        Ok((model, Trained { start, minimum }))
    }

    /// Trains a model whose latent point is the pose of one space: its spaces are independent of each other.
    fn train_on_poses(
        spaces: Vec<Space>,
        index: usize,
        latents: usize,
        iterations: usize,
        report: &mut dyn FnMut(&str, f64),
    ) -> Result<(Self, Trained), LatentError> {
        let own = &spaces[index];
        let mut x = vec![0.0; own.poses() * latents];
        let (back, prepared) = Back::new(index, BackForm::Pose, own.rows(), own.dimensions(), &x);
        back.latent(&prepared, &mut x);
        let mut points = Points::from_rows(&vec![0.0; x.len()], latents);
        x.chunks_exact(own.poses())
            .enumerate()
            .for_each(|(d, x)| points.coordinate_mut(d).copy_from_slice(x));
        let mut model = Self::assemble(points, vec![], Some(back))?;
        let mut start = 0.0;
        let mut sum = Minimum { value: 0.0, iterations: 0, evaluations: 0 };
        for space in spaces {
            let fitted = model.fit_space(space, iterations, report)?;
            start += fitted.start;
            sum.value += fitted.minimum.value;
            sum.iterations += fitted.minimum.iterations;
            sum.evaluations += fitted.minimum.evaluations;
        }
        Ok((model, Trained { start, minimum: sum }))
    }

    /// Returns the objective of one space without a prior, and its gradients with respect to the latent
    /// points (row by row) and to the logarithms of variance, length scales and noise. `x` contains the
    /// latent points, row by row; `targets` is not standardised.
    ///
    /// # Errors
    /// [`GpError`](crate::gp::GpError) if the covariance is not positive definite.
    pub fn energy(
        x: &[f64],
        targets: &[f64],
        parameters: &[f64],
        workspace: &mut Workspace,
    ) -> Result<(f64, Vec<f64>, Vec<f64>), crate::gp::GpError> {
        let q = parameters.len() - 2;
        let points = Points::from_rows(x, q);
        let n = points.len();
        let d = targets.len() / n;
        let columns: Vec<f64> = (0..d).flat_map(|c| targets.iter().skip(c).step_by(d).copied()).collect();
        let mut kernel = crate::kernel::Kernel::rbf(q, 1.0);
        kernel.set_parameters(parameters);
        let mut by_parameters = vec![0.0; parameters.len()];
        let mut by_points = vec![0.0; n * q];
        let into = Gradient { parameters: &mut by_parameters, by_points: Some(&mut by_points) };
        let noise = parameters[q + 1].exp();
        let value = workspace.0.evaluate(&kernel, noise, &points, &columns, Some(into))?;
        let rows = (0..n * q).map(|i| by_points[i % q * n + i / q]).collect();
        Ok((value, rows, by_parameters))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Example = (Vec<Space>, Option<(Back, Prepared)>, Points, Vec<f64>);

    fn example(form: Option<BackForm>) -> Example {
        let n = 12;
        let names = |d: usize| (0..d).map(|i| format!("c{i}")).collect::<Vec<_>>();
        let values = |d: usize, phase: f64| -> Vec<f64> {
            (0..n * d).map(|i| (0.6 * (i / d) as f64 + (i % d) as f64 + phase).sin()).collect()
        };
        let (a, b) = (values(3, 0.1), values(4, 0.7));
        let spaces = vec![
            Space::new(&SpaceData { name: "a", columns: names(3), values: &a }, 2, Scaling::Columns)
                .expect("a space"),
            Space::new(&SpaceData { name: "b", columns: names(4), values: &b }, 2, Scaling::Columns)
                .expect("a space"),
        ];
        let x = principal_components(&spaces[0], 2);
        let back = form.map(|form| Back::new(1, form, spaces[1].rows(), 4, &x));
        (spaces, back, Points::from_rows(&vec![0.0; 2 * n], 2), x)
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let movements = || Prior::Dynamics { starts: vec![0, 5] };
        for (form, prior) in [
            (None, Prior::None),
            (None, movements()),
            (Some(BackForm::Kernel), Prior::Normal),
            (Some(BackForm::Kernel), movements()),
            (Some(BackForm::Mlp), Prior::Normal),
        ] {
            let (mut spaces, back, points, x) = example(form);
            let mut variables = back.as_ref().map_or(x, |(back, _)| back.weights.clone());
            variables.extend(spaces.iter().flat_map(Space::parameters));
            let prior = PriorTerm::new(&prior, 12, 2).expect("a prior");
            variables.extend(prior.parameters());
            let marginals = vec![Marginal::new(); 2];
            let mut objective =
                Objective { spaces: &mut spaces, marginals, back, points, by_points: vec![0.0; 24], prior };
            let mut gradient = vec![0.0; variables.len()];
            objective.evaluate(&variables, &mut gradient);
            let mut other = gradient.clone();
            for i in 0..variables.len() {
                let mut side = |step: f64| {
                    let mut moved = variables.clone();
                    moved[i] += step;
                    objective.evaluate(&moved, &mut other)
                };
                let difference = (side(1e-5) - side(-1e-5)) / 2e-5;
                let error = (difference - gradient[i]).abs();
                assert!(
                    error < 2e-5 * gradient[i].abs().max(1.0),
                    "{form:?} {i}: {difference} {}",
                    gradient[i]
                );
            }
        }
    }
}
