//! `motorium step`: advances a paused run by rounds.

use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use motorium::os::Watch;
use motorium::plan::ClockKind;

use crate::out::outln;
use crate::runs::{LivingRun, RunArg};

/// Interval between two checks whether the run is still alive.
const LOOK: Duration = Duration::from_millis(2);
/// Longest time without a round.
const ROUND_WITHIN: Duration = Duration::from_secs(10);

/// Step a paused lockstep run, pause it, or continue it.
///
/// A round is a point in simulated time at which components are due; they step one after the other. `motorium
/// run --paused` pauses a run at its start, `--hold` pauses it later.
///
/// Example: motorium step 10
#[derive(Debug, clap::Args)]
pub(crate) struct Step {
    /// Number of rounds
    #[arg(default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    rounds: u64,
    /// Pause simulated time
    #[arg(long, conflicts_with_all = ["rounds", "go"])]
    hold: bool,
    /// Continue simulated time
    #[arg(long, conflicts_with = "rounds")]
    go: bool,
    #[command(flatten)]
    run: RunArg,
    /// Print the outcome as JSON
    #[arg(long)]
    json: bool,
}

impl Step {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.open()?;
        let header = run.region.header();
        anyhow::ensure!(
            run.plan.clock == ClockKind::Lockstep,
            "graph `{}` runs in real time, which cannot be paused; launch it with `--clock lockstep`",
            run.plan.name
        );
        if self.hold || self.go {
            header.pause(self.hold);
        } else {
            anyhow::ensure!(
                header.is_paused(),
                "graph `{}` is not paused; `motorium step --hold` pauses its simulated time",
                run.plan.name
            );
            let before = header.rounds_granted.fetch_add(self.rounds, Relaxed);
            await_rounds(&run, before + self.rounds)?;
        }
        let time_s = header.reached_ns.load(Relaxed) as f64 * 1e-9;
        let (episode, held) = (header.episode.load(Relaxed), header.is_paused());
        if self.json {
            let outcome = serde_json::json!({ "time_s": time_s, "episode": episode, "held": held });
            outln!("{outcome}");
        } else {
            let what = if held { "held" } else { "continues" };
            outln!("graph `{}` {what} at {time_s:.6} s of simulated time", run.plan.name);
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Waits until the run has completed this number of rounds since its start.
fn await_rounds(run: &LivingRun, rounds: u64) -> anyhow::Result<()> {
    let header = run.region.header();
    let launcher = Watch::new(header.launcher.load(Relaxed))?;
    let (mut seen, mut since) = (0, Instant::now());
    loop {
        let taken = header.rounds_taken.load(Relaxed);
        if taken >= rounds {
            return Ok(());
        }
        anyhow::ensure!(!launcher.wait(Some(LOOK)), "the run ended meanwhile");
        anyhow::ensure!(header.is_paused(), "another program has continued the simulated time of the run");
        if taken != seen {
            (seen, since) = (taken, Instant::now());
        }
        let within = ROUND_WITHIN.as_secs();
        anyhow::ensure!(since.elapsed() < ROUND_WITHIN, "the run has completed no round within {within} s");
    }
}
