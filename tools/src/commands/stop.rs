//! `motorium stop` and `motorium resume`: end a run, latch its robot in the safe state, and release it.

use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use motorium::os::Watch;
use motorium::plan::ComponentPlan;
use motorium::region::{ComponentBlock, GateState, Latch, Phase};
use rustix::process::Signal;
use serde::Serialize;

use crate::out::{errln, outln};
use crate::runs::{LivingRun, RunArg};
use crate::{exit, gate, style};

/// Time limit for a launcher to end its run, in addition to the settling time of its actuators.
const END_WITHIN: Duration = Duration::from_secs(10);
/// Time limit for actuators to reach another state.
const REACT_WITHIN: Duration = Duration::from_secs(1);

/// End a run in good order, or stop its robot immediately.
///
/// Without `--now`, the launcher ends the run, as on Ctrl-C: the actuators enter their safe state first. With
/// `--now`, every actuator enters its safe state at its next step and stays there until `motorium resume`.
/// The run continues, and its launcher is not needed.
///
/// Example: motorium stop --now
#[derive(Debug, clap::Args)]
pub(crate) struct Stop {
    /// Bring the robot to its safe state immediately, and keep it there
    #[arg(long)]
    now: bool,
    #[command(flatten)]
    run: RunArg,
    /// Print the outcome as JSON
    #[arg(long)]
    json: bool,
}

/// Release the actuators of a run from a stop.
///
/// The actuators leave the safe state as set by `[safety] resume`: by default from the held pose, at limited
/// velocity and acceleration.
///
/// Example: motorium resume
#[derive(Debug, clap::Args)]
pub(crate) struct Resume {
    #[command(flatten)]
    run: RunArg,
    /// Print the outcome as JSON
    #[arg(long)]
    json: bool,
}

/// State of one actuator after a stop or its release, as JSON.
#[derive(Debug, Serialize)]
struct Actuator {
    name: String,
    state: GateState,
    latch: Option<Latch>,
    /// Time from the command until the actuator reached that state, ms; `null` if it did not reach the state
    /// in time.
    after_ms: Option<f64>,
}

impl Stop {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.open()?;
        if !self.now {
            return end(&run, self.json);
        }
        let began = Instant::now();
        run.region.header().latch(Latch::Stop);
        let is_safe = |block: &ComponentBlock| block.safe.load(Relaxed) != 0;
        let actuators = await_actuators(&run, began, is_safe);
        if actuators.is_empty() && !self.json {
            errln!("{} graph `{}` has no actuator to stop", style::warning("warning:"), run.plan.name);
        }
        let missing: Vec<&str> = actuators
            .iter()
            .filter(|actuator| actuator.after_ms.is_none())
            .map(|actuator| actuator.name.as_str())
            .collect();
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&actuators)?);
        } else {
            for actuator in &actuators {
                if let Some(after_ms) = actuator.after_ms {
                    outln!("{}: in its safe state after {after_ms:.1} ms", style::strong(&actuator.name));
                }
            }
            outln!("graph `{}` is stopped until `motorium resume`", run.plan.name);
        }
        if missing.is_empty() {
            return Ok(ExitCode::SUCCESS);
        }
        errln!(
            "{}: not in its safe state after {} s: {}; an actuator enters its safe state at its next step",
            style::error("error"),
            REACT_WITHIN.as_secs(),
            missing.join(", ")
        );
        Ok(exit::FAILED)
    }
}

