//! Figure 3.17: from the picture of a letter to its movement.

use motorium_learners::experiments::perception::{CurveErrors, Letters};
use motorium_learners::perception::Training;
use motorium_library::statistics::{mean_and_error, with_error};
use motorium_library::{DAMPING, Recordings, SampledSpring};
use motorium_pictures::chart::{Series, Tile, tiles};
use nalgebra::DMatrix;

use super::letters::chart;
use super::writer::FigureWriter;

/// Samples of the letters that are learned.
const LEARNED: usize = 100;
/// Seed of the split into letters to learn from and letters to measure on. To choose the number of weights,
/// some of the former were held out.
const SPLIT: u64 = 1000;

pub(super) fn figure(
    writer: &mut FigureWriter,
    all: &Recordings,
    epochs: usize,
    seeds: u64,
) -> anyhow::Result<()> {
    let (held, seen) = all.split(0.2, SPLIT);
    let letters = Letters::new(&seen, &held);
    let spring = SampledSpring::new(LEARNED, DAMPING)?;
    let mut networks = Vec::new();
    let mut series = Vec::new();
    for seed in 1..=seeds {
        let training = Training { epochs, seed, ..Training::default() };
        let bar = writer.bar.clone();
        let network = letters.network(spring, &training, || bar.inc(1))?;
        let losses = network.losses.iter().enumerate();
        let points = losses.map(|(epoch, loss)| [(epoch + 1) as f64, *loss, 0.0]).collect();
        series.push(Series { name: format!("seed {seed}"), points });
        networks.push(network);
    }
    if let Some(first) = networks.first() {
        draw(writer, &held, &letters.shown, &first.written)?;
    }
    let axes = ["epoch", "squared error of position / size^2"];
    writer.chart("fig-3-17-training", &chart("3.17  Training", axes, [false, true], series))?;
    let networks: Vec<CurveErrors> = networks.into_iter().map(|network| network.errors).collect();
    claims(writer, &held, &letters.nearest_picture(), &networks)
}

/// Returns one letter of each label, by the first network.
fn draw(
    writer: &mut FigureWriter,
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
    writer.write("fig-3-17-seen-and-written.svg", &tiles(title, &all, 5))
}

fn claims(
    writer: &mut FigureWriter,
    held: &Recordings,
    neighbour: &CurveErrors,
    networks: &[CurveErrors],
) -> anyhow::Result<()> {
    let mut csv = String::from("letter,network,nearest picture\n");
    let CurveErrors { begun, centred } = CurveErrors::mean(networks);
    for ((letter, network), neighbour) in held.trajectories.iter().zip(&begun).zip(&neighbour.begun) {
        csv += &format!("{},{network},{neighbour}\n", letter.id);
    }
    writer.write("fig-3-17-errors.csv", &csv)?;
    let percent = |values: &[f64]| {
        let (mean, error) = mean_and_error(values);
        format!("{} %", with_error(100.0 * mean, 100.0 * error))
    };
    let of_seeds: Vec<f64> = networks.iter().map(|errors| mean_and_error(&errors.begun).0).collect();
    let seeds: Vec<String> = of_seeds.iter().map(|error| format!("{:.2}", 100.0 * error)).collect();
    let words = format!(
        "mean distance of the curves (Chamfer, mean of both ways) in sizes of a letter, on {} letters not \
         learned from, +- standard error over letters. Both begun at one point: network {} (seeds: {}), nearest picture {}. Both \
         centred: network {}, nearest picture {}",
        held.trajectories.len(),
        percent(&begun),
        seeds.join(", "),
        percent(&neighbour.begun),
        percent(&centred),
        percent(&neighbour.centred),
    );
    let (network, error) = mean_and_error(&begun);
    writer.claim(
        "3.17",
        "a letter is written from its picture, to 3.5 % of its size",
        network + error <= 0.035,
        words,
    );
    let differences: Vec<f64> = neighbour.begun.iter().zip(&begun).map(|(a, b)| a - b).collect();
    let (better, error) = mean_and_error(&differences);
    let claim = "the network writes letters nearer to their picture than the nearest picture known";
    let words = format!("nearer by {} of a letter, pair by pair", percent(&differences));
    writer.claim("3.17 (beyond the thesis)", claim, better > 2.0 * error, words);
    Ok(())
}
