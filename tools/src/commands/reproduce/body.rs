//! Figures 3.18 and 3.19: a full body and its parts.

use std::path::Path;

use motorium_learners::experiments::body::{Body, CHANNELS, RATE, difference, learned_alone, windows};
use motorium_learners::experiments::search::{Search, SearchSpace, is_clearly_larger};
use motorium_library::statistics::{mean_and_error, share_errors, with_error};
use motorium_library::{MotionLibrary, Recordings};
use motorium_pictures::chart::Series;
use motorium_recordings::Selection;

use super::letters::chart;
use super::writer::FigureWriter;
use crate::report::decimal;

pub(super) fn figures(writer: &mut FigureWriter, folder: &Path, searched: usize) -> anyhow::Result<()> {
    let channels = CHANNELS.map(String::from).to_vec();
    let selection = Selection { rate: Some(RATE), channels, ..Selection::default() };
    let (seen, held) = windows(Recordings::read([folder], &selection)?);
    anyhow::ensure!(held.trajectories.len() > 10, "{}: too few movements", folder.display());
    let body = Body::learn(&seen)?;
    writer.bar.inc(1);
    spectra(writer, &seen, &body)?;
    let off = difference(&body.together, &body.whole);
    let claim = "libraries of arms and legs that moved together merge into the whole body's library";
    writer.claim(
        "3.18",
        claim,
        off <= 1e-12,
        format!("largest difference of singular values {} of the first", decimal(off)),
    );
    composed(writer, &held, &body, searched)
}

fn spectra(writer: &mut FigureWriter, seen: &Recordings, body: &Body) -> anyhow::Result<()> {
    let mut series = Vec::new();
    let mut words = Vec::new();
    let mut counts = Vec::new();
    let mut off: f64 = 0.0;
    for (name, library) in [
        ("full body", &body.whole),
        ("both arms", &body.arms),
        ("both legs", &body.legs),
        ("right arm", &body.right_arm),
        ("left leg", &body.left_leg),
    ] {
        let needed = [0.8, 0.9, 0.95].map(|part| library.rank_explaining(part));
        words.push(format!("{name} {needed:?}"));
        counts.push(needed[1]);
        let together = library.explained_together();
        let errors = share_errors(&library.explained(), library.entries().len());
        let numbered = together.iter().zip(&errors).enumerate();
        let points = numbered.map(|(k, (sum, error))| [(k + 1) as f64, *sum, error.1]).collect();
        series.push(Series { name: name.into(), points });
        off = off.max(difference(library, &learned_alone(seen, library)?));
        writer.bar.inc(1);
    }
    let title = "3.18  Variance explained together: the body and its parts";
    let axes = ["eigenforces", "part of the variance"];
    writer.chart("fig-3-18-parts", &chart(title, axes, [true, false], series))?;
    writer.claim(
        "3.18",
        "parts of a body take fewer eigenforces than the whole",
        counts[1..].iter().all(|count| *count < counts[0]),
        format!("for 80, 90, 95 %: {}", words.join(", ")),
    );
    let claim = "parts split off without the recordings are those learned from the recordings";
    writer.claim(
        "3.18",
        claim,
        off <= 1e-12,
        format!("largest difference of singular values {} of the first", decimal(off)),
    );
    Ok(())
}

fn composed(
    writer: &mut FigureWriter,
    held: &Recordings,
    body: &Body,
    searched: usize,
) -> anyhow::Result<()> {
    let goals = body.composites(held);
    let kinds: [(&str, &MotionLibrary); 3] =
        [("full body", &body.whole), ("arms + legs", &body.two_parts), ("four limbs", &body.four_parts)];
    let mut series = Vec::new();
    let mut at = Vec::new();
    for (name, library) in kinds {
        let mut points = Vec::new();
        for n in [8, 16, 32, 64, 128, 256] {
            let (mean, error) = mean_and_error(&body.errors(library, n, &goals));
            points.push([n as f64, mean, error]);
            at.push((name, n, mean, error));
        }
        series.push(Series { name: name.into(), points });
        writer.bar.inc(1);
    }
    let title = "3.19  Arms of one movement with the legs of another";
    let axes = ["weights in all", "error of position / spread"];
    writer.chart("fig-3-19-composed", &chart(title, axes, [true, true], series))?;
    let found = |name: &str, n: usize| {
        at.iter().find(|a| a.0 == name && a.1 == n).map_or((f64::NAN, 0.0), |a| (a.2, a.3))
    };
    let words = |n: usize| {
        let each = kinds.map(|(name, _)| {
            let (mean, error) = found(name, n);
            format!("{name} {}", with_error(mean, error))
        });
        format!("n = {n}: {}", each.join(", "))
    };
    let split_wins = |n: usize| is_clearly_larger(found("full body", n), found("arms + legs", n));
    let claim =
        "libraries of parts hold composed movements better than one of the whole body, at every number";
    let all = [8, 16, 32, 64, 128, 256];
    let clear: Vec<usize> = all.into_iter().filter(|n| split_wins(*n)).collect();
    let evidence = format!("clearly better at n = {clear:?}; {}; {}", words(16), words(256));
    writer.claim("3.19", claim, clear.len() == all.len(), evidence);
    let goals: Vec<_> = goals.into_iter().step_by(5).take(searched).collect();
    let mut series = Vec::new();
    let mut finals = Vec::new();
    for n in [16, 64] {
        for (name, library) in kinds {
            // weights of a merged library vary as in the whole: over as many movements
            let space = SearchSpace {
                functions: body.eigenforces(library, n),
                ..SearchSpace::library_of(library, n, body.whole.entries().len())
            };
            let search = Search::new(&space, &goals, body.whole.spring());
            series.push(Series { name: format!("{name}, n = {n}"), points: search.curve() });
            finals.push((name, n, search.reward()));
            writer.bar.inc(1);
        }
    }
    let title = "3.19  Policy search (PoWER) for composed movements";
    writer.chart("fig-3-19-power", &chart(title, ["rollouts", "best reward"], [true, false], series))?;
    let reward =
        |name: &str, n: usize| finals.iter().find(|f| f.0 == name && f.1 == n).map_or((0.0, 0.0), |f| f.2);
    let wins = |n: usize| is_clearly_larger(reward("arms + legs", n), reward("full body", n));
    let words: Vec<String> = finals
        .iter()
        .map(|(name, n, (mean, error))| format!("{name}, n = {n}: {}", with_error(*mean, *error)))
        .collect();
    let claim = "policy search for composed movements is better in libraries of parts";
    writer.claim("3.19", claim, wins(16) && wins(64), words.join("; "));
    Ok(())
}