impl Resume {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.open()?;
        let header = run.region.header();
        let latched = |block: &ComponentBlock| block.gate.report().is_some_and(|gate| gate.latch.is_some());
        if header.latched().is_none() && !run.region.components().iter().any(latched) {
            anyhow::bail!("graph `{}` is not stopped", run.plan.name);
        }
        let began = Instant::now();
        header.release();
        let actuators = await_actuators(&run, began, |block| !latched(block));
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&actuators)?);
        }
        let held: Vec<String> = actuators
            .iter()
            .filter_map(|actuator| {
                Some(format!("`{}`: {}", actuator.name, gate::latch_words(actuator.latch?)))
            })
            .collect();
        if held.is_empty() && header.latched().is_none() {
            if !self.json {
                let states = || {
                    let blocks = run.plan.components.iter().zip(run.region.components());
                    blocks.filter(|(component, _)| component.actuator).map(|(_, block)| block.gate.state())
                };
                let state = if states().all(|state| state == GateState::Following) {
                    "follows its commands again"
                } else if states().any(|state| state == GateState::Resuming) {
                    "is resuming: it moves to its commands at limited rates"
                } else {
                    "is released, and follows its commands once they are fresh"
                };
                outln!("graph `{}` {state}", run.plan.name);
            }
            return Ok(ExitCode::SUCCESS);
        }
        errln!(
            "{}: graph `{}` stays in its safe state ({}); release the emergency stop first",
            style::error("error"),
            run.plan.name,
            if held.is_empty() { "emergency stop".to_string() } else { held.join(", ") }
        );
        Ok(exit::FAILED)
    }
}

/// Requests the launcher to end the run, and waits for it.
fn end(run: &LivingRun, json: bool) -> anyhow::Result<ExitCode> {
    let launcher = Watch::new(run.region.header().launcher.load(Relaxed))
        .context("its launcher has ended; its guard brings the robot to its safe state and ends the remaining processes")?;
    let began = Instant::now();
    launcher.signal(Signal::INT);
    let within = END_WITHIN + Duration::from_nanos(run.plan.settle_ns());
    if !launcher.wait(Some(within)) {
        anyhow::bail!(
            "its launcher does not end the run within {} s; `motorium stop --now` stops the robot without the launcher",
            within.as_secs()
        );
    }
    let after_s = began.elapsed().as_secs_f64();
    if json {
        outln!("{}", serde_json::json!({ "run": run.folder.id(), "ended_after_s": after_s }));
    } else {
        outln!("run {} ended after {after_s:.1} s", run.folder.id());
    }
    Ok(ExitCode::SUCCESS)
}

/// Waits until every actuator is in a state, waking those that wait for a publication. A dead or restarting
/// actuator has not confirmed the state, so it is awaited, too.
fn await_actuators(
    run: &LivingRun,
    began: Instant,
    reached: impl Fn(&ComponentBlock) -> bool,
) -> Vec<Actuator> {
    let components = run.plan.components.iter().zip(run.region.components());
    let mut waiting: Vec<(&ComponentPlan, &ComponentBlock, Option<f64>)> = components
        .filter(|(component, _)| component.actuator)
        .map(|(component, block)| (component, block, None))
        .collect();
    // One step may be in progress; only the state of the next one is valid.
    let seen: Vec<u64> = waiting.iter().map(|(_, block, _)| block.steps.load(Relaxed)).collect();
    let launcher = run.region.header().launcher.load(Relaxed);
    for (_, block, _) in &waiting {
        let pid = block.pid.load(Relaxed);
        // A component hosted as a thread of the launcher has no watcher for the signal.
        if pid != launcher
            && block.phase() == Phase::Running
            && let Ok(process) = Watch::new(pid)
        {
            process.signal(Signal::USR2);
        }
    }
    while began.elapsed() < REACT_WITHIN && waiting.iter().any(|(_, _, after)| after.is_none()) {
        for ((_, block, after), seen) in waiting.iter_mut().zip(&seen) {
            let stepped = block.steps.load(Relaxed) > *seen + 1;
            if after.is_none() && block.phase() == Phase::Running && stepped && reached(block) {
                *after = Some(began.elapsed().as_secs_f64() * 1e3);
            }
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    waiting
        .into_iter()
        .map(|(component, block, after_ms)| {
            let gate = block.gate.report().unwrap_or_default();
            Actuator { name: component.name.clone(), state: gate.state, latch: gate.latch, after_ms }
        })
        .collect()
}
