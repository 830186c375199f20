//! Letters: figures 3.9, 3.11, 3.12 and 3.14, the eigenforces, and recognition.
//!
//! Figures whose number is not certain are named by their content.

use motorium_library::cross_validation::{FORCE, POSITION};
use motorium_library::statistics::{mean_and_deviation, proportion_error, share_errors, with_error};
use motorium_library::{
    BALANCED, CrossValidation, Evaluation, Metric, MotionLibrary, Movement, Recordings, SampledSpring,
    Truncation, compare, kernel_error, nearest_neighbour_rate,
};
use motorium_pictures::chart::{Chart, Series, Tile, tiles};

use super::writer::FigureWriter;

const TERMS: [usize; 7] = [4, 8, 12, 16, 24, 32, 64];

pub(super) fn chart(title: &str, [x, y]: [&str; 2], [log_x, log_y]: [bool; 2], series: Vec<Series>) -> Chart {
    Chart { title: title.into(), x: x.into(), y: y.into(), log_x, log_y, series }
}

pub(super) fn figures(
    writer: &mut FigureWriter,
    seen: &Recordings,
    held: &Recordings,
    spring: SampledSpring,
) -> anyhow::Result<()> {
    let force = MotionLibrary::build(seen, spring, Metric::Force, Truncation::All)?;
    let position = MotionLibrary::build(seen, spring, Metric::Position, Truncation::All)?;
    writer.bar.inc(2);
    spectrum(writer, &force)?;
    eigenforces(writer, &force)?;
    reproduction(writer, &force, held)?;
    kernels_of_eigenforces(writer, &force)?;
    bases(writer, &force, &position, held)?;
    recognition(writer, &force, held)
}

fn spectrum(writer: &mut FigureWriter, library: &MotionLibrary) -> anyhow::Result<()> {
    let explained = library.explained();
    let errors = share_errors(&explained, library.entries().len());
    let points = |values: &[f64], errors: &mut dyn Iterator<Item = f64>| {
        let numbered = values.iter().zip(errors).take(100).enumerate();
        numbered.map(|(k, (value, error))| [(k + 1) as f64, *value, error]).collect::<Vec<_>>()
    };
    let together = library.explained_together();
    let series = vec![
        Series { name: "each".into(), points: points(&explained, &mut errors.iter().map(|error| error.0)) },
        Series {
            name: "together".into(),
            points: points(&together, &mut errors.iter().map(|error| error.1)),
        },
    ];
    let title = "3.9  Variance that eigenforces explain";
    writer.chart(
        "fig-3-09-eigenvalues",
        &chart(title, ["eigenforce", "part of the variance"], [true, true], series),
    )?;
    let counts = [0.8, 0.9, 0.95, 0.99].map(|part| library.rank_explaining(part));
    writer.claim(
        "3.9",
        "a few eigenforces explain most of the forces of letters",
        counts[1] <= 10,
        format!(
            "the first five explain {:.3?}; 80, 90, 95, 99 % take {counts:?} of {}",
            &explained[..5.min(explained.len())],
            explained.len()
        ),
    );
    writer.bar.inc(1);
    Ok(())
}

fn eigenforces(writer: &mut FigureWriter, library: &MotionLibrary) -> anyhow::Result<()> {
    let chart =
        crate::eigenforces::eigenforces(library, "Eigenforces 1, 2, 3 and 10", [0, 1, 2, 9].into_iter());
    writer.chart("eigenforces", &chart)?;
    writer.bar.inc(1);
    Ok(())
}

/// Returns the path of a held-out letter by the first `n` eigenforces, next to its own.
fn drawn(library: &MotionLibrary, letter: &motorium_library::Trajectory, n: usize) -> Tile {
    let movement = Movement::from_trajectory(letter, library.spring());
    let weights = library.project(&movement.forces);
    let forces = library.forces(&weights.as_slice()[..n.min(library.rank())]);
    let points = |path: nalgebra::DMatrix<f64>| path.row_iter().map(|row| [row[0], row[1]]).collect();
    Tile {
        name: format!("{}, n = {n}", letter.label.as_deref().unwrap_or("")),
        known: points(movement.path(library.spring())),
        found: points(Movement { forces, ..movement.clone() }.path(library.spring())),
    }
}

