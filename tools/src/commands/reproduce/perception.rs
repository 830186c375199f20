//! Figure 3.17: from the picture of a letter to its movement.

use motorium_learners::perception::{
    Coupling, Picture, Training, begun_at_zero, chamfer, even_speed, unit_extent,
};
use motorium_library::{DAMPING, Recordings, SampledSpring, Trajectory};
use nalgebra::DMatrix;

use super::letters::chart;
use super::sheet::{Sheet, mean};
use crate::chart::{Series, Tile, tiles};

/// Samples of the letters that are learned, and of curves that are compared.
const LEARNED: usize = 100;
const COMPARED: usize = 200;
/// The split into letters to learn from and letters to measure on. To choose the number of weights, some of the former
/// were held out.
const SPLIT: u64 = 1000;

/// Distances between curves of letters, in letter sizes (the larger side), of one way of writing them.
struct Errors {
    /// When both begin at the same point: a picture does not say where on the paper it is.
    begun: Vec<f64>,
    /// When both are centred.
    centred: Vec<f64>,
}

impl Errors {
    fn new() -> Self {
        Self { begun: Vec::new(), centred: Vec::new() }
    }

    fn add(&mut self, written: &DMatrix<f64>, wanted: &DMatrix<f64>) {
        self.begun.push(chamfer(&begun_at_zero(written), &begun_at_zero(wanted)));
        self.centred.push(chamfer(&unit_extent(written), wanted));
    }
}

pub(super) fn figure(sheet: &mut Sheet, all: &Recordings, epochs: usize, seeds: u64) -> anyhow::Result<()> {
    let (held, seen) = all.split(0.2, SPLIT);
    // as it was written, in time
    let own = |letter: &Trajectory| unit_extent(&letter.resampled(COMPARED));
    let curves = |set: &Recordings| set.trajectories.iter().map(own).collect::<Vec<_>>();
    let (known, wanted) = (curves(&seen), curves(&held));
    let pictures = |curves: &[DMatrix<f64>]| curves.iter().map(Picture::of).collect::<Vec<_>>();
    let (known_pictures, wanted_pictures) = (pictures(&known), pictures(&wanted));

    let mut neighbour = Errors::new();
    for (picture, wanted) in wanted_pictures.iter().zip(&wanted) {
        let away = |k: &usize| -> f32 {
            known_pictures[*k].0.iter().zip(&picture.0).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        let nearest = (0..known.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0);
        neighbour.add(&known[nearest], wanted);
    }

    let mut networks = Vec::new();
    let mut series = Vec::new();
    let mut shown = Vec::new();
    for seed in 1..=seeds {
        let training = Training { epochs, seed, ..Training::default() };
        let mut losses = Vec::new();
        let bar = sheet.bar.clone();
        let spring = SampledSpring::new(LEARNED, DAMPING)?;
        let coupling = Coupling::train(&seen, spring, &training, |epoch, loss| {
            losses.push([epoch as f64, loss, 0.0]);
            bar.inc(1);
        })?;
        series.push(Series { name: format!("seed {seed}"), points: losses });
        let mut errors = Errors::new();
        for (picture, wanted) in wanted_pictures.iter().zip(&wanted) {
            let path = even_speed(&coupling.see(picture).path(coupling.library()), COMPARED);
            errors.add(&path, wanted);
            shown.push(path);
        }
        networks.push(errors);
    }
    draw(sheet, &held, &wanted, &shown)?;
    let axes = ["epoch", "squared error of position / size^2"];
    sheet.chart("fig-3-17-training", &chart("3.17  Training", axes, [false, true], series))?;
    judge(sheet, &held, &neighbour, &networks)
}

/// One letter of each label, by the first network.
fn draw(
    sheet: &mut Sheet,
    held: &Recordings,
    wanted: &[DMatrix<f64>],
    found: &[DMatrix<f64>],
) -> anyhow::Result<()> {
    let mut all = Vec::new();
    let mut labels = Vec::new();
    for ((wanted, found), letter) in wanted.iter().zip(found).zip(&held.trajectories) {
        if labels.len() < 20 && !labels.contains(&letter.label) {
            labels.push(letter.label.clone());
            let points = |path: &DMatrix<f64>| path.row_iter().map(|row| [row[0], row[1]]).collect();
            let name = letter.label.clone().unwrap_or_default();
            all.push(Tile { name, known: points(wanted), found: points(found) });
        }
    }
    let title = "3.17  Letters not learned: the one seen (grey) and the one written (blue)";
    sheet.write("fig-3-17-seen-and-written.svg", &tiles(title, &all, 5))
}

fn judge(
    sheet: &mut Sheet,
    held: &Recordings,
    neighbour: &Errors,
    networks: &[Errors],
) -> anyhow::Result<()> {
    let mut csv = String::from("letter,network,nearest picture\n");
    // of each letter, the mean over the networks
    let averaged = |pick: fn(&Errors) -> &Vec<f64>| -> Vec<f64> {
        let each = |k: usize| networks.iter().map(|e| pick(e)[k]).sum::<f64>() / networks.len() as f64;
        (0..held.trajectories.len()).map(each).collect()
    };
    let begun = averaged(|errors| &errors.begun);
    for ((letter, network), neighbour) in held.trajectories.iter().zip(&begun).zip(&neighbour.begun) {
        csv += &format!("{},{network},{neighbour}\n", letter.id);
    }
    sheet.write("fig-3-17-errors.csv", &csv)?;
    let percent = |values: &[f64]| {
        let (mean, error) = mean(values);
        format!("{:.2} +- {:.2} %", 100.0 * mean, 100.0 * error)
    };
    let of_seeds: Vec<f64> = networks.iter().map(|errors| mean(&errors.begun).0).collect();
    let seeds: Vec<String> = of_seeds.iter().map(|error| format!("{:.2}", 100.0 * error)).collect();
    let words = format!(
        "mean distance of the curves (Chamfer, mean of both ways) in sizes of a letter, on {} letters not \
         learned from, +- standard error over letters. Both begun at one point: network {} (seeds: {}), nearest picture {}. Both \
         centred: network {}, nearest picture {}",
        held.trajectories.len(),
        percent(&begun),
        seeds.join(", "),
        percent(&neighbour.begun),
        percent(&averaged(|errors| &errors.centred)),
        percent(&neighbour.centred),
    );
    let (network, error) = mean(&begun);
    sheet.claim(
        "3.17",
        "a letter is written from its picture, to 3.5 % of its size",
        network + error <= 0.035,
        words,
    );
    let differences: Vec<f64> = neighbour.begun.iter().zip(&begun).map(|(a, b)| a - b).collect();
    let (better, error) = mean(&differences);
    let claim = "the network writes letters nearer to their picture than the nearest picture known";
    let words = format!("nearer by {} of a letter, pair by pair", percent(&differences));
    sheet.claim("3.17 (beyond the thesis)", claim, better > 2.0 * error, words);
    Ok(())
}
