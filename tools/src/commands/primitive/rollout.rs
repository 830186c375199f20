//! A primitive, run from its start to its end.

use anyhow::bail;
use motorium_primitives::dmp::{DiscreteDmp, DmpModel, RhythmicDmp, RhythmicModel};
use motorium_primitives::file::{Primitive, PrimitiveFile};
use motorium_primitives::promp::ProMp;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Where to go instead of where was shown.
#[derive(Debug, Default, Clone)]
pub(super) struct Wish {
    pub(super) start: Option<Vec<f64>>,
    pub(super) goal: Option<Vec<f64>>,
    pub(super) final_velocity: Option<Vec<f64>>,
    pub(super) duration: Option<f64>,
    /// Phase, place, standard deviation.
    pub(super) via: Vec<(f64, Vec<f64>, f64)>,
    /// Of a rhythm.
    pub(super) periods: Option<f64>,
    pub(super) amplitude: Option<f64>,
}

/// Evenly spaced samples of a movement.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Trajectory {
    pub(super) names: Vec<String>,
    pub(super) time: Vec<f64>,
    /// A list for each sample.
    pub(super) position: Vec<Vec<f64>>,
    pub(super) velocity: Vec<Vec<f64>>,
    /// Standard deviations, of a probabilistic primitive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) deviation: Option<Vec<Vec<f64>>>,
}

/// The step in which discrete and rhythmic primitives are run, s, at most; shorter when samples are closer.
const STEP: f64 = 1e-3;

/// Runs a primitive and takes samples every `interval` seconds.
pub(super) fn roll_out(file: &PrimitiveFile, wish: &Wish, interval: f64) -> anyhow::Result<Trajectory> {
    match &file.primitive {
        Primitive::Discrete(model) => discrete(file, model, wish, interval),
        Primitive::Rhythmic(model) => rhythmic(file, model, wish, interval),
        Primitive::Probabilistic(promp) => probabilistic(file, promp, wish, interval),
    }
}

fn discrete(
    file: &PrimitiveFile,
    model: &DmpModel,
    wish: &Wish,
    interval: f64,
) -> anyhow::Result<Trajectory> {
    if !wish.via.is_empty() || wish.periods.is_some() || wish.amplitude.is_some() {
        bail!("a discrete primitive has a start, a goal and a duration: no via points, periods or amplitude");
    }
    let mut dmp = DiscreteDmp::new(model.clone());
    let duration = wish.duration.unwrap_or(file.duration);
    let stretch = file.duration / duration;
    let start = wish.start.as_ref().unwrap_or(&file.start);
    let goal = wish.goal.as_ref().unwrap_or(&file.goal);
    let velocity: Vec<f64> = file.start_velocity.iter().map(|v| v * stretch).collect();
    let zeros = vec![0.0; start.len()];
    let from = [&start[..], &velocity[..], &zeros[..]];
    if model.settings().variant.may_end_in_motion() {
        let shown: Vec<f64> = file.final_velocity.iter().map(|v| v * stretch).collect();
        let last = wish.final_velocity.as_ref().unwrap_or(&shown);
        dmp.start_striking(from, [goal, last], duration)?;
    } else {
        if let Some(last) = &wish.final_velocity {
            dmp.start_striking(from, [goal, last], duration)?;
        }
        dmp.start_moving(from, goal, duration)?;
    }
    let state = |dmp: &DiscreteDmp| (dmp.position().to_vec(), dmp.velocity().to_vec());
    Ok(taken(file, duration, interval, &mut dmp, state, |dmp, dt| dmp.step(dt)))
}

fn rhythmic(
    file: &PrimitiveFile,
    model: &RhythmicModel,
    wish: &Wish,
    interval: f64,
) -> anyhow::Result<Trajectory> {
    if !wish.via.is_empty() || wish.final_velocity.is_some() {
        bail!(
            "a rhythmic primitive has a start, a middle (--goal), a period (--duration), an amplitude and periods: no via points or final velocity"
        );
    }
    let mut dmp = RhythmicDmp::new(model.clone());
    let period = wish.duration.unwrap_or(file.duration);
    dmp.set_period(period)?;
    dmp.set_amplitude(wish.amplitude.unwrap_or(1.0))?;
    if let Some(middle) = &wish.goal {
        dmp.set_baseline(middle)?;
    }
    let velocity: Vec<f64> = file.start_velocity.iter().map(|v| v * file.duration / period).collect();
    dmp.start(0.0, wish.start.as_ref().unwrap_or(&file.start), &velocity)?;
    let duration = period * wish.periods.unwrap_or(2.0);
    let state = |dmp: &RhythmicDmp| (dmp.position().to_vec(), dmp.velocity().to_vec());
    Ok(taken(file, duration, interval, &mut dmp, state, |dmp, dt| dmp.step(dt)))
}

/// Samples of something that steps.
fn taken<T>(
    file: &PrimitiveFile,
    duration: f64,
    interval: f64,
    running: &mut T,
    state: impl Fn(&T) -> (Vec<f64>, Vec<f64>),
    step: impl Fn(&mut T, f64),
) -> Trajectory {
    let count = samples(duration, interval);
    let substeps = (interval / STEP).ceil().max(1.0) as usize;
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
    trajectory
}

fn probabilistic(
    file: &PrimitiveFile,
    promp: &ProMp,
    wish: &Wish,
    interval: f64,
) -> anyhow::Result<Trajectory> {
    if wish.final_velocity.is_some() || wish.periods.is_some() || wish.amplitude.is_some() {
        bail!(
            "a probabilistic primitive has a start, a goal, via points and a duration: no final velocity, periods or amplitude"
        );
    }
    let dimensions = promp.dimensions();
    let mut promp = promp.clone();
    let ends = [(0.0, &wish.start), (1.0, &wish.goal)];
    let ends = ends.iter().filter_map(|(phase, place)| Some((*phase, (*place).clone()?, 1e-4)));
    for (phase, place, deviation) in ends.chain(wish.via.iter().cloned()) {
        let noise = DMatrix::identity(dimensions, dimensions) * deviation * deviation;
        promp = promp.conditioned(phase, &DVector::from_vec(place), &noise)?;
    }
    let duration = wish.duration.unwrap_or(file.duration);
    let mut trajectory = empty(file);
    let mut deviations = Vec::new();
    for k in 0..samples(duration, interval) {
        let phase = (k as f64 * interval / duration).min(1.0);
        trajectory.time.push(k as f64 * interval);
        trajectory.position.push(promp.mean_at(phase).as_slice().to_vec());
        trajectory.velocity.push((promp.mean_velocity_at(phase) / duration).as_slice().to_vec());
        deviations.push(promp.covariance_at(phase).diagonal().iter().map(|v| v.max(0.0).sqrt()).collect());
    }
    trajectory.deviation = Some(deviations);
    Ok(trajectory)
}

fn empty(file: &PrimitiveFile) -> Trajectory {
    let names = file.names.clone();
    Trajectory { names, time: Vec::new(), position: Vec::new(), velocity: Vec::new(), deviation: None }
}

fn samples(duration: f64, interval: f64) -> usize {
    (duration / interval + 1e-9).floor() as usize + 1
}