fn reproduction(writer: &mut FigureWriter, library: &MotionLibrary, held: &Recordings) -> anyhow::Result<()> {
    let mut all = Vec::new();
    let mut labels = Vec::new();
    for letter in &held.trajectories {
        if labels.len() < 6 && !labels.contains(&letter.label) {
            labels.push(letter.label.clone());
            all.extend([2, 4, 8, 16].map(|n| drawn(library, letter, n)));
        }
    }
    let title = "3.11  Held-out letters by the first n eigenforces";
    writer.write("fig-3-11-letters.svg", &tiles(title, &all, 4))?;
    writer.bar.inc(1);
    Ok(())
}

fn kernels_of_eigenforces(writer: &mut FigureWriter, library: &MotionLibrary) -> anyhow::Result<()> {
    let spring = library.spring();
    let counts = [5, 10, 20, 40, 80, 120, 160];
    let mut series = Vec::new();
    let mut at_40 = Vec::new();
    for k in [1, 2, 5, 10, 20, 50] {
        let mut points = Vec::new();
        for count in counts {
            let column = library.eigenforces().column(k.min(library.rank()) - 1);
            let error = kernel_error(column.as_slice(), spring, count);
            points.push([count as f64, error, 0.0]);
            if count == 40 {
                at_40.push((k, error));
            }
        }
        series.push(Series { name: format!("eigenforce {k}"), points });
    }
    let title = "3.12  Eigenforces approximated by radial kernels over phase";
    let axes = ["kernels for each degree of freedom", "relative error"];
    writer.chart("fig-3-12-kernels", &chart(title, axes, [true, true], series))?;
    let (second, fiftieth) = (at_40[1].1, at_40[5].1);
    writer.claim(
        "3.12",
        "later eigenforces take many more kernels than early ones",
        fiftieth > 3.0 * second,
        format!("with 40 kernels the 2nd is off by {second:.3}, the 50th by {fiftieth:.3}; a table of samples has no error"),
    );
    writer.bar.inc(1);
    Ok(())
}

fn bases(
    writer: &mut FigureWriter,
    force: &MotionLibrary,
    position: &MotionLibrary,
    held: &Recordings,
) -> anyhow::Result<()> {
    let names = [FORCE, POSITION, "fourier", "kernels", BALANCED];
    let bar = writer.bar.clone();
    let found = compare(&[(names[0], force), (names[1], position)], held, &TERMS, || bar.inc(1));
    let count = (held.trajectories.len().max(1) as f64).sqrt();
    let line = |name: &str, value: &dyn Fn(&Evaluation) -> [f64; 2]| Series {
        name: name.into(),
        points: found
            .iter()
            .filter(|(basis, _)| *basis == name)
            .map(|(_, e)| [e.n as f64, value(e)[0], value(e)[1]])
            .collect(),
    };
    let all = |value: &dyn Fn(&Evaluation) -> [f64; 2]| names.map(|name| line(name, value)).to_vec();
    let axes = ["weights in all", "error of position / spread"];
    let title = "3.14  Held-out letters: error of position";
    let series = all(&|e| [e.position.mean, e.position.deviation / count]);
    writer.chart("fig-3-14-position", &chart(title, axes, [true, true], series))?;
    let title = "3.14  Held-out letters: error of force";
    let axes = ["weights in all", "root mean square of the force left out / of the force"];
    writer.chart("fig-3-14-force", &chart(title, axes, [true, true], all(&|e| [e.force, e.force_error])))?;
    let at = |name: &str, n: usize| {
        found.iter().find(|(basis, e)| *basis == name && e.n == n).map_or(f64::NAN, |(_, e)| e.position.mean)
    };
    let words = |name: &str, n: usize| {
        let found = found.iter().find(|(basis, e)| *basis == name && e.n == n);
        let words = found.map(|(_, e)| with_error(e.position.mean, e.position.deviation / count));
        format!("{name} {}", words.unwrap_or_else(|| "none".to_owned()))
    };
    let better = |a: &str, b: &str, n: &[usize]| n.iter().all(|n| at(a, *n) < at(b, *n));
    let table = |n: usize| format!("n = {n}: {}", names.map(|name| words(name, n)).join(", "));
    writer.claim(
        "3.14",
        "eigenforces hold letters better than as many Fourier functions",
        better(names[0], names[2], &TERMS),
        [table(8), table(16), table(64)].join("; "),
    );
    writer.claim(
        "3.14",
        "eigenforces hold letters better than as many radial kernels, at every number",
        better(names[0], names[3], &TERMS),
        [table(16), table(32), table(64)].join("; "),
    );
    writer.claim(
        "3.14 (beyond the thesis)",
        "eigenforces weighted by their response are at least as good as all others, at every number",
        [names[0], names[2], names[3]].iter().all(|other| better(names[1], other, &TERMS)),
        table(32),
    );
    Ok(())
}

