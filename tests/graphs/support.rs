//! Helpers that start graphs as a user would and observe the results.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use motorium::launcher::Report;
use motorium::os::Watch;
use motorium::run_folder::RunFolder;

pub(crate) use crate::MOTORIUM;
pub(crate) use crate::program::machine;

pub(crate) const FAULTY: &str = env!("CARGO_BIN_EXE_faulty-component");

/// Returns the root of the workspace.
pub(crate) fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests are in the workspace").to_path_buf()
}

pub(crate) fn panda_reach() -> PathBuf {
    workspace().join("graphs/panda-reach.toml")
}

pub(crate) fn is_root() -> bool {
    rustix::process::getuid().is_root()
}

/// Options of a run that may lose any number of steps: the test does not depend on the load of the host.
pub(crate) const ANY_LOSS: [&str; 2] = ["--set", "realtime.lost_steps=1"];

/// Returns `true` if every component has stepped.
fn has_stepped(_: &motorium::plan::Plan, region: &motorium::region::Region) -> bool {
    region.components().iter().all(|block| steps(block) > 20)
}

/// A started run.
pub(crate) struct Run {
    child: Option<Child>,
    pub(crate) folder: RunFolder,
}

impl Run {
    /// Starts `motorium run GRAPH --json ARGUMENTS` and waits until the graph steps.
    pub(crate) fn start(graph: &Path, arguments: &[&str]) -> Self {
        Self::start_when(graph, arguments, has_stepped)
    }

    /// Like [`start`](Self::start), under `nohup`.
    pub(crate) fn start_under_nohup(graph: &Path, arguments: &[&str]) -> Self {
        let mut command = Command::new("nohup");
        Self::spawn(command.arg(MOTORIUM), graph, arguments, has_stepped)
    }

    /// Starts `motorium run GRAPH --json ARGUMENTS` and waits until it is ready.
    pub(crate) fn start_when(
        graph: &Path,
        arguments: &[&str],
        is_ready: impl Fn(&motorium::plan::Plan, &motorium::region::Region) -> bool,
    ) -> Self {
        Self::spawn(&mut Command::new(MOTORIUM), graph, arguments, is_ready)
    }

    fn spawn(
        command: &mut Command,
        graph: &Path,
        arguments: &[&str],
        is_ready: impl Fn(&motorium::plan::Plan, &motorium::region::Region) -> bool,
    ) -> Self {
        let child = command
            .arg("run")
            .arg(graph)
            // A broken graph misses its goals.
            .args(["--json", "--no-expect"])
            .args(ANY_LOSS)
            .args(arguments)
            .current_dir(workspace())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("motorium starts");
        let mut run = Self { child: Some(child), folder: RunFolder::open(Path::new("/none")) };
        let started = Instant::now();
        loop {
            let launcher = run.launcher();
            let own = RunFolder::list().into_iter().find(|folder| {
                folder.region().is_ok_and(|region| {
                    region.header().launcher.load(std::sync::atomic::Ordering::Relaxed) == launcher
                        && !region.components().is_empty()
                        && folder.plan().is_ok_and(|plan| is_ready(&plan, &region))
                })
            });
            if let Some(folder) = own {
                run.folder = folder;
                return run;
            }
            let child = run.child.as_mut().expect("the run has a process");
            if child.try_wait().expect("the process can be asked").is_some() {
                panic!("the run ended before it stepped:\n{}", run.text());
            }
            assert!(started.elapsed() < Duration::from_secs(60), "the run does not step");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    pub(crate) fn launcher(&self) -> u32 {
        self.child.as_ref().expect("the run has a process").id()
    }

    pub(crate) fn guard(&self) -> u32 {
        let region = self.folder.region().expect("the run has a region");
        region.header().guard.load(std::sync::atomic::Ordering::Relaxed)
    }

    pub(crate) fn pid_of(&self, component: &str) -> u32 {
        let plan = self.folder.plan().expect("the run has a plan");
        let index = plan.components.iter().position(|c| c.name == component).expect("the component exists");
        let region = self.folder.region().expect("the run has a region");
        region.components()[index].pid.load(std::sync::atomic::Ordering::Relaxed)
    }

    /// Waits until a component steps and the launcher has had time to notice it.
    pub(crate) fn await_running(&self, component: &str) {
        let plan = self.folder.plan().expect("the run has a plan");
        let index = plan.components.iter().position(|c| c.name == component).expect("the component exists");
        let region = self.folder.region().expect("the run has a region");
        let block = &region.components()[index];
        let (started, before) = (Instant::now(), steps(block));
        while block.phase() != motorium::region::Phase::Running || steps(block) < before + 20 {
            assert!(started.elapsed() < Duration::from_secs(10), "`{component}` does not step");
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(100));
    }

    /// Returns `true` if the run has ended.
    pub(crate) fn has_ended(&mut self) -> bool {
        let child = self.child.as_mut().expect("the run has a process");
        child.try_wait().expect("the process can be asked").is_some()
    }

    /// Returns the process and the number of steps of a component; `None` once the run, or its shared memory,
    /// is gone.
    pub(crate) fn glance(&self, component: &str) -> Option<(u32, u64)> {
        let (plan, region) = (self.folder.plan().ok()?, self.folder.region().ok()?);
        let index = plan.components.iter().position(|c| c.name == component)?;
        let block = region.components().get(index)?;
        Some((block.pid.load(std::sync::atomic::Ordering::Relaxed), steps(block)))
    }

    /// Waits for the end and returns exit code, report and standard error.
    pub(crate) fn finish(mut self) -> Ended {
        let output = self.child.take().expect("the run has a process").wait_with_output().expect("it ends");
        Ended::from_output(&output)
    }

    /// Returns the number of steps that a component has completed.
    pub(crate) fn steps_of(&self, component: &str) -> u64 {
        self.look(component, steps)
    }

    /// Waits until `component` has made more than `count` further steps.
    pub(crate) fn await_steps(&self, component: &str, count: u64) {
        let before = self.steps_of(component);
        await_that(component, || self.steps_of(component) > before + count);
    }

    /// Returns the number of values published on a topic.
    pub(crate) fn published(&self, topic: &str) -> u64 {
        let plan = self.folder.plan().expect("the run has a plan");
        let index = plan.topics.iter().position(|known| known.name == topic).expect("the topic exists");
        let region = self.folder.region().expect("the run has a region");
        region.topics()[index].published.load(std::sync::atomic::Ordering::Relaxed)
    }

    /// Returns `true` if a component applies its safe state.
    pub(crate) fn is_safe(&self, component: &str) -> bool {
        self.look(component, |block| block.safe.load(std::sync::atomic::Ordering::Relaxed) != 0)
    }

    fn look<T>(&self, component: &str, read: impl Fn(&motorium::region::ComponentBlock) -> T) -> T {
        let plan = self.folder.plan().expect("the run has a plan");
        let index = plan.components.iter().position(|c| c.name == component).expect("the component exists");
        read(&self.folder.region().expect("the run has a region").components()[index])
    }

    fn text(&mut self) -> String {
        let output = self.child.take().expect("the run has a process").wait_with_output().expect("it ends");
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
            // Its guard ends the run, which would otherwise disturb the next one.
            let killed = Instant::now();
            while self.folder.is_alive() && killed.elapsed() < Duration::from_secs(10) {
                std::thread::sleep(Duration::from_millis(5));
            }
        }
    }
}

fn steps(block: &motorium::region::ComponentBlock) -> u64 {
    block.steps.load(std::sync::atomic::Ordering::Relaxed)
}

/// A run that has ended.
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) report: Option<Report>,
    pub(crate) stderr: String,
    pub(crate) stdout: String,
}

