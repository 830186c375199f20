//! Figures 3.18 and 3.19: a full body and its parts.

use std::path::Path;

use motorium_library::{
    Basis, DAMPING, Keep, Metric, MotionLibrary, Movement, Recordings, SampledSpring, Trajectory, data,
    merge_independent, merge_parts, path_errors,
};
use nalgebra::DMatrix;

use super::letters::chart;
use super::search::{Space, searches};
use super::sheet::{Sheet, mean};
use crate::chart::Series;

/// Frames of a window (2 s at 30 Hz), and frames from one to the next.
const WINDOW: usize = 60;
const STRIDE: usize = 8;
/// rad from frame to frame: more is a flip of Euler angles.
const LEAP: f64 = 0.35;
/// Frames of the Gaussian that smooths.
const SMOOTH: f64 = 1.5;

const COLUMNS: [&str; 12] = [
    "lhumerus*",
    "lradius*",
    "lwrist*",
    "lhand_*",
    "rhumerus*",
    "rradius*",
    "rwrist*",
    "rhand_*",
    "lfemur*",
    "ltibia*",
    "rfemur*",
    "rtibia*",
];
const LEFT_ARM: &str = "lhumerus*,lradius*,lwrist*,lhand_*";
const RIGHT_ARM: &str = "rhumerus*,rradius*,rwrist*,rhand_*";
const LEFT_LEG: &str = "lfemur*,ltibia*";
const RIGHT_LEG: &str = "rfemur*,rtibia*";

/// Windows of all clips: the first four fifths of each clip to learn from, the rest to measure on.
fn windows(folder: &Path) -> anyhow::Result<(Recordings, Recordings)> {
    let options = data::Options { rate: 30.0, columns: COLUMNS.map(String::from).to_vec() };
    let mut all = data::read(folder, &options)?;
    let mut rest = Recordings { names: all.names.clone(), trajectories: Vec::new() };
    for clip in &mut all.trajectories {
        clip.positions *= std::f64::consts::PI / 180.0;
        let smooth = clip.smoothed(SMOOTH);
        let cut = clip.positions.nrows() * 4 / 5;
        let part = |from: usize, rows: usize| Trajectory {
            positions: smooth.positions.rows(from, rows).into_owned(),
            duration: (rows.max(2) - 1) as f64 / 30.0,
            ..clip.clone()
        };
        let last = part(cut, clip.positions.nrows() - cut);
        let first = part(0, cut);
        rest.trajectories.push(last);
        *clip = first;
    }
    Ok((all.windows(WINDOW, STRIDE, LEAP), rest.windows(WINDOW, STRIDE, LEAP)))
}

/// Arms of one movement, legs of another from another clip.
fn composites(held: &Recordings, spring: &SampledSpring, arms: &[usize]) -> Vec<(Vec<f64>, f64)> {
    let steps = spring.forces();
    let clip = |t: &Trajectory| t.id.split('@').next().unwrap_or_default().to_string();
    let count = held.trajectories.len();
    let mut all = Vec::new();
    for (k, upper) in held.trajectories.iter().enumerate().step_by(3) {
        let lower =
            (1..count).map(|j| &held.trajectories[(k + 7 * j) % count]).find(|t| clip(t) != clip(upper));
        let Some(lower) = lower else { continue };
        let (a, b) = (Movement::of(upper, spring), Movement::of(lower, spring));
        let mut forces = b.forces.clone();
        let mut path = lower.resampled(spring.samples());
        for dof in arms {
            forces[dof * steps..(dof + 1) * steps].copy_from_slice(&a.forces[dof * steps..(dof + 1) * steps]);
            path.set_column(*dof, &upper.resampled(spring.samples()).column(*dof));
        }
        all.push((forces, Trajectory::spread(&path)));
    }
    all
}

