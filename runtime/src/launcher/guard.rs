//! The guard, a process that outlives a killed launcher: it brings the robot to its safe state and cleans up.

use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use rustix::process::Signal;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGTSTP};

use super::Event;
use super::event_log::EventWriter;
use super::hang::{SILENCE_NS, describe};
use super::shutdown::Reached;
use super::watchdog::{Counters, Watchdog};
use crate::os::{Watch, monotonic_ns};
use crate::plan::Plan;
use crate::region::{Command, Region};
use crate::run_folder::RunFolder;

/// Time between two looks at the launcher.
const LOOK: Duration = Duration::from_millis(50);

/// Waits for the end of the launcher, and ends the run in its place. A launcher that ends in good order kills its guard
/// first.
pub fn main(folder: &RunFolder) -> ExitCode {
    // The signals of the launcher's terminal session must not end the guard.
    for signal in [SIGINT, SIGTERM, SIGHUP, SIGTSTP] {
        let _ = signal_hook::flag::register(signal, Arc::new(AtomicBool::new(false)));
    }
    let (plan, region) = match (folder.plan(), folder.region()) {
        (Ok(plan), Ok(region)) => (plan, Rc::new(region)),
        (Err(error), _) | (_, Err(error)) => {
            eprintln!("motorium guard: {error}");
            return ExitCode::FAILURE;
        }
    };
    // Held in its own right: the run is alive until the guard has seen to its end.
    let mut folder = folder.clone();
    if let Err(error) = folder.hold() {
        eprintln!("motorium guard: {error}");
    }
    let folder = &folder;
    let log = EventWriter::new(&plan, region.clone());
    let cause = match Watch::new(region.header().launcher.load(Relaxed)) {
        Ok(launcher) => await_cause((&plan, &region, folder), &launcher, &log),
        Err(_) => "was killed".to_string(),
    };
    let noticed = monotonic_ns();
    log.write(&Event::LauncherEnded { run: folder.id(), cause: &cause });
    let workers = workers(&plan, &region, folder);
    region.header().safe_stop_ns.store(noticed, Relaxed);
    region.header().order(Command::SafeStop);
    workers.iter().for_each(|(_, watch)| watch.signal(Signal::USR2));
    std::thread::sleep(Duration::from_nanos(plan.safety.settle_ns));
    let (safe, is_safe) = describe_safety(&plan, &region, &workers, noticed);
    log.write(&Event::GuardActed { actuators: &safe, is_safe });
    region.header().order(Command::Stop);
    let until = Instant::now() + Duration::from_secs(1);
    for (_, watch) in &workers {
        while !watch.has_ended() && Instant::now() < until {
            watch.signal(Signal::USR2);
            watch.wait(Some(Duration::from_millis(20)));
        }
        watch.signal(Signal::KILL);
        watch.wait(Some(Duration::from_millis(500)));
    }
    let removed = folder.remove().len();
    eprintln!(
        "motorium: the launcher of {} {cause}; {safe}; {} components stopped, {removed} shared memory objects removed",
        folder.id(),
        workers.len()
    );
    ExitCode::SUCCESS
}

/// The living workers of the run. A process number may have been reused since: only programs that were started for this
/// run count.
fn workers(plan: &Plan, region: &Region, folder: &RunFolder) -> Vec<(String, Watch)> {
    plan.components
        .iter()
        .zip(region.components())
        .filter_map(|(component, block)| {
            let pid = block.pid.load(Relaxed);
            let watch = Watch::new(pid).ok()?;
            let arguments = std::fs::read(format!("/proc/{pid}/cmdline")).ok()?;
            let path = folder.path().as_os_str().as_encoded_bytes();
            let ours = arguments.windows(path.len()).any(|window| window == path);
            ours.then(|| (component.name.clone(), watch))
        })
        .collect()
}

