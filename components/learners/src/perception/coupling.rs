//! Couplings of pictures to movements: training and use.

use motorium_models::networks::ConvolutionalNetwork;
use nalgebra::{DMatrix, DVector};
use rand::seq::{IndexedRandom as _, SliceRandom as _};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;

use super::letter::{augmented, even_speed, unit_extent};
use super::picture::{PIXELS, Picture};
use motorium_library::{
    BuildError, Frame, Metric, MotionLibrary, Movement, Recordings, SampledSpring, Superposition, Trajectory,
    Truncation,
};

/// Training settings of a coupling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Training {
    /// Number of eigenforces of the library, which is the number of weights predicted. Default 16.
    pub eigenforces: usize,
    /// Number of epochs. An epoch is a pass over all letters, each with new random variations. Default 220.
    pub epochs: usize,
    /// Number of letters per batch. Default 8.
    pub batch: usize,
    /// Initial learning rate, which decreases to 0 along a cosine. Default 1.5e-3.
    pub rate: f32,
    /// Weight decay of the parameters of the network. Default 1e-5.
    pub decay: f32,
    /// Size of the random variations of letters: rotations in rad, deformations as a fraction of the size.
    /// Default 0.08.
    pub augmentation: f64,
    /// Seed of the network's initial weights, and of the order and variations of the letters. Default 1.
    pub seed: u64,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            eigenforces: 16,
            epochs: 220,
            batch: 8,
            rate: 1.5e-3,
            decay: 1e-5,
            augmentation: 0.08,
            seed: 1,
        }
    }
}

/// A network that maps pictures of letters to movements. It predicts the weights of a motion library.
///
/// ```
/// use motorium_learners::perception::{Coupling, Picture, Training, unit_extent};
/// use motorium_library::letters::{Variation, letters};
/// use motorium_library::{DAMPING, SampledSpring};
///
/// let mut known = letters(1, Variation::default(), 1);
/// known.trajectories.truncate(4);
/// let spring = SampledSpring::new(40, DAMPING)?;
/// // A real training takes the default of 220 epochs.
/// let training = Training { epochs: 1, eigenforces: 4, ..Training::default() };
/// let coupling = Coupling::train(&known, spring, &training, |epoch, loss| println!("{epoch}: {loss}"))?;
///
/// let letter = known.trajectories[0].resampled(40);
/// let movement = coupling.movement(&Picture::from_path(&unit_extent(&letter)));
/// assert_eq!(movement.path(coupling.library()).shape(), (40, 2));
/// # Ok::<(), motorium_library::BuildError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Coupling {
    pub(super) network: ConvolutionalNetwork,
    pub(super) library: MotionLibrary,
    /// Mean and scale of the outputs, `o = mean + scale z` for the output `z` of the network.
    pub(super) mean: DVector<f64>,
    pub(super) scale: DMatrix<f64>,
    pub(super) pen_speed: f64,
}

impl Coupling {
    /// Trains a coupling on letters. `progress` receives the epoch (from 1) and its mean loss, which is the
    /// squared error of position in units of the letter's size.
    ///
    /// # Errors
    /// [`BuildError`] if there are no letters, or letters do not have two degrees of freedom.
    pub fn train(
        letters: &Recordings,
        spring: SampledSpring,
        training: &Training,
        mut progress: impl FnMut(usize, f64),
    ) -> Result<Self, BuildError> {
        let curves: Vec<DMatrix<f64>> = letters
            .trajectories
            .iter()
            .map(|letter| unit_extent(&even_speed(&letter.sampled(&spring), spring.samples())))
            .collect();
        let written = letters.trajectories.iter().zip(&curves);
        let trajectories =
            written.map(|(letter, curve)| Trajectory { positions: curve.clone(), ..letter.clone() });
        let set = Recordings { names: letters.names.clone(), trajectories: trajectories.collect() };
        let library =
            MotionLibrary::build(&set, spring, Metric::Position, Truncation::Rank(training.eigenforces))?;
        let outputs: Vec<DVector<f64>> = curves.iter().map(|curve| output(curve, &library)).collect();
        let mean = outputs.iter().sum::<DVector<f64>>() / outputs.len() as f64;
        let scale = scale(&library);
        let inverse = scale.clone().try_inverse().expect("a triangular matrix with a positive diagonal");
        let mut random = Pcg64::seed_from_u64(training.seed);
        let mut network = ConvolutionalNetwork::random(mean.len(), &mut random);
        let mut adam = network.optimiser();
        let mut order: Vec<usize> = (0..curves.len()).collect();
        let label = |k: usize| letters.trajectories[k].label.as_deref();
        let same_label =
            |k: usize| (0..curves.len()).filter(|j| label(k).is_some() && label(*j) == label(k)).collect();
        let siblings: Vec<Vec<usize>> = (0..curves.len()).map(same_label).collect();
        let batches = training.epochs * curves.len().div_ceil(training.batch);
        let mut step = 0;
        for epoch in 1..=training.epochs {
            order.shuffle(&mut random);
            let mut total = 0.0;
            for chunk in order.chunks(training.batch.max(1)) {
                let mut pictures = DMatrix::zeros(PIXELS * PIXELS, chunk.len());
                let mut targets = DMatrix::zeros(mean.len(), chunk.len());
                for (column, letter) in chunk.iter().enumerate() {
                    let curve = between(&curves, &siblings[*letter], *letter, &mut random);
                    let curve = augmented(&curve, training.augmentation, &mut random);
                    pictures.column_mut(column).copy_from_slice(&Picture::from_path(&curve).0);
                    let target = &inverse * (output(&curve, &library) - &mean);
                    targets
                        .column_mut(column)
                        .iter_mut()
                        .zip(target.iter())
                        .for_each(|(t, z)| *t = *z as f32);
                }
                let part = step as f32 / batches as f32;
                let rate = training.rate * 0.5 * (1.0 + (std::f32::consts::PI * part).cos());
                let loss = network.learn(&mut adam, (&pictures, &targets), rate, training.decay);
                total += f64::from(loss) * chunk.len() as f64;
                step += 1;
            }
            progress(epoch, 2.0 * total / curves.len() as f64 * UNIT * UNIT);
        }
        Ok(Self { network, library, mean, scale, pen_speed: pen_speed(letters) })
    }

