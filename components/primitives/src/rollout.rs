//! Evenly spaced samples of a primitive's movement from start to end.
//!
//! ```
//! use motorium_primitives::dmp::{Demonstration, DmpModel, Regression, Settings};
//! use motorium_primitives::file::PrimitiveFile;
//! use motorium_primitives::rollout::{Override, roll_out};
//! use nalgebra::DMatrix;
//!
//! // a minimum-jerk stroke of one dimension, 0 to 1 in 2 s
//! let stroke = DMatrix::from_fn(101, 1, |k, _| {
//!     let p = k as f64 / 100.0;
//!     p * p * p * (10.0 - 15.0 * p + 6.0 * p * p)
//! });
//! let shown = [Demonstration::from_positions(2.0, stroke)?];
//! let model = DmpModel::fit(Settings::default(), &shown, Regression::default())?;
//! let file = PrimitiveFile::discrete(vec!["x".into()], &shown, model);
//! let elsewhere = Override { goal: Some(vec![-3.0]), duration: Some(1.0), ..Override::default() };
//! let trajectory = roll_out(&file, &elsewhere, 0.01)?;
//! assert_eq!(trajectory.time.len(), 101);
//! assert!((trajectory.position[100][0] + 3.0).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::ValueError;
use crate::dmp::{DiscreteDmp, DmpModel, MoveError, RhythmicDmp, RhythmicModel};
use crate::file::{Primitive, PrimitiveFile};
use crate::kmp::{KernelisedMovement, KmpError};
use crate::mean::MeanMovement;
use crate::promp::{ProMp, ProMpError, ProMpMean};
use crate::regression::PolynomialMovement;

/// Values that replace the demonstrated values; `None` keeps the demonstrated value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Override {
    /// Start, one entry per dimension.
    pub start: Option<Vec<f64>>,
    /// Goal of a movement or centre of a rhythm, one entry per dimension.
    pub goal: Option<Vec<f64>>,
    /// Velocity at the goal, per second, one entry per dimension; for the variant `final_velocity` only.
    pub final_velocity: Option<Vec<f64>>,
    /// Duration of a movement, or period of a rhythm, s.
    pub duration: Option<f64>,
    /// Via points of a probabilistic primitive.
    pub via: Vec<ViaPoint>,
    /// Number of periods of a rhythm. Default 2.
    pub periods: Option<f64>,
    /// Factor applied to the amplitude of a rhythm. Default 1.
    pub amplitude: Option<f64>,
}

/// A point on which a probabilistic primitive is conditioned.
#[derive(Clone, Debug, PartialEq)]
pub struct ViaPoint {
    /// Phase, 0 at the start and 1 at the end.
    pub phase: f64,
    /// Position, one entry per dimension.
    pub position: Vec<f64>,
    /// Standard deviation of the position, in the unit of the position.
    pub deviation: f64,
}

/// Evenly spaced samples of a movement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trajectory {
    /// Names of the dimensions.
    pub names: Vec<String>,
    /// Times of the samples, s, from 0.
    pub time: Vec<f64>,
    /// Positions, samples x dimensions.
    pub position: Vec<Vec<f64>>,
    /// Velocities per second, samples x dimensions.
    pub velocity: Vec<Vec<f64>>,
    /// Standard deviations of the positions, samples x dimensions; for probabilistic primitives only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation: Option<Vec<Vec<f64>>>,
}

