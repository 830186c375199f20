//! The guard, a process that survives a killed launcher, brings the robot to its safe state and cleans up.

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
use super::hang::{SILENCE_NS, diagnose};
use super::reached::Reached;
use super::watchdog::{Counters, Watchdog};
use crate::os::{Watch, monotonic_ns};
use crate::plan::Plan;
use crate::region::{Command, Phase, Region};
use crate::run_folder::RunFolder;

/// Interval between two checks of the launcher.
const LOOK: Duration = Duration::from_millis(50);

/// Runs the guard, which waits until the launcher ends unexpectedly and then ends the run in the launcher's
/// place. A launcher that ends normally kills its guard first.
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
    // A separate lock keeps the run alive until the guard has ended it.
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
    std::thread::sleep(Duration::from_nanos(plan.settle_ns()));
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

/// Returns the live workers of the run.
fn workers(plan: &Plan, region: &Region, folder: &RunFolder) -> Vec<(String, Watch)> {
    let workers = plan.components.iter().zip(region.components()).map(|(component, block)| {
        let pid = block.pid.load(Relaxed);
        let watch = Watch::new(pid).ok().filter(|watch| is_of_run(pid, folder, None) && !watch.has_ended());
        watch.map(|watch| (component.name.clone(), watch))
    });
    workers.flatten().collect()
}

/// Returns `true` if a process was started for this run, because process ids are reused. A zombie has no
/// arguments, but its parent is still the `launcher`.
fn is_of_run(pid: u32, folder: &RunFolder, launcher: Option<u32>) -> bool {
    let arguments = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let path = folder.path().as_os_str().as_encoded_bytes();
    arguments.windows(path.len()).any(|window| window == path)
        || (arguments.is_empty() && launcher.is_some_and(|launcher| parent_of(pid) == Some(launcher)))
}

/// Returns the parent of a process: the second field in `stat` after the name, which may contain any
/// characters.
fn parent_of(pid: u32) -> Option<u32> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    stat.rsplit_once(')')?.1.split_ascii_whitespace().nth(1)?.parse().ok()
}