    /// Returns the movement that writes the letter in a picture. The movement has an extent of 1 and lasts 1
    /// s.
    pub fn movement(&self, picture: &Picture) -> Superposition {
        let seen = self.network.forward(&DMatrix::from_column_slice(PIXELS * PIXELS, 1, &picture.0));
        let z = DVector::from_iterator(seen.len(), seen.iter().map(|value| f64::from(*value)));
        let out = &self.mean + &self.scale * z;
        let (n, dofs) = (self.library.rank(), self.library.layout().dofs());
        let numbers = |k: usize| out.as_slice()[n + k * dofs..n + (k + 1) * dofs].to_vec();
        let frame = Frame { start: numbers(0), goal: numbers(1), velocity: numbers(2), duration: 1.0 };
        Superposition { weights: out.as_slice()[..n].to_vec(), frame }
    }

    /// Returns the movement that writes the letter in a picture at a given pen speed (letter sizes per
    /// second). The default is the speed of the training letters. The picture does not show the speed, so the
    /// speed is constant along the stroke.
    pub fn written(&self, picture: &Picture, pen_speed: Option<f64>) -> Superposition {
        let mut movement = self.movement(picture);
        let length = length(&movement.path(&self.library));
        movement.frame.duration = length / pen_speed.unwrap_or(self.pen_speed);
        movement
    }

    /// Returns the mean pen speed of the training letters, in letter sizes per second. The size of a letter
    /// is the longer side of its bounding box.
    pub fn pen_speed(&self) -> f64 {
        self.pen_speed
    }

    /// Returns the library whose weights the coupling predicts.
    pub fn library(&self) -> &MotionLibrary {
        &self.library
    }

    /// Returns the network.
    pub fn network(&self) -> &ConvolutionalNetwork {
        &self.network
    }
}

/// Returns the length of a path.
pub fn length(path: &DMatrix<f64>) -> f64 {
    (1..path.nrows()).map(|k| (path.row(k) - path.row(k - 1)).norm()).sum()
}

/// Returns the mean over letters of their length in letter sizes divided by their duration.
fn pen_speed(letters: &Recordings) -> f64 {
    let each =
        letters.trajectories.iter().map(|letter| length(&unit_extent(&letter.positions)) / letter.duration);
    each.sum::<f64>() / letters.trajectories.len().max(1) as f64
}

/// Returns a random blend of a letter with another of its label, up to halfway: a blend of movements is a
/// movement.
fn between(curves: &[DMatrix<f64>], siblings: &[usize], letter: usize, random: &mut Pcg64) -> DMatrix<f64> {
    let Some(sibling) = siblings.choose(random) else { return curves[letter].clone() };
    let part = 0.5 * random.random::<f64>();
    &curves[letter] * (1.0 - part) + &curves[*sibling] * part
}

/// Returns the network's target output for a curve: weights, start, goal, velocity.
fn output(curve: &DMatrix<f64>, library: &MotionLibrary) -> DVector<f64> {
    let trajectory = Trajectory { id: String::new(), label: None, duration: 1.0, positions: curve.clone() };
    let movement = Movement::from_trajectory(&trajectory, library.spring());
    let weights = library.project(&movement.forces);
    let frame = &movement.frame;
    let all = weights.iter().chain(&frame.start).chain(&frame.goal).chain(&frame.velocity);
    DVector::from_iterator(library.rank() + 3 * frame.dofs(), all.copied())
}

/// Position error, in letter sizes, of one unit of the network's output.
const UNIT: f64 = 0.2;

/// Returns `L^-T` for `A^T A = L L^T`, where `A` contains the path of each output.
fn scale(library: &MotionLibrary) -> DMatrix<f64> {
    let (spring, dofs, n) = (library.spring(), library.layout().dofs(), library.rank());
    let samples = spring.samples();
    let mut paths = DMatrix::zeros(samples * dofs, n + 3 * dofs);
    let zero = vec![0.0; spring.forces()];
    for k in 0..n {
        let forces = library.eigenforces().column(k);
        for (d, forces) in forces.as_slice().chunks_exact(spring.forces()).enumerate() {
            spring.path_of(
                forces,
                [0.0; 3],
                &mut paths.column_mut(k).as_mut_slice()[d * samples..(d + 1) * samples],
            );
        }
    }
    // in the order of the outputs: start, goal, velocity
    for (kind, state) in [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]].into_iter().enumerate() {
        for d in 0..dofs {
            let mut column = paths.column_mut(n + kind * dofs + d);
            spring.path_of(&zero, state, &mut column.as_mut_slice()[d * samples..(d + 1) * samples]);
        }
    }
    let mut gram = paths.transpose() * &paths / (samples as f64 * UNIT * UNIT);
    let size = gram.diagonal().max();
    for k in 0..gram.nrows() {
        gram[(k, k)] += 1e-12 * size;
    }
    let factor = gram.cholesky().expect("a Gram matrix with a raised diagonal is positive definite").unpack();
    factor.transpose().try_inverse().expect("a triangular matrix with a positive diagonal")
}
