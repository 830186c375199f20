//! Figure 3.17: from the picture of a letter to its movement.

use motorium_policies::learning::perception::{
    Coupling, Picture, Training, chamfer, even_speed, unit_extent,
};
use motorium_policies::library::{DAMPING, Recordings, SampledSpring, Trajectory};
use nalgebra::DMatrix;

use super::chart::{Series, Tile, tiles};
use super::letters::chart;
use super::sheet::{Sheet, mean};

const SAMPLES: usize = 100;

pub(super) fn figure(
    sheet: &mut Sheet,
    seen: &Recordings,
    held: &Recordings,
    epochs: usize,
) -> anyhow::Result<()> {
    let curve = |letter: &Trajectory| unit_extent(&even_speed(&letter.resampled(SAMPLES), SAMPLES));
    let curves = |set: &Recordings| set.trajectories.iter().map(curve).collect::<Vec<_>>();
    let (known, wanted) = (curves(seen), curves(held));
    let pictures = |curves: &[DMatrix<f64>]| curves.iter().map(Picture::of).collect::<Vec<_>>();
    let (known_pictures, wanted_pictures) = (pictures(&known), pictures(&wanted));
    let training = Training { epochs, ..Training::default() };
    let mut losses = Vec::new();
    let bar = sheet.bar.clone();
    let coupling = Coupling::train(seen, SampledSpring::new(SAMPLES, DAMPING)?, &training, |epoch, loss| {
        losses.push([epoch as f64, loss, 0.0]);
        bar.inc(1);
    })?;
    let (mut by_network, mut by_neighbour, mut all) = (Vec::new(), Vec::new(), Vec::new());
    let mut labels = Vec::new();
    for ((picture, wanted), letter) in wanted_pictures.iter().zip(&wanted).zip(&held.trajectories) {
        let path = coupling.see(picture).path(coupling.library());
        by_network.push(chamfer(&unit_extent(&path), wanted));
        let away = |k: &usize| -> f32 {
            known_pictures[*k].0.iter().zip(&picture.0).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        let nearest = (0..known.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0);
        by_neighbour.push(chamfer(&known[nearest], wanted));
        if labels.len() < 20 && !labels.contains(&letter.label) {
            labels.push(letter.label.clone());
            let points = |path: &DMatrix<f64>| path.row_iter().map(|row| [row[0], row[1]]).collect();
            let name = letter.label.clone().unwrap_or_default();
            all.push(Tile { name, known: points(wanted), found: points(&path) });
        }
    }
    let title = "3.17  Held-out letters: the one seen (grey) and the one written (blue)";
    sheet.write("fig-3-17-seen-and-written.svg", &tiles(title, &all, 5))?;
    let series = vec![Series { name: "training".into(), points: losses }];
    let axes = ["epoch", "squared error of position / size^2"];
    sheet.chart("fig-3-17-training", &chart("3.17  Training", axes, [false, true], series))?;
    let mut csv = String::from("letter,network,nearest picture\n");
    for ((letter, network), neighbour) in held.trajectories.iter().zip(&by_network).zip(&by_neighbour) {
        csv += &format!("{},{network},{neighbour}\n", letter.id);
    }
    sheet.write("fig-3-17-errors.csv", &csv)?;
    let ((network, error), (neighbour, neighbour_error)) = (mean(&by_network), mean(&by_neighbour));
    let words = format!(
        "mean distance between the curves (Chamfer, both ways): network {:.2} +- {:.2} %, nearest picture {:.2} +- {:.2} % of \
         the size of a letter",
        100.0 * network,
        100.0 * error,
        100.0 * neighbour,
        100.0 * neighbour_error
    );
    sheet.claim("3.17", "a letter is written from its picture", network < 0.035, words.clone());
    let claim = "the network writes letters nearer to their picture than the nearest picture known";
    let better = neighbour - network > error.hypot(neighbour_error);
    sheet.claim("3.17 (beyond the thesis)", claim, better, words);
    Ok(())
}
