//! One run of a graph as a separate process, with its faults.

mod outcome;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use motorium::launcher::Report;
use motorium::os::{Watch, monotonic_ns};
use motorium::plan::Plan;
use motorium::region::{EventKind, Phase, Region};
use motorium::run_folder::RunFolder;
use motorium::state::{JointCommand, StateBuffer as _};
use rustix::process::Signal;

use super::consequence::Consequence;
use super::fault::{Fault, Victim};
use crate::MeasureError;

/// Upper bound of the time for all consequences of a fault, used to detect hangs.
const LIMIT: Duration = Duration::from_secs(20);
/// Interval between two polls of the run's memory.
const LOOK: Duration = Duration::from_micros(200);

/// Number of printed lines of a failed run.
const LAST_LINES: usize = 12;

/// Time after a fault from which a report of the guard proves that it survived, ns.
const ANSWERED_NS: u64 = 10_000_000;

/// A run under test.
pub(super) struct Trial {
    child: Child,
    scratch: PathBuf,
    folder: RunFolder,
    pub(super) region: Region,
    pub(super) plan: Plan,
    /// All processes of the run seen so far.
    seen: Vec<Watch>,
}

/// The end of a run.
#[derive(Debug, Default)]
pub(super) struct RunEnd {
    /// True if the launcher did not end.
    pub(super) hung: bool,
    /// Number of processes that outlived the run.
    pub(super) strays: usize,
    /// Number of objects in shared memory that outlived the run.
    pub(super) leaks: usize,
    /// Exit code of the launcher; `None` if it was ended by a signal.
    pub(super) code: Option<i32>,
    /// Steps in which a joint was faster than its limit.
    pub(super) steps_beyond_a_velocity_limit: u64,
    /// The last lines that the launcher printed.
    pub(super) last_lines: String,
}

/// Counters of a run just before a fault.
struct Before {
    restarts: u32,
    steps: u64,
    guard: u32,
}

impl Before {
    fn capture(trial: &Trial, victim: &Victim) -> Self {
        let guard = trial.region.header().guard.load(Relaxed);
        let index = match victim {
            Victim::Component(name) => trial.index(name),
            _ => None,
        };
        let (restarts, steps) = index.map_or((0, 0), |index| {
            let block = &trial.region.components()[index];
            (block.restarts.load(Relaxed), block.steps.load(Relaxed))
        });
        Self { restarts, steps, guard }
    }
}

impl Trial {
    /// Starts a graph with restarts allowed and waits until each component steps.
    pub(super) fn start(program: &Path, graph: &Path, components: &[String]) -> Result<Self, MeasureError> {
        let scratch = scratch()?;
        let open = |name: &str| {
            File::create(scratch.join(name)).map_err(|error| MeasureError::system("making a file", error))
        };
        let mut command = Command::new(program);
        command.arg("run").arg(graph).args(["--json", "--for", "60 min", "--no-expect"]);
        // Lost steps of a hanging component do not fail the run here.
        command.args(["--set", "realtime.lost_steps=1"]);
        for component in components {
            for setting in ["when=always", "at_most=1000000"] {
                command.args(["--set", &format!("{component}.restart.{setting}")]);
            }
        }
        let child = command
            .stdin(Stdio::null())
            .stdout(open("report")?)
            .stderr(open("events")?)
            .spawn()
            .map_err(|error| MeasureError::system("starting motorium", error))?;
        Self::await_steps(child, scratch)
    }