/// Error returned when [`roll_out`] cannot sample a primitive.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RolloutError {
    /// The kind of primitive does not support the override.
    #[error("a {kind} primitive accepts {has}, but no {lacks}")]
    Override {
        /// Kind of the primitive.
        kind: &'static str,
        /// Overrides that the kind supports.
        has: &'static str,
        /// Unsupported overrides.
        lacks: &'static str,
    },
    /// The discrete or rhythmic primitive cannot start.
    #[error(transparent)]
    Move(#[from] MoveError),
    /// The probabilistic primitive cannot be conditioned.
    #[error(transparent)]
    ProMp(#[from] ProMpError),
    /// The kernelised primitive cannot be conditioned.
    #[error(transparent)]
    Kmp(#[from] KmpError),
    /// The movement misses a via point, because the demonstrations do not vary enough or other via points
    /// contradict it.
    #[error(
        "at phase {phase}, dimension {dimension}, the movement passes {reached:.4}, expected {wanted} within three times the deviation {deviation}: the demonstrations \
         do not vary enough there, or other via points contradict it; move the via point, or give it a larger deviation (`--via P:X:DEVIATION`)"
    )]
    Unmet {
        /// Phase of the via point.
        phase: f64,
        /// Index of the dimension.
        dimension: usize,
        /// Position reached by the movement.
        reached: f64,
        /// Position of the via point.
        wanted: f64,
        /// Standard deviation of the via point.
        deviation: f64,
    },
    /// The number of samples is out of range.
    #[error(transparent)]
    Value(#[from] ValueError),
}

/// Longest integration step of discrete and rhythmic primitives, s; shorter if samples are closer.
const STEP: f64 = 1e-3;

/// Number of steps per movement or period that always suffices: above 100 s the steps become longer than
/// `STEP`.
const STEPS: f64 = 1e5;

/// Maximum number of steps of a trajectory.
const MAX_STEPS: f64 = 1e9;

/// Maximum number of samples of a trajectory.
pub const MAX_SAMPLES: f64 = 1e7;

/// Runs a primitive and samples the movement every `interval` seconds.
///
/// # Errors
/// [`RolloutError`] if an override is unsupported or out of range, or there are more than [`MAX_SAMPLES`]
/// samples.
pub fn roll_out(
    file: &PrimitiveFile,
    overrides: &Override,
    interval: f64,
) -> Result<Trajectory, RolloutError> {
    match &file.primitive {
        Primitive::Discrete(model) => discrete(file, model, overrides, interval),
        Primitive::Rhythmic(model) => rhythmic(file, model, overrides, interval),
        Primitive::Probabilistic(promp) => probabilistic(file, promp, overrides, interval),
        Primitive::Kernelised(movement) => kernelised(file, movement, overrides, interval),
        Primitive::Polynomial(movement) => polynomial(file, movement, overrides, interval),
    }
}

/// Reproduces each demonstration with the same duration and number of samples. The movement starts at the
/// start of the demonstration. If the primitive is discrete, the movement ends at the goal of the
/// demonstration.
///
/// `demonstrations` contains durations (s) with positions (samples x dimensions); for a rhythm, one period
/// each.
///
/// # Errors
/// [`RolloutError`] in the same cases as [`roll_out`].
pub fn reproduce(
    file: &PrimitiveFile,
    demonstrations: &[(f64, DMatrix<f64>)],
) -> Result<Vec<Trajectory>, RolloutError> {
    let each = demonstrations.iter().map(|(duration, positions)| {
        let last = positions.nrows().saturating_sub(1);
        let row = |k: usize| Some(positions.row(k).iter().copied().collect());
        let in_time = Override { duration: Some(*duration), ..Override::default() };
        let (overrides, intervals) = match &file.primitive {
            Primitive::Discrete(_) => (Override { start: row(0), goal: row(last), ..in_time }, last),
            Primitive::Rhythmic(_) => (Override { start: row(0), periods: Some(1.0), ..in_time }, last + 1),
            Primitive::Probabilistic(_) | Primitive::Kernelised(_) | Primitive::Polynomial(_) => {
                (in_time, last)
            }
        };
        roll_out(file, &overrides, duration / intervals as f64)
    });
    each.collect()
}

fn discrete(
    file: &PrimitiveFile,
    model: &DmpModel,
    overrides: &Override,
    interval: f64,
) -> Result<Trajectory, RolloutError> {
    if !overrides.via.is_empty() || overrides.periods.is_some() || overrides.amplitude.is_some() {
        return Err(RolloutError::Override {
            kind: "discrete",
            has: "a start, a goal and a duration",
            lacks: "via points, periods or amplitude",
        });
    }
    let mut dmp = DiscreteDmp::new(model.clone());
    let duration = overrides.duration.unwrap_or(file.duration);
    let stretch = file.duration / duration;
    let start = overrides.start.as_ref().unwrap_or(&file.start);
    let goal = overrides.goal.as_ref().unwrap_or(&file.goal);
    let velocity: Vec<f64> = file.start_velocity.iter().map(|v| v * stretch).collect();
    let zeros = vec![0.0; start.len()];
    let from = [&start[..], &velocity[..], &zeros[..]];
    if model.settings().variant.may_end_in_motion() {
        let shown: Vec<f64> = file.final_velocity.iter().map(|v| v * stretch).collect();
        let last = overrides.final_velocity.as_ref().unwrap_or(&shown);
        dmp.start_striking(from, [goal, last], duration)?;
    } else {
        if let Some(last) = &overrides.final_velocity {
            dmp.start_striking(from, [goal, last], duration)?;
        }
        dmp.start_at_velocity([&start[..], &velocity[..]], goal, duration)?;
    }
    let state = |dmp: &DiscreteDmp| (dmp.position().to_vec(), dmp.velocity().to_vec());
    stepped(file, [duration, interval, duration], &mut dmp, state, |dmp, dt| dmp.step(dt))
}

fn rhythmic(
    file: &PrimitiveFile,
    model: &RhythmicModel,
    overrides: &Override,
    interval: f64,
) -> Result<Trajectory, RolloutError> {
    if !overrides.via.is_empty() || overrides.final_velocity.is_some() {
        return Err(RolloutError::Override {
            kind: "rhythmic",
            has: "a start, a centre (the goal), a period (the duration), an amplitude and periods",
            lacks: "via points or final velocity",
        });
    }
    let mut dmp = RhythmicDmp::new(model.clone());
    let period = overrides.duration.unwrap_or(file.duration);
    dmp.set_period(period)?;
    dmp.set_amplitude(overrides.amplitude.unwrap_or(1.0))?;
    if let Some(centre) = &overrides.goal {
        dmp.set_baseline(centre)?;
    }
    let velocity: Vec<f64> = file.start_velocity.iter().map(|v| v * file.duration / period).collect();
    dmp.start(0.0, overrides.start.as_ref().unwrap_or(&file.start), &velocity)?;
    let duration = period * overrides.periods.unwrap_or(2.0);
    let state = |dmp: &RhythmicDmp| (dmp.position().to_vec(), dmp.velocity().to_vec());
    stepped(file, [duration, interval, period], &mut dmp, state, |dmp, dt| dmp.step(dt))
}

/// Samples a primitive that is integrated; `scale` is the duration of its movement or its period, s.
fn stepped<T>(
    file: &PrimitiveFile,
    [duration, interval, scale]: [f64; 3],
    running: &mut T,
    state: impl Fn(&T) -> (Vec<f64>, Vec<f64>),
    step: impl Fn(&mut T, f64),
) -> Result<Trajectory, RolloutError> {
    let count = samples(duration, interval)?;
    let substeps = (interval / STEP.max(scale / STEPS)).ceil().max(1.0);
    let steps = substeps * count as f64;
    if steps > MAX_STEPS {
        let expected = "at most 10^9: choose a shorter duration or fewer periods";
        return Err(ValueError::OutOfRange { name: "the number of steps", value: steps, expected }.into());
    }
    let substeps = substeps as usize;
    let mut trajectory = empty(file);
    for k in 0..count {
        if k > 0 {
            (0..substeps).for_each(|_| step(running, interval / substeps as f64));
        }
        let (position, velocity) = state(running);
        trajectory.time.push(k as f64 * interval);
        trajectory.position.push(position);
        trajectory.velocity.push(velocity);
    }
    Ok(trajectory)
}

/// Standard deviation at an overridden start or goal of a probabilistic primitive.
const END_DEVIATION: f64 = 1e-4;

fn probabilistic(
    file: &PrimitiveFile,
    promp: &ProMp,
    overrides: &Override,
    interval: f64,
) -> Result<Trajectory, RolloutError> {
    conditions("probabilistic", overrides)?;
    let dimensions = promp.dimensions();
    let mut promp = promp.clone();
    for ViaPoint { phase, position, deviation } in places(overrides) {
        let noise = DMatrix::identity(dimensions, dimensions) * deviation * deviation;
        promp = promp.conditioned(phase, &DVector::from_vec(position), &noise)?;
    }
    met(&mut ProMpMean::from(promp.clone()), overrides)?;
    let variance = |phase: f64| Ok(promp.covariance_at(phase).diagonal());
    followed(file, ProMpMean::from(promp.clone()), Some(&variance), overrides, interval)
}

fn kernelised(
    file: &PrimitiveFile,
    movement: &KernelisedMovement,
    overrides: &Override,
    interval: f64,
) -> Result<Trajectory, RolloutError> {
    conditions("kernelised", overrides)?;
    let mut movement = movement.clone();
    for ViaPoint { phase, position, deviation } in places(overrides) {
        movement = movement.conditioned(phase, &DVector::from_vec(position), deviation)?;
    }
    let kmp = movement.kmp()?;
    met(&mut movement.running()?, overrides)?;
    let variance = |phase: f64| Ok(kmp.covariance(&[phase])?.diagonal());
    followed(file, movement.running()?, Some(&variance), overrides, interval)
}

fn polynomial(
    file: &PrimitiveFile,
    movement: &PolynomialMovement,
    overrides: &Override,
    interval: f64,
) -> Result<Trajectory, RolloutError> {
    let Override { start, goal, final_velocity, via, periods, amplitude, .. } = overrides;
    let other = start.is_some() || goal.is_some() || !via.is_empty();
    if other || final_velocity.is_some() || periods.is_some() || amplitude.is_some() {
        return Err(RolloutError::Override {
            kind: "polynomial",
            has: "a duration",
            lacks: "start, goal, final velocity, via points, periods or amplitude",
        });
    }
    followed(file, movement.clone(), None, overrides, interval)
}

/// Rejects overrides that cannot condition a distribution over movements.
fn conditions(kind: &'static str, overrides: &Override) -> Result<(), RolloutError> {
    let Override { final_velocity, periods, amplitude, .. } = overrides;
    if final_velocity.is_none() && periods.is_none() && amplitude.is_none() {
        return Ok(());
    }
    let has = "a start, a goal, via points and a duration";
    Err(RolloutError::Override { kind, has, lacks: "final velocity, periods or amplitude" })
}

/// Positions to pass: start, goal, via points.
fn places(overrides: &Override) -> impl Iterator<Item = ViaPoint> {
    let ends =
        [(0.0, &overrides.start), (1.0, &overrides.goal)].into_iter().filter_map(|(phase, position)| {
            Some(ViaPoint { phase, position: position.clone()?, deviation: END_DEVIATION })
        });
    ends.chain(overrides.via.iter().cloned())
}

/// Maximum error of the mean at a conditioned position, in standard deviations.
const MISSED: f64 = 3.0;

/// Checks that a mean passes the positions it was conditioned on.
fn met(mean: &mut impl MeanMovement, overrides: &Override) -> Result<(), RolloutError> {
    let (mut reached, mut slope) = (vec![0.0; mean.dimensions()], vec![0.0; mean.dimensions()]);
    for ViaPoint { phase, position, deviation } in places(overrides) {
        mean.mean_into(phase, &mut reached, &mut slope);
        for (dimension, (reached, wanted)) in reached.iter().zip(position).enumerate() {
            let missed = (reached - wanted).abs();
            if missed.is_nan() || missed > MISSED * deviation {
                return Err(RolloutError::Unmet { phase, dimension, reached: *reached, wanted, deviation });
            }
        }
    }
    Ok(())
}

/// Variances of the dimensions at a phase.
type Variance<'a> = &'a dyn Fn(f64) -> Result<DVector<f64>, KmpError>;

/// Samples a mean.
fn followed(
    file: &PrimitiveFile,
    mut mean: impl MeanMovement,
    variance: Option<Variance<'_>>,
    overrides: &Override,
    interval: f64,
) -> Result<Trajectory, RolloutError> {
    let duration = overrides.duration.unwrap_or(file.duration);
    let mut trajectory = empty(file);
    let mut deviations = Vec::new();
    for k in 0..samples(duration, interval)? {
        let phase = (k as f64 * interval / duration).min(1.0);
        let (mut position, mut slope) = (vec![0.0; mean.dimensions()], vec![0.0; mean.dimensions()]);
        mean.mean_into(phase, &mut position, &mut slope);
        trajectory.time.push(k as f64 * interval);
        trajectory.position.push(position);
        trajectory.velocity.push(slope.iter().map(|slope| slope / duration).collect());
        if let Some(variance) = variance {
            deviations.push(variance(phase)?.iter().map(|v| v.max(0.0).sqrt()).collect());
        }
    }
    trajectory.deviation = variance.is_some().then_some(deviations);
    Ok(trajectory)
}

fn empty(file: &PrimitiveFile) -> Trajectory {
    let names = file.names.clone();
    Trajectory { names, time: Vec::new(), position: Vec::new(), velocity: Vec::new(), deviation: None }
}

fn samples(duration: f64, interval: f64) -> Result<usize, ValueError> {
    let count = (duration / interval + 1e-9).floor() + 1.0;
    if !(interval > 0.0 && (1.0..=MAX_SAMPLES).contains(&count)) {
        let (name, expected) = ("the number of samples", "1 to ten million: choose a lower rate");
        return Err(ValueError::OutOfRange { name, value: count, expected });
    }
    Ok(count as usize)
}