pub(super) fn figures(sheet: &mut Sheet, folder: &Path, searched: usize) -> anyhow::Result<()> {
    let (seen, held) = windows(folder)?;
    anyhow::ensure!(held.trajectories.len() > 10, "{}: too few movements", folder.display());
    let spring = SampledSpring::new(WINDOW, DAMPING)?;
    let whole = MotionLibrary::build(&seen, spring, Metric::Force, Keep::All)?;
    sheet.bar.inc(1);
    let part = |patterns: &str| anyhow::Ok(whole.split(&whole.layout().part(&format!("part={patterns}"))?));
    let (left_arm, right_arm) = (part(LEFT_ARM)?, part(RIGHT_ARM)?);
    let (left_leg, right_leg) = (part(LEFT_LEG)?, part(RIGHT_LEG)?);
    let arms = part(&format!("{LEFT_ARM},{RIGHT_ARM}"))?;
    let legs = part(&format!("{LEFT_LEG},{RIGHT_LEG}"))?;
    spectra(
        sheet,
        &seen,
        [
            ("full body", &whole),
            ("both arms", &arms),
            ("both legs", &legs),
            ("right arm", &right_arm),
            ("left leg", &left_leg),
        ],
    )?;
    let two = merge_independent(&[&arms, &legs], Keep::All)?;
    let four = merge_independent(&[&left_arm, &right_arm, &left_leg, &right_leg], Keep::All)?;
    let correlated = merge_parts(&[&arms, &legs], Keep::All)?;
    let off = difference(&correlated, &whole);
    let claim = "libraries of arms and legs that moved together merge into that of the whole body";
    sheet.claim(
        "3.18",
        claim,
        off <= 1e-12,
        format!("largest difference of singular values {off:.1e} of the first"),
    );
    composed(sheet, &held, [&whole, &two, &four], searched)?;
    Ok(())
}

/// The largest difference of singular values, over the largest of them.
fn difference(a: &MotionLibrary, b: &MotionLibrary) -> f64 {
    let (a, b) = (&a.parts().singular, &b.parts().singular);
    let largest = b.first().copied().unwrap_or(1.0);
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / largest).fold(0.0, f64::max)
}

fn spectra(sheet: &mut Sheet, seen: &Recordings, parts: [(&str, &MotionLibrary); 5]) -> anyhow::Result<()> {
    let mut series = Vec::new();
    let mut words = Vec::new();
    let mut counts = Vec::new();
    let mut off: f64 = 0.0;
    for (name, library) in parts {
        let mut sum = 0.0;
        let together: Vec<f64> = library
            .explained()
            .iter()
            .map(|part| {
                sum += part;
                sum
            })
            .collect();
        let needed =
            [0.8, 0.9, 0.95].map(|part| together.iter().position(|sum| *sum >= part).map_or(0, |k| k + 1));
        words.push(format!("{name} {needed:?}"));
        counts.push(needed[1]);
        let points = together.iter().enumerate().map(|(k, sum)| [(k + 1) as f64, *sum, 0.0]).collect();
        series.push(Series { name: name.into(), points });
        // the same, from the recordings of that part alone
        let columns: Vec<usize> =
            (0..seen.names.len()).filter(|k| library.layout().names().contains(&seen.names[*k])).collect();
        let alone = Recordings {
            names: library.layout().names().to_vec(),
            trajectories: seen
                .trajectories
                .iter()
                .map(|t| Trajectory { positions: t.positions.select_columns(&columns), ..t.clone() })
                .collect(),
        };
        let direct = MotionLibrary::build(&alone, *library.spring(), library.metric(), Keep::All)?;
        off = off.max(difference(library, &direct));
        sheet.bar.inc(1);
    }
    let title = "3.18  Variance explained together: the body and its parts";
    let axes = ["eigenforces", "part of the variance"];
    sheet.chart("fig-3-18-parts", &chart(title, axes, [true, false], series))?;
    sheet.claim(
        "3.18",
        "parts of a body take fewer eigenforces than the whole",
        counts[1..].iter().all(|count| *count < counts[0]),
        format!("for 80, 90, 95 %: {}", words.join(", ")),
    );
    let claim = "parts split off without the recordings are those learned from the recordings";
    sheet.claim(
        "3.18",
        claim,
        off <= 1e-12,
        format!("largest difference of singular values {off:.1e} of the first"),
    );
    Ok(())
}