    fn await_steps(mut child: Child, scratch: PathBuf) -> Result<Self, MeasureError> {
        let started = Instant::now();
        loop {
            let of_child = |folder: &RunFolder| {
                let region = folder.region().ok()?;
                let steps = region.components().iter().all(|block| block.steps.load(Relaxed) > 20);
                let owner = region.header().launcher.load(Relaxed) == child.id();
                (owner && steps && !region.components().is_empty()).then_some(region)
            };
            let found = RunFolder::list().into_iter().find_map(|folder| Some((of_child(&folder)?, folder)));
            if let Some((region, folder)) = found {
                let plan = folder.plan().map_err(|error| MeasureError::system("reading the plan", error))?;
                let mut trial = Self { child, scratch, folder, region, plan, seen: Vec::new() };
                trial.see();
                return Ok(trial);
            }
            let ended = child.try_wait().ok().flatten();
            if ended.is_some() || started.elapsed() > LIMIT {
                let _ = child.kill();
                let _ = child.wait();
                let printed = |name| std::fs::read_to_string(scratch.join(name)).unwrap_or_default();
                let events = printed("events") + &printed("report");
                let _ = std::fs::remove_dir_all(&scratch);
                return Err(MeasureError::Ended(events));
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Updates the list of processes of the run.
    fn see(&mut self) {
        let guard = self.region.header().guard.load(Relaxed);
        let workers = self.region.components().iter().map(|block| block.pid.load(Relaxed));
        self.seen.extend(workers.chain([guard]).filter_map(|pid| Watch::new(pid).ok()));
    }

    fn process(&self, victim: &Victim) -> Option<Watch> {
        let pid = match victim {
            Victim::Component(name) => self.region.components()[self.index(name)?].pid.load(Relaxed),
            Victim::Launcher => self.child.id(),
            Victim::Guard => self.region.header().guard.load(Relaxed),
            Victim::Observer => return None,
        };
        Watch::new(pid).ok()
    }

    pub(super) fn index(&self, component: &str) -> Option<usize> {
        self.plan.components.iter().position(|known| known.name == component)
    }

    /// Injects a fault into a process of the run and waits for all its consequences.
    pub(super) fn inject(
        &mut self,
        program: &Path,
        victim: &Victim,
        fault: Fault,
        pause: Duration,
    ) -> Consequence {
        self.see();
        let before = Before::capture(self, victim);
        let mut observer = None;
        let process = match victim {
            Victim::Observer => {
                observer = self.observe(program);
                observer.as_ref().and_then(|child| Watch::new(child.id()).ok())
            }
            victim => self.process(victim),
        };
        let injected_ns = monotonic_ns();
        if let Some(process) = &process {
            fault.make(process, pause);
        }
        let mut consequence = self.follow(victim, fault, &before, injected_ns);
        consequence.pause = pause;
        consequence.outcome = (!consequence.hung).then(|| self.outcome(victim, fault, &before, &consequence));
        if let Some(mut child) = observer {
            let _ = child.kill();
            let _ = child.wait();
        }
        self.see();
        consequence
    }

    /// Starts `motorium topic echo` on a topic of the run.
    fn observe(&self, program: &Path) -> Option<Child> {
        let topic = self.plan.topics.first()?;
        let child = Command::new(program)
            .args(["topic", "echo", &topic.name, "--every", "--run", self.folder.id()])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        std::thread::sleep(Duration::from_millis(50));
        Some(child)
    }

    fn follow(&self, victim: &Victim, fault: Fault, before: &Before, injected_ns: u64) -> Consequence {
        let mut seen = Consequence::default();
        let began = Instant::now();
        let index = match victim {
            Victim::Component(name) => self.index(name),
            _ => None,
        };
        loop {
            let now_ns = monotonic_ns();
            if let Some(since_ns) = self.safe_since(index, injected_ns) {
                seen.safe_ns.get_or_insert(since_ns - injected_ns);
            }
            seen.unsafe_outage |= self.outage(index, now_ns);
            match (victim, index) {
                (Victim::Component(_), Some(index)) => {
                    let block = &self.region.components()[index];
                    if block.restarts.load(Relaxed) > before.restarts {
                        seen.detected_ns
                            .get_or_insert_with(|| self.seen_ns(index, injected_ns) - injected_ns);
                    }
                    // Before the detection, the victim may have continued: the first SIGSEGV is swallowed.
                    let since_ns = injected_ns + seen.detected_ns.unwrap_or(0);
                    let back =
                        block.phase() == Phase::Running && self.published_after(index, since_ns, before);
                    let restarted = seen.detected_ns.is_some() || fault.passes();
                    if back && restarted && self.actuators_follow() {
                        if seen.detected_ns.is_some() {
                            seen.restarted_ns = Some(now_ns - injected_ns);
                        }
                        return seen;
                    }
                }
                (Victim::Guard, _) => {
                    if self.region.header().guard.load(Relaxed) != before.guard {
                        seen.detected_ns = Some(now_ns - injected_ns);
                        return seen;
                    }
                    // The guard reports every 50 ms that it is alive.
                    let alive_ns = self.region.header().guard_alive_ns.load(Relaxed);
                    if fault.is_survived(victim) && alive_ns > injected_ns + ANSWERED_NS {
                        return seen;
                    }
                }
                (Victim::Observer, _) if began.elapsed() > Duration::from_millis(50) => return seen,
                (Victim::Launcher, _)
                    if !fault.ends(victim) && began.elapsed() > Duration::from_millis(50) =>
                {
                    return seen;
                }
                (Victim::Launcher, _) if fault.ends(victim) && self.workers_ended() => return seen,
                _ => {}
            }
            if began.elapsed() > LIMIT {
                seen.hung = true;
                return seen;
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Returns the time at which the launcher detected the failure of a component, ns. Uses the launcher's
    /// own time stamp, since polling is late by milliseconds while the kernel frees the victim's memory on
    /// this core.
    fn seen_ns(&self, component: usize, injected_ns: u64) -> u64 {
        let (events, _) = self.region.events().all();
        let failed = events.iter().find(|event| {
            event.kind == EventKind::Failed
                && event.component == Some(component)
                && event.time_ns >= injected_ns
        });
        failed.map_or_else(monotonic_ns, |event| event.time_ns)
    }

    /// Returns the time at which the last actuator other than the victim entered its safe state after a
    /// fault, ns.
    fn safe_since(&self, victim: Option<usize>, injected_ns: u64) -> Option<u64> {
        let blocks = self.plan.components.iter().zip(self.region.components()).enumerate();
        let actuators = blocks.filter(|(index, (plan, _))| plan.actuator && Some(*index) != victim);
        let mut last = None;
        for (_, (_, block)) in actuators {
            let since_ns = block.safe_since_ns.load(Relaxed);
            // The state may have been left again, because a pause can end before the first poll.
            if since_ns < injected_ns {
                return None;
            }
            last = last.max(Some(since_ns));
        }
        last
    }

    /// Returns `true` while a running actuator follows a command older than ten times `stale_after` and 100
    /// ms.
    fn outage(&self, victim: Option<usize>, now_ns: u64) -> bool {
        self.plan.components.iter().zip(self.region.components()).enumerate().any(|(index, (plan, block))| {
            // Ten times the permitted age, because the polls of this process may be late, too.
            let allowed_ns = 10 * self.plan.safety_of(plan).stale_after_ns + 100_000_000;
            let commands = plan.inputs.iter().filter_map(|port| port.topic);
            let stale = commands
                .filter(|topic| self.plan.topics[*topic].layout.type_name == JointCommand::NAME)
                .any(|topic| {
                    let last_ns = self.region.topics()[topic].last_publish_ns.load(Relaxed);
                    last_ns > 0 && now_ns.saturating_sub(last_ns) > allowed_ns
                });
            plan.actuator
                && Some(index) != victim
                && stale
                && block.phase() == Phase::Running
                && block.safe.load(Relaxed) == 0
        })
    }

    fn published_after(&self, component: usize, since_ns: u64, before: &Before) -> bool {
        let mut outputs = self.plan.components[component].outputs.iter().filter_map(|port| port.topic);
        let steps = self.region.components()[component].steps.load(Relaxed);
        steps > before.steps
            && outputs.all(|topic| self.region.topics()[topic].last_publish_ns.load(Relaxed) > since_ns)
    }

    /// Returns `true` if no actuator is in its safe state.
    fn actuators_follow(&self) -> bool {
        let blocks = self.plan.components.iter().zip(self.region.components());
        blocks.filter(|(plan, _)| plan.actuator).all(|(_, block)| block.safe.load(Relaxed) == 0)
    }

    fn workers_ended(&self) -> bool {
        self.seen.iter().all(Watch::has_ended)
    }

    /// Ends the run, unless a fault has ended it, and inspects its leftovers.
    pub(super) fn end(mut self) -> RunEnd {
        self.see();
        if let Ok(launcher) = Watch::new(self.child.id()) {
            launcher.signal(Signal::CONT);
            launcher.signal(Signal::INT);
        }
        let mut end = RunEnd::default();
        match self.await_launcher() {
            Some(status) => end.code = status.code(),
            None => {
                end.hung = true;
                let _ = self.child.kill();
                let _ = self.child.wait();
            }
        }
        let began = Instant::now();
        while !self.workers_ended() && began.elapsed() < LIMIT {
            std::thread::sleep(Duration::from_millis(5));
        }
        end.strays = self.seen.iter().filter(|process| !process.has_ended()).count();
        // The guard removes its folder last.
        while self.left() > 0 && began.elapsed() < Duration::from_secs(3) {
            std::thread::sleep(Duration::from_millis(5));
        }
        end.leaks = self.left();
        let events = std::fs::read_to_string(self.scratch.join("events")).unwrap_or_default();
        let lines: Vec<&str> = events.lines().collect();
        end.last_lines = lines[lines.len().saturating_sub(LAST_LINES)..].join("\n");
        let report = std::fs::read(self.scratch.join("report")).unwrap_or_default();
        if let Ok(report) = serde_json::from_slice::<Report>(&report) {
            let beyond = report.results.values().filter_map(|result| {
                result.get("steps_beyond_a_velocity_limit").and_then(serde_json::Value::as_u64)
            });
            end.steps_beyond_a_velocity_limit = beyond.sum();
        }
        end
    }

    fn await_launcher(&mut self) -> Option<ExitStatus> {
        let began = Instant::now();
        while began.elapsed() < LIMIT {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        None
    }

    /// Returns the objects of the run that are left in shared memory.
    fn left(&self) -> usize {
        let folder = usize::from(self.folder.path().exists());
        let objects = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
        folder
            + objects.filter(|entry| entry.file_name().to_string_lossy().contains(self.folder.id())).count()
    }
}

impl Drop for Trial {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_dir_all(&self.scratch);
    }
}

/// Returns a new folder for the output of a run.
fn scratch() -> Result<PathBuf, MeasureError> {
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let name = format!("motorium-kill-{}-{}", std::process::id(), COUNT.fetch_add(1, Relaxed));
    let path: &Path = &std::env::temp_dir().join(name);
    std::fs::create_dir(path).map_err(|error| MeasureError::system("making a folder", error))?;
    Ok(path.to_path_buf())
}
