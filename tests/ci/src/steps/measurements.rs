//! Measurements with the machine alone, and the last check.

use std::fs;

use crate::context::Context;
use crate::failure::Failure;
use crate::measure::{RATCHET, RUN, Sensitivity, measured};
use crate::outcome::Outcome;
use crate::steps::report::Report;
use crate::witness::Watch;

/// Least speed of a lockstep run, relative to real time.
const MIN_FACTOR: f64 = 5.0;

/// The README's first command: the main job.
pub(crate) fn first_command(context: &Context<'_>) -> Result<Outcome, Failure> {
    measured(Watch::Gaps, Sensitivity::usual(RUN), || {
        context.run(&context.cargo("run --release"))?;
        Ok(Outcome::default())
    })
}

/// Two lockstep runs publish identical samples, at least five times faster than real time.
pub(crate) fn two_runs(context: &Context<'_>) -> Result<Outcome, Failure> {
    measured(Watch::Gaps, Sensitivity::usual(&[]), || {
        let run = context.motorium("run graphs/panda-reach.toml --clock lockstep --for 10s --json");
        let [one, two] = [Report::run(context, &run)?, Report::run(context, &run)?];
        let hashes = [one.state_hash()?, two.state_hash()?];
        let factors = [one.number("/realtime_factor")?, two.number("/realtime_factor")?];
        let text = format!("state hashes {hashes:?}, real-time factors {factors:.1?}");
        context.say(&text);
        if hashes[0] != hashes[1] {
            return Err(Failure::Check(text));
        }
        match factors[0].max(factors[1]) > MIN_FACTOR {
            true => Ok(Outcome::noted(text)),
            false => Err(Failure::RealTime(text)),
        }
    })
}

/// Buses shared with other programs, in real time.
pub(crate) fn offered_buses(context: &Context<'_>) -> Result<Outcome, Failure> {
    // a drive without an answer for three cycles of 4 ms is lost, which trips the adapter
    let sensitivity = Sensitivity { codes: RUN, endured_s: 0.012 };
    measured(Watch::Gaps, sensitivity, || {
        context.run(&context.motorium("run graphs/panda-can-socket.toml --for 3s"))?;
        Ok(Outcome::default())
    })
}

/// A recording of all topics in real time.
pub(crate) fn recorded(context: &Context<'_>) -> Result<Outcome, Failure> {
    measured(Watch::Gaps, Sensitivity::usual(RUN), || {
        let file = context.scratch("recorded.mcap");
        let run = context.motorium("run graphs/panda-reach.toml --for 20s --overwrite --json");
        let report = Report::run(context, &run.arg("--record").arg(&file))?;
        let length = fs::metadata(&file).map_err(Failure::file(&file))?.len() as f64;
        let recorder = |key: &str| report.number(&format!("/results/recorder/{key}"));
        let recording = Recording {
            samples: recorder("samples")?,
            lost: recorder("lost")?,
            share: recorder("cpu_s")? / 20.0,
            length: length / recorder("bytes")?,
            has_ended: !report.value("/results/recorder/ended")?.is_null(),
        };
        context.say(&recording.text());
        recording.judge()?;
        Ok(Outcome::noted(recording.text()))
    })
}

/// A recording of 20 s.
#[derive(Debug, Clone, Copy)]
struct Recording {
    samples: f64,
    lost: f64,
    /// Share of a core.
    share: f64,
    /// Length of the file, relative to its messages.
    length: f64,
    /// The recorder ended before the run.
    has_ended: bool,
}

impl Recording {
    fn text(&self) -> String {
        let Self { samples, lost, share, length, .. } = self;
        format!(
            "{samples} samples, {lost} lost, {:.2} % of a core, file {length:.2} times its messages",
            100.0 * share
        )
    }

    /// Without loss, with at most a twentieth of a core, and a file little larger than its messages.
    fn judge(&self) -> Result<(), Failure> {
        if self.has_ended || self.length > 1.3 {
            return Err(Failure::Check(format!("{}, ended: {}", self.text(), self.has_ended)));
        }
        match self.samples > 75_000.0 && self.lost == 0.0 && self.share <= 0.05 {
            true => Ok(()),
            false => Err(Failure::RealTime(self.text())),
        }
    }
}

/// Hops and releases, as ratios to the floors of this machine.
pub(crate) fn latency(context: &Context<'_>) -> Result<Outcome, Failure> {
    measured(Watch::Steal, Sensitivity::usual(RATCHET), || {
        context.run(&context.motorium("bench latency --ratchet"))?;
        Ok(Outcome::default())
    })
}

/// No run has left shared memory behind.
pub(crate) fn leftovers(context: &Context<'_>) -> Result<Outcome, Failure> {
    let mut found = Vec::new();
    let shared_memory = std::path::Path::new("/dev/shm");
    for name in names(shared_memory)? {
        if ["mt_", "motorium-"].iter().any(|prefix| name.starts_with(prefix)) {
            found.push(name);
        }
    }
    let aside = &context.shared().aside;
    for folder in names(aside)?.into_iter().filter(|name| name.starts_with("motorium")) {
        let runs = names(&aside.join(&folder))?;
        found.extend(runs.into_iter().map(|run| aside.join(&folder).join(run).display().to_string()));
    }
    found.sort();
    found.iter().for_each(|name| context.say(name));
    match found.first() {
        None => Ok(Outcome::default()),
        Some(first) => Err(Failure::Check(format!(
            "{} objects of shared memory left behind, such as {first}",
            found.len()
        ))),
    }
}

fn names(folder: &std::path::Path) -> Result<Vec<String>, Failure> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let entries = fs::read_dir(folder).map_err(Failure::file(folder))?;
    Ok(entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: Recording =
        Recording { samples: 80_000.0, lost: 0.0, share: 0.03, length: 1.1, has_ended: false };

    #[test]
    fn every_bound_of_a_recording_is_checked() {
        assert!(GOOD.judge().is_ok());
        let late = [
            Recording { samples: 75_000.0, ..GOOD },
            Recording { lost: 1.0, ..GOOD },
            Recording { share: 0.051, ..GOOD },
            Recording { samples: f64::NAN, ..GOOD },
        ];
        assert!(late.iter().all(|it| matches!(it.judge(), Err(Failure::RealTime(_)))));
        let wrong = [Recording { length: 1.31, ..GOOD }, Recording { has_ended: true, lost: 1.0, ..GOOD }];
        assert!(wrong.iter().all(|it| matches!(it.judge(), Err(Failure::Check(_)))));
    }
}
