//! Letters written from their pictures by networks, compared with the nearest known picture.

use motorium_library::{BuildError, Recordings, SampledSpring, Trajectory};
use nalgebra::DMatrix;

use crate::perception::{Coupling, Picture, Training, begun_at_zero, chamfer, even_speed, unit_extent};

/// Number of samples of each compared curve.
const COMPARED: usize = 200;

/// Chamfer distance between the written and the shown curve of each letter, in units of the letter's size
/// (the larger side of its bounding box).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurveErrors {
    /// Distances with both curves starting at the same point, because a picture does not show the position on
    /// the paper.
    pub begun: Vec<f64>,
    /// Distances with both curves centred.
    pub centred: Vec<f64>,
}

impl CurveErrors {
    fn add(&mut self, written: &DMatrix<f64>, shown: &DMatrix<f64>) {
        self.begun.push(chamfer(&begun_at_zero(written), &begun_at_zero(shown)));
        self.centred.push(chamfer(&unit_extent(written), shown));
    }

    /// Returns the mean of several results, separately for each letter.
    pub fn mean(all: &[Self]) -> Self {
        let mean = |pick: fn(&Self) -> &Vec<f64>| {
            let letters = all.first().map_or(0, |errors| pick(errors).len());
            let of = |k: usize| all.iter().map(|errors| pick(errors)[k]).sum::<f64>() / all.len() as f64;
            (0..letters).map(of).collect()
        };
        Self { begun: mean(|errors| &errors.begun), centred: mean(|errors| &errors.centred) }
    }
}

/// Letters for training and held-out letters for evaluation, both as curves of unit extent and as pictures.
#[derive(Clone, Debug)]
pub struct Letters {
    seen: Recordings,
    known: Vec<DMatrix<f64>>,
    known_pictures: Vec<Picture>,
    /// Curves of the held-out letters, samples x 2.
    pub shown: Vec<DMatrix<f64>>,
    pictures: Vec<Picture>,
}

/// Result of training a network on letters and evaluating it on held-out letters.
#[derive(Clone, Debug)]
pub struct NetworkResult {
    /// Loss of each epoch: the squared error of position, in units of the letter's size.
    pub losses: Vec<f64>,
    /// Curves that the network writes for the held-out letters, samples x 2.
    pub written: Vec<DMatrix<f64>>,
    /// Distances between the written and the true curves.
    pub errors: CurveErrors,
}

impl Letters {
    /// Creates the letters from recordings with two degrees of freedom: `seen` for training, `held` for
    /// evaluation.
    pub fn new(seen: &Recordings, held: &Recordings) -> Self {
        let curve = |letter: &Trajectory| unit_extent(&letter.resampled(COMPARED));
        let curves = |set: &Recordings| set.trajectories.iter().map(curve).collect::<Vec<_>>();
        let (known, shown) = (curves(seen), curves(held));
        let pictures = |curves: &[DMatrix<f64>]| curves.iter().map(Picture::from_path).collect::<Vec<_>>();
        let (known_pictures, pictures) = (pictures(&known), pictures(&shown));
        Self { seen: seen.clone(), known, known_pictures, shown, pictures }
    }

    /// Returns the errors of a baseline that writes the training letter with the nearest picture.
    pub fn nearest_picture(&self) -> CurveErrors {
        let mut errors = CurveErrors::default();
        for (picture, shown) in self.pictures.iter().zip(&self.shown) {
            let distance = |k: &usize| -> f32 {
                self.known_pictures[*k].0.iter().zip(&picture.0).map(|(a, b)| (a - b) * (a - b)).sum()
            };
            let nearest = (0..self.known.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
            errors.add(&self.known[nearest.unwrap_or(0)], shown);
        }
        errors
    }

    /// Trains a network on the training letters and lets it write the held-out letters. `progress` is called
    /// after every epoch.
    ///
    /// # Errors
    /// [`BuildError`] if there are no letters, or they do not have two degrees of freedom.
    pub fn network(
        &self,
        spring: SampledSpring,
        training: &Training,
        mut progress: impl FnMut(),
    ) -> Result<NetworkResult, BuildError> {
        let mut losses = Vec::new();
        let coupling = Coupling::train(&self.seen, spring, training, |_, loss| {
            losses.push(loss);
            progress();
        })?;
        let mut errors = CurveErrors::default();
        let mut written = Vec::new();
        for (picture, shown) in self.pictures.iter().zip(&self.shown) {
            let path = even_speed(&coupling.movement(picture).path(coupling.library()), COMPARED);
            errors.add(&path, shown);
            written.push(path);
        }
        Ok(NetworkResult { losses, written, errors })
    }
}