/// Waits until the launcher has died, or is unresponsive when a component needs it. Returns the cause as
/// text.
///
/// An unresponsive launcher is reported once. The graph continues while all components step. If one dies or
/// hangs, only the launcher could react, so the guard kills the launcher and ends the run.
fn await_cause(
    (plan, region, folder): (&Plan, &Region, &RunFolder),
    launcher: &Watch,
    log: &EventWriter,
) -> String {
    let report = |event: Event<'_>| {
        log.write(&event);
        eprintln!("motorium: {event}");
    };
    let header = region.header();
    let mut last_look = monotonic_ns();
    let mut silent: Option<Silence> = None;
    let mut roster = Roster::new(plan);
    loop {
        let now = monotonic_ns();
        header.guard_alive_ns.store(now, Relaxed);
        let held_up = now.saturating_sub(last_look) > SILENCE_NS / 2;
        last_look = now;
        let alive_ns = header.launcher_alive_ns.load(Relaxed);
        roster.look((plan, region, folder), alive_ns, now);
        // Only a launcher that supervises in real time reports that it is alive.
        let is_silent = alive_ns != 0
            && !held_up
            && header.command() == Command::Run
            && now.saturating_sub(alive_ns) > SILENCE_NS;
        match &mut silent {
            None if is_silent => {
                report(Event::LauncherSilent { run: folder.id() });
                silent = Some(Silence::new(plan, region, now));
                // A component that ended after the launcher's last sign of life already needs it.
                continue;
            }
            Some(_) if !is_silent => {
                report(Event::LauncherBack { run: folder.id() });
                silent = None;
            }
            Some(silence) => {
                if let Some(needs) = silence.needs_launcher(&roster, plan, region, now) {
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

/// Processes of the components, as seen by the guard since the launcher's last sign of life.
struct Roster {
    launcher: Option<u32>,
    workers: Vec<Option<Seen>>,
}

/// The process of one component.
struct Seen {
    pid: u32,
    watch: Watch,
    /// Time of its detected end, ns. A launcher with a later sign of life has handled it.
    ended_ns: Option<u64>,
    is_handled: bool,
}

impl Roster {
    fn new(plan: &Plan) -> Self {
        Self { launcher: None, workers: plan.components.iter().map(|_| None).collect() }
    }

    /// Checks for new and ended processes. `alive_ns` is the launcher's last sign of life.
    fn look(&mut self, (plan, region, folder): (&Plan, &Region, &RunFolder), alive_ns: u64, now: u64) {
        let launcher = *self.launcher.get_or_insert_with(|| region.header().launcher.load(Relaxed));
        for (seen, (_, block)) in self.workers.iter_mut().zip(plan.components.iter().zip(region.components()))
        {
            let pid = block.pid.load(Relaxed);
            if pid != 0 && pid != launcher && seen.as_ref().is_none_or(|seen| seen.pid != pid) {
                let watch = Watch::new(pid).ok().filter(|_| is_of_run(pid, folder, Some(launcher)));
                *seen = watch.map(|watch| Seen { pid, watch, ended_ns: None, is_handled: false });
            }
            let Some(seen) = seen else { continue };
            if seen.ended_ns.is_none() && seen.watch.has_ended() {
                seen.ended_ns = Some(now);
            }
            seen.is_handled |= seen.ended_ns.is_some_and(|ended_ns| alive_ns > ended_ns);
        }
    }

    /// Returns the first component whose end is unhandled.
    fn unhandled(&self) -> Option<usize> {
        self.workers
            .iter()
            .position(|seen| seen.as_ref().is_some_and(|seen| seen.ended_ns.is_some() && !seen.is_handled))
    }

    /// Returns `true` if the process of a component is alive.
    fn is_alive(&self, component: usize) -> bool {
        self.workers[component].as_ref().is_some_and(|seen| seen.ended_ns.is_none())
    }
}

/// Supervision by the guard while the launcher does not respond.
struct Silence {
    watchdogs: Vec<Watchdog>,
}

impl Silence {
    fn new(plan: &Plan, region: &Region, now: u64) -> Self {
        let indices = 0..plan.components.len();
        Self { watchdogs: indices.map(|index| Watchdog::new(plan, region, index, now)).collect() }
    }

    /// Returns the first component that needs the launcher, as text: it died since the launcher's last sign
    /// of life, hangs, or was due for a restart.
    fn needs_launcher(&mut self, roster: &Roster, plan: &Plan, region: &Region, now: u64) -> Option<String> {
        let name = |index: usize| &plan.components[index].name;
        if let Some(index) = roster.unhandled() {
            return Some(format!("component `{}` ended", name(index)));
        }
        self.watchdogs.iter_mut().enumerate().find_map(|(index, watchdog)| {
            let block = &region.components()[index];
            if !roster.is_alive(index) {
                let is_awaited = block.phase() == Phase::Created && roster.workers[index].is_some();
                return is_awaited.then(|| format!("component `{}` was to be restarted", name(index)));
            }
            let overdue = watchdog.check(&Counters::read(plan, region, index), now)?;
            Some(format!("component `{}` {}", name(index), diagnose(plan, region, index, overdue)))
        })
    }
}

/// Describes the states of the actuators. Returns `true` with the text if all are in their safe state.
fn describe_safety(
    plan: &Plan,
    region: &Region,
    workers: &[(String, Watch)],
    noticed: u64,
) -> (String, bool) {
    let (mut words, mut are_safe) = (Vec::new(), true);
    for (component, block) in plan.components.iter().zip(region.components()) {
        if !component.actuator {
            continue;
        }
        let state = serde_json::to_value(plan.safety_of(component).gate.safe_state).unwrap_or_default();
        let state = state.as_str().unwrap_or_default();
        let name = &component.name;
        let worker = workers.iter().find(|(worker, _)| worker == name);
        let ended = worker.is_none_or(|(_, watch)| watch.has_ended());
        let reached = Reached::from_block(block, ended, noticed);
        are_safe &= matches!(reached, Reached::Safe { .. });
        words.push(match reached {
            Reached::Safe { since_ns } if since_ns < noticed => {
                let before = (noticed - since_ns) as f64 * 1e-6;
                format!("`{name}` in its safe state ({state}) {before:.1} ms before the guard noticed")
            }
            Reached::Safe { since_ns } => {
                let after = (since_ns - noticed) as f64 * 1e-6;
                format!("`{name}` in its safe state ({state}) {after:.1} ms after the guard noticed")
            }
            Reached::Moving => format!("`{name}` in its safe state ({state}), and not at rest"),
            Reached::Not => format!("`{name}` did not reach its safe state"),
            Reached::Dead => format!("`{name}` had no process that could reach its safe state"),
        });
    }
    let words = if words.is_empty() { "the graph has no actuators".to_string() } else { words.join(", ") };
    (words, are_safe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parent_of_a_process_is_found_by_its_id() {
        assert_eq!(
            parent_of(std::process::id()),
            Some(rustix::process::getppid().unwrap().as_raw_nonzero().get() as u32)
        );
        assert_eq!(parent_of(0), None);
    }
}
