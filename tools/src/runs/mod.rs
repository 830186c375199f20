//! Finds the run that a command refers to, and opens it for inspection.

mod choose;
mod events;

use motorium::os::{Request, apply, monotonic_ns};
use motorium::plan::{ClockKind, Plan, SchedulingClass};
use motorium::region::{Command, Region};
use motorium::run_folder::RunFolder;
use std::sync::atomic::Ordering::Relaxed;

use crate::out::errln;
use choose::Candidate;
pub(crate) use events::event_line;

/// Names a run on the command line.
#[derive(Debug, Clone, Default, clap::Args)]
pub(crate) struct RunArg {
    /// The run: its id, a prefix of the id, or the name of its graph [default: the newest run; for commands
    /// that change a run, the only one]
    #[arg(long = "run", value_name = "ID", add = crate::complete::runs())]
    run: Option<String>,
}

impl RunArg {
    /// Names a run by another option than `--run`.
    pub(crate) fn named(run: Option<&str>) -> Self {
        Self { run: run.map(str::to_string) }
    }

    /// Opens the run to inspect: the named one, or else the newest.
    pub(crate) fn look(&self) -> anyhow::Result<LivingRun> {
        opened(newest(self.run.as_deref())?)
    }

    /// Opens the run to change; one of several must be named.
    pub(crate) fn open(&self) -> anyhow::Result<LivingRun> {
        opened(pick(self.run.as_deref())?)
    }

    /// Opens a run like [`look`](Self::look). Also opens a run left behind by a crash if its full id is
    /// given.
    pub(crate) fn open_even_if_over(&self) -> anyhow::Result<LivingRun> {
        match self.run.as_deref().and_then(RunFolder::find) {
            Some(folder) => opened(folder),
            None => self.look(),
        }
    }
}

fn opened(folder: RunFolder) -> anyhow::Result<LivingRun> {
    let (plan, region) = (folder.plan()?, folder.region()?);
    anyhow::ensure!(
        region.fits(&plan),
        "the control block of run {} does not match its plan: its shared memory was damaged",
        folder.id()
    );
    Ok(LivingRun { folder, plan, region })
}

/// Returns the run to inspect: the one that `run` names, or this user's newest live run. Prints its name if
/// there are several.
pub(crate) fn newest(run: Option<&str>) -> anyhow::Result<RunFolder> {
    let (mut folders, candidates) = all();
    let chosen = choose::choose_newest(run, &candidates)?;
    if run.is_none() && candidates.iter().filter(|candidate| candidate.alive).count() > 1 {
        errln!("the newest of several runs: {} (`--run ID` for another)", candidates[chosen].id);
    }
    Ok(folders.swap_remove(chosen))
}

/// Returns the selected run: the only live one, or the one named by `run`: its id, a prefix of its id, or the
/// name of its graph.
fn pick(run: Option<&str>) -> anyhow::Result<RunFolder> {
    let (mut folders, candidates) = all();
    let chosen = choose::choose(run, &candidates)?;
    Ok(folders.swap_remove(chosen))
}

/// Returns all runs of this user, the newest first.
fn all() -> (Vec<RunFolder>, Vec<Candidate>) {
    let (mut folders, mut candidates) = (Vec::new(), Vec::new());
    for folder in RunFolder::list() {
        // A run whose plan cannot be read is being made or removed at this moment.
        let Ok(plan) = folder.plan() else { continue };
        let alive = folder.is_alive();
        candidates.push(Candidate { id: folder.id().to_string(), graph: plan.name, alive });
        folders.push(folder);
    }
    (folders, candidates)
}

/// Returns the runs of this user that are alive at this moment and not about to end: their ids and plans.
pub(crate) fn living() -> Vec<(String, Plan)> {
    let goes_on = |folder: &RunFolder| {
        let region = folder.region();
        region.is_ok_and(|region| !matches!(region.header().command(), Command::SafeStop | Command::Stop))
    };
    let runs = RunFolder::list().into_iter().filter(|folder| folder.is_alive() && goes_on(folder));
    runs.filter_map(|folder| Some((folder.id().to_string(), folder.plan().ok()?))).collect()
}

/// A live run, opened for reading.
#[derive(Debug)]
pub(crate) struct LivingRun {
    pub(crate) folder: RunFolder,
    pub(crate) plan: Plan,
    pub(crate) region: Region,
}

impl LivingRun {
    /// Returns the current time on the clock of the run's stamps, ns. In real time this is
    /// `CLOCK_MONOTONIC`, in lockstep the simulated time handed out last.
    pub(crate) fn now_ns(&self) -> u64 {
        match self.plan.clock {
            ClockKind::Realtime => monotonic_ns(),
            ClockKind::Lockstep => {
                let ticks = self.region.components().iter().map(|block| block.tick_time_ns.load(Relaxed));
                ticks.max().unwrap_or(0)
            }
        }
    }

    /// Returns the time zero of the run on the clock of its stamps, ns.
    pub(crate) fn start_ns(&self) -> u64 {
        match self.plan.clock {
            ClockKind::Realtime => self.region.header().start_ns.load(Relaxed),
            ClockKind::Lockstep => 0,
        }
    }

    /// Returns `true` if the run has ended.
    pub(crate) fn has_ended(&self) -> bool {
        self.region.header().command() == Command::Stop || !self.folder.is_alive()
    }

    /// Keeps this process off the cores of real-time components.
    pub(crate) fn stand_aside(&self) {
        let cores = self.plan.scheduling.shared_cores.clone();
        // Without permission to set its cores, the process stays where it is: at normal priority it delays no
        // real-time thread.
        let _ = apply(&Request { class: SchedulingClass::Normal, cores, lock_memory: false });
    }
}