impl Ended {
    pub(crate) fn from_output(output: &Output) -> Self {
        Self {
            code: output.status.code(),
            report: serde_json::from_slice(&output.stdout).ok(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        }
    }

    pub(crate) fn report(&self) -> &Report {
        self.report.as_ref().unwrap_or_else(|| panic!("no report:\n{}{}", self.stdout, self.stderr))
    }
}

/// Runs a graph to its end.
pub(crate) fn run(graph: &Path, arguments: &[&str]) -> Ended {
    let output = Command::new(MOTORIUM)
        .arg("run")
        .arg(graph)
        .arg("--json")
        .args(ANY_LOSS)
        .args(arguments)
        .current_dir(workspace())
        .stdin(Stdio::null())
        .output()
        .expect("motorium starts");
    Ended::from_output(&output)
}

pub(crate) fn kill(pid: u32) {
    signal(pid, rustix::process::Signal::KILL);
}

pub(crate) fn signal(pid: u32, signal: rustix::process::Signal) {
    let pid = rustix::process::Pid::from_raw(pid as i32).expect("a process id");
    rustix::process::kill_process(pid, signal).expect("the process is there");
}

/// Waits until a condition is true.
pub(crate) fn await_that(what: &str, is_so: impl Fn() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < Duration::from_secs(20), "{what}: not within 20 s");
        std::thread::sleep(Duration::from_millis(2));
    }
}

pub(crate) fn is_alive(pid: u32) -> bool {
    Watch::new(pid).is_ok_and(|watch| !watch.has_ended())
}

/// Waits until a process has ended.
pub(crate) fn await_end(pid: u32) {
    if let Ok(watch) = Watch::new(pid) {
        assert!(watch.wait(Some(Duration::from_secs(20))), "process {pid} does not end");
    }
}

/// Returns everything of a run in shared memory, which must be empty once the run has ended.
pub(crate) fn leftovers(run: &str) -> Vec<String> {
    std::fs::read_dir("/dev/shm")
        .expect("there is shared memory")
        .flatten()
        .flat_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let inside: Vec<String> = std::fs::read_dir(entry.path())
                .into_iter()
                .flatten()
                .flatten()
                .map(|inner| format!("{name}/{}", inner.file_name().to_string_lossy()))
                .collect();
            std::iter::once(name).chain(inside)
        })
        .filter(|name| name.contains(run))
        .collect()
}