/// Returns the errors of position over several random splits, for the spread between splits.
pub(super) fn splits(
    writer: &mut FigureWriter,
    all: &Recordings,
    spring: SampledSpring,
    count: u64,
) -> anyhow::Result<()> {
    let bar = writer.bar.clone();
    let mut measured = CrossValidation::new(vec![16, 32, 64]);
    for seed in 1..=count {
        let (held, seen) = all.split(0.2, seed);
        measured.add(&seen, &held, spring, || bar.inc(1))?;
    }
    let mut csv = String::from("basis,weights,error of position,standard deviation over splits\n");
    for row in measured.errors() {
        let (mean, deviation) = mean_and_deviation(&row.position);
        csv += &format!("\"{}\",{},{mean},{deviation}\n", row.basis, row.n);
    }
    writer.write("fig-3-14-splits.csv", &csv)?;
    let at = |basis: &str, n: usize| measured.position_error(basis, n).unwrap_or((f64::NAN, f64::NAN));
    let words = [FORCE, POSITION, BALANCED].map(|basis| {
        let each = [16, 32, 64].map(|n| {
            let (mean, deviation) = at(basis, n);
            with_error(mean, deviation)
        });
        format!("{basis} {}", each.join(", "))
    });
    let better = [16, 32].iter().all(|n| at(BALANCED, *n).0 < at(POSITION, *n).0);
    writer.claim(
        "3.14 (beyond the thesis)",
        "with 16 and 32 weights, eigenforces balanced for the mean error are better than for the mean square",
        better,
        format!("n = 16, 32, 64, mean and spread of {count} random splits: {}", words.join("; ")),
    );
    Ok(())
}

fn recognition(writer: &mut FigureWriter, library: &MotionLibrary, held: &Recordings) -> anyhow::Result<()> {
    let count = held.trajectories.len();
    let points: Vec<[f64; 3]> = [1, 2, 4, 8, 16, 32]
        .iter()
        .map(|&n| {
            let rate = nearest_neighbour_rate(library, held, n);
            [n as f64, rate, proportion_error(rate, count)]
        })
        .collect();
    let (four, sixteen) = (points[2][1], points[4][1]);
    let series = vec![Series { name: "nearest neighbour".into(), points }];
    let title = "Held-out letters recognised";
    writer.chart("recognition", &chart(title, ["weights", "part that is right"], [true, false], series))?;
    writer.claim(
        "recognition",
        "letters are recognised by their first weights",
        sixteen > 0.9,
        format!("right: {four:.3} by 4 weights, {sixteen:.3} by 16, of {count} letters"),
    );
    writer.bar.inc(1);
    Ok(())
}