/// Waits until the launcher has died, or is stopped while a component needs it. Returns the cause as text.
///
/// A launcher that is stopped or hangs is told once. The graph goes on without it as long as all components step; when one
/// dies or hangs, nobody else can act on it, and the guard kills the launcher and ends the run.
fn await_cause(
    (plan, region, folder): (&Plan, &Region, &RunFolder),
    launcher: &Watch,
    log: &EventWriter,
) -> String {
    let tell = |event: Event<'_>| {
        log.write(&event);
        eprintln!("motorium: {event}");
    };
    let header = region.header();
    let mut last_look = monotonic_ns();
    let mut silent: Option<Silence> = None;
    loop {
        let now = monotonic_ns();
        header.guard_alive_ns.store(now, Relaxed);
        let held_up = now.saturating_sub(last_look) > SILENCE_NS / 2;
        last_look = now;
        let alive_ns = header.launcher_alive_ns.load(Relaxed);
        // Only a launcher that supervises in real time says that it is alive.
        let is_silent = alive_ns != 0
            && !held_up
            && header.command() == Command::Run
            && now.saturating_sub(alive_ns) > SILENCE_NS;
        match &mut silent {
            None if is_silent => {
                tell(Event::LauncherSilent { run: folder.id() });
                silent = Some(Silence::new(plan, region, folder, now));
            }
            Some(_) if !is_silent => {
                tell(Event::LauncherBack { run: folder.id() });
                silent = None;
            }
            Some(silence) => {
                if let Some(needs) = silence.needs_launcher(plan, region, now) {
                    launcher.signal(Signal::KILL);
                    launcher.wait(Some(Duration::from_millis(500)));
                    return format!("did not respond when {needs}");
                }
            }
            None => {}
        }
        if launcher.wait(Some(LOOK)) {
            return "was killed".to_string();
        }
    }
}

/// The guard's own view on the components, while the launcher does not respond.
struct Silence {
    workers: Vec<(String, Watch)>,
    watchdogs: Vec<Watchdog>,
}

impl Silence {
    fn new(plan: &Plan, region: &Region, folder: &RunFolder, now: u64) -> Self {
        let watchdogs = plan.components.iter().map(|component| Watchdog::new(plan, component, now));
        Self { workers: workers(plan, region, folder), watchdogs: watchdogs.collect() }
    }

    /// The first component that has died or hung since, as text.
    fn needs_launcher(&mut self, plan: &Plan, region: &Region, now: u64) -> Option<String> {
        let died = self.workers.iter().find(|(_, watch)| watch.has_ended());
        if let Some((name, _)) = died {
            return Some(format!("component `{name}` ended"));
        }
        self.watchdogs.iter_mut().enumerate().find_map(|(index, watchdog)| {
            let name = &plan.components[index].name;
            // What had ended before needs nobody.
            self.workers.iter().find(|(worker, _)| worker == name)?;
            let hang = watchdog.check(&Counters::read(plan, region, index), now)?;
            Some(format!("component `{name}` {}", describe(plan, region, index, hang)))
        })
    }
}

/// The states of the actuators, as text, and whether all are in their safe state.
fn describe_safety(
    plan: &Plan,
    region: &Region,
    workers: &[(String, Watch)],
    noticed: u64,
) -> (String, bool) {
    let state = serde_json::to_value(plan.safety.gate.safe_state).unwrap_or_default();
    let state = state.as_str().unwrap_or_default();
    let (mut words, mut are_safe) = (Vec::new(), true);
    for (component, block) in plan.components.iter().zip(region.components()) {
        if !component.actuator {
            continue;
        }
        let name = &component.name;
        let worker = workers.iter().find(|(worker, _)| worker == name);
        let ended = worker.is_none_or(|(_, watch)| watch.has_ended());
        let reached = Reached::of(block, ended, noticed);
        are_safe &= matches!(reached, Reached::Safe { .. });
        words.push(match reached {
            Reached::Safe { since_ns } if since_ns < noticed => {
                let before = (noticed - since_ns) as f64 * 1e-6;
                format!("`{name}` in its safe state ({state}) {before:.1} ms before the guard noticed")
            }
            Reached::Safe { since_ns } => {
                let after = (since_ns - noticed) as f64 * 1e-6;
                format!("`{name}` in its safe state ({state}) {after:.1} ms after")
            }
            Reached::Moving => format!("`{name}` in its safe state ({state}), and not at rest"),
            Reached::Not => format!("`{name}` did not reach its safe state"),
            Reached::Dead => format!("`{name}` was not there to reach its safe state"),
        });
    }
    let words = if words.is_empty() { "the graph has no actuators".to_string() } else { words.join(", ") };
    (words, are_safe)
}