fn composed(
    sheet: &mut Sheet,
    held: &Recordings,
    libraries: [&MotionLibrary; 3],
    searched: usize,
) -> anyhow::Result<()> {
    let [whole, two, four] = libraries;
    let spring = *whole.spring();
    let names = whole.layout().names();
    let is_arm =
        |name: &str| ["humerus", "radius", "wrist", "hand"].iter().any(|part| name[1..].starts_with(part));
    let arms: Vec<usize> = (0..names.len()).filter(|k| is_arm(&names[*k])).collect();
    let goals = composites(held, &spring, &arms);
    // rows of the merged libraries, in the order of the whole
    let ordered = |library: &MotionLibrary, n: usize| -> DMatrix<f64> {
        let basis = Basis::eigenforces(library, n);
        let steps = spring.forces();
        let place: Vec<usize> = names
            .iter()
            .filter_map(|name| library.layout().names().iter().position(|other| other == name))
            .collect();
        DMatrix::from_fn(whole.rows(), basis.terms(), |i, k| {
            basis.functions()[(place[i / steps] * steps + i % steps, k)]
        })
    };
    let kinds = [("full body", whole), ("arms + legs", two), ("four limbs", four)];
    let data = DMatrix::from_fn(whole.rows(), goals.len(), |i, k| goals[k].0[i]);
    let spread = goals.iter().map(|goal| goal.1).sum::<f64>() / goals.len().max(1) as f64;
    let mut series = Vec::new();
    let mut at = Vec::new();
    for (name, library) in kinds {
        let mut points = Vec::new();
        for n in [8, 16, 32, 64, 128, 256] {
            let functions = ordered(library, n);
            let left = &data - &functions * (functions.transpose() * &data);
            let errors: Vec<f64> =
                path_errors(left, names.len(), &spring).into_iter().map(|error| error / spread).collect();
            let (mean, error) = mean(&errors);
            points.push([n as f64, mean, error]);
            at.push((name, n, mean, error));
        }
        series.push(Series { name: name.into(), points });
        sheet.bar.inc(1);
    }
    let title = "3.19  Arms of one movement with the legs of another";
    let axes = ["weights in all", "error of position / spread"];
    sheet.chart("fig-3-19-composed", &chart(title, axes, [true, true], series))?;
    let found = |name: &str, n: usize| {
        at.iter().find(|a| a.0 == name && a.1 == n).map_or((f64::NAN, 0.0), |a| (a.2, a.3))
    };
    let words = |n: usize| {
        let each = kinds.map(|(name, _)| {
            let (mean, error) = found(name, n);
            format!("{name} {mean:.4} +- {error:.4}")
        });
        format!("n = {n}: {}", each.join(", "))
    };
    // better by more than the standard errors
    let split_wins = |n: usize| {
        let (parts, body) = (found("arms + legs", n), found("full body", n));
        body.0 - parts.0 > parts.1.hypot(body.1)
    };
    let claim =
        "libraries of parts hold composed movements better than one of the whole body, at every number";
    let all = [8, 16, 32, 64, 128, 256];
    let clear: Vec<usize> = all.into_iter().filter(|n| split_wins(*n)).collect();
    let evidence = format!("clearly better at n = {clear:?}; {}; {}", words(16), words(256));
    sheet.claim("3.19", claim, clear.len() == all.len(), evidence);
    let goals: Vec<_> = goals.into_iter().step_by(5).take(searched).collect();
    let movements = whole.entries().len();
    let mut series = Vec::new();
    let mut finals = Vec::new();
    for n in [16, 64] {
        for (name, library) in kinds {
            let variance = Space::library(library, n, movements).variance;
            let space = Space { functions: ordered(library, n), variance };
            let (points, last) = searches(&space, &goals, &spring, 3);
            series.push(Series { name: format!("{name}, n = {n}"), points });
            finals.push((name, n, mean(&last)));
            sheet.bar.inc(1);
        }
    }
    let title = "3.19  Policy search (PoWER) for composed movements";
    sheet.chart("fig-3-19-power", &chart(title, ["rollouts", "best reward"], [true, false], series))?;
    let reward =
        |name: &str, n: usize| finals.iter().find(|f| f.0 == name && f.1 == n).map_or((0.0, 0.0), |f| f.2);
    let wins = |n: usize| {
        let (a, b) = (reward("arms + legs", n), reward("full body", n));
        a.0 - b.0 > a.1.hypot(b.1)
    };
    let words: Vec<String> = finals
        .iter()
        .map(|(name, n, (mean, error))| format!("{name}, n = {n}: {mean:.3} +- {error:.3}"))
        .collect();
    let claim = "policy search for composed movements is better in libraries of parts";
    sheet.claim("3.19", claim, wins(16) && wins(64), words.join("; "));
    Ok(())
}
